#include "tests/fuzz/fuzz_target.h"

#include <fmt/format.h>

#include <cstdio>
#include <cstdlib>
#include <fstream>

#include "stream/base/error.h"
#include "tests/support/temporary_folder.h"

namespace curvisplat {

std::vector<FuzzTarget>& fuzzTargets() {
  static std::vector<FuzzTarget> targets;
  return targets;
}

std::string runFuzzTarget(const FuzzTarget& target, std::span<const std::byte> bytes) {
  try {
    target.run(bytes);
    return "";
  } catch (const Error& error) {
    const std::string text = error.what();
    if (!text.empty() && text.find('\n') == std::string::npos) return text;
    fmt::print(stderr, "{}: an Error that is not one line: {}\n", target.name, text);
    std::abort();
  } catch (const std::exception& error) {
    fmt::print(stderr, "{}: an exception that is no Error: {}\n", target.name, error.what());
    std::abort();
  }
}

std::filesystem::path fuzzFolder() {
  static const TemporaryFolder folder;
  return folder.path();
}

std::filesystem::path fuzzFile(std::string_view name, std::span<const std::byte> bytes) {
  std::filesystem::path path = fuzzFolder() / name;
  std::ofstream file(path, std::ios::binary | std::ios::trunc);
  file.write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
  if (!file.flush()) throw std::runtime_error(path.string() + ": cannot be written");
  return path;
}

}  // namespace curvisplat
