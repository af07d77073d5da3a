#include "preprocess/formats/netcdf/tile_number.h"

#include <charconv>
#include <string>

#include "preprocess/formats/netcdf/cf_roles.h"
#include "stream/base/words.h"

namespace curvisplat {
namespace {

constexpr size_t kMaxDigits = 4;

bool isLetter(char c) {
  return c >= 'a' && c <= 'z';
}

bool isDigit(char c) {
  return c >= '0' && c <= '9';
}

}  // namespace

std::optional<uint32_t> tileNumber(const std::filesystem::path& path) {
  static const std::string word = "tile";
  const std::string name = lowerCase(path.filename().string());
  for (size_t at = name.rfind(word); at != std::string::npos; at = at > 0 ? name.rfind(word, at - 1) : at) {
    const size_t begin = at + word.size();
    size_t end = begin;
    while (end < name.size() && isDigit(name[end])) ++end;
    const bool whole = (at == 0 || !isLetter(name[at - 1])) && (end == name.size() || !isLetter(name[end]));
    if (whole && end > begin && end - begin <= kMaxDigits) {
      uint32_t number = 0;
      std::from_chars(name.data() + begin, name.data() + end, number);
      return number;
    }
    if (at == 0) break;
  }
  return std::nullopt;
}

}  // namespace curvisplat
