#include "preprocess/formats/exodus/exodus_names.h"

#include <fmt/format.h>

#include <charconv>
#include <set>
#include <string_view>
#include <system_error>

#include "stream/base/file.h"
#include "stream/base/text.h"

namespace curvisplat {
namespace {

/// Takes `mark` and the number behind it from the end of the name. Returns the digits; empty if there are none.
std::string takeNumber(std::string& name, std::string_view mark) {
  const size_t digits = name.find_last_not_of("0123456789") + 1;
  if (digits == name.size() || digits <= mark.size() || name.size() - digits > 9 ||
      std::string_view(name).substr(0, digits).substr(digits - mark.size()) != mark)
    return "";
  const std::string number = name.substr(digits);
  name.resize(digits - mark.size());
  return number;
}

uint64_t valueOf(const std::string& digits) {
  uint64_t value = 0;
  std::from_chars(digits.data(), digits.data() + digits.size(), value);
  return value;
}

}  // namespace

ExodusName exodusName(const std::filesystem::path& path) {
  ExodusName name;
  name.run = path.filename().string();
  std::string rest = name.run;
  const std::string processor = takeNumber(rest, "."), count = takeNumber(rest, ".");
  if (!count.empty() && processor.size() == count.size() && valueOf(processor) < valueOf(count)) {
    name.processor = valueOf(processor);
    name.processors = valueOf(count);
    name.run = rest;
  }
  name.goes_on = takeNumber(name.run, "-s").size() >= 3;
  if (!name.goes_on && name.processor) name.run = rest;
  if (!name.goes_on && !name.processor) name.run = path.filename().string();
  return name;
}

std::string noteOnOtherExodusFiles(const std::filesystem::path& path) {
  const ExodusName own = exodusName(path);
  if (own.processor && own.processors > 1)
    return fmt::format(
        "{}: is the part of processor {} of {}, numbered from 0; give the files of all of them, or join them "
        "with epu",
        path.string(), *own.processor, own.processors);
  std::set<std::string> others;
  std::error_code error;
  for (const auto& entry : std::filesystem::directory_iterator(folderOf(path), error)) {
    const ExodusName other = exodusName(entry.path());
    if (other.goes_on && !other.processor && other.run == own.run &&
        entry.path().filename() != path.filename())
      others.insert(entry.path().filename().string());
  }
  if (others.empty() || own.goes_on) return "";
  return fmt::format("{}: the run goes on in {}, {} to {}; give them all ({}) for its later time steps",
                     path.string(), countText(others.size(), "file"), *others.begin(), *others.rbegin(),
                     shellWord(path.string() + "*"));
}

}  // namespace curvisplat
