#include "tools/options/option_parsers.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <limits>
#include <optional>

#include "preprocess/convert/memory_plan.h"
#include "render/colour/function_parts.h"
#include "stream/base/error.h"
#include "stream/base/text.h"

namespace curvisplat {
namespace {

constexpr uint64_t kMaxImageSide = 16384;

/// Parses all of `text` as a T; nullopt if any of it is left over.
template <typename T>
std::optional<T> parseWhole(std::string_view text) {
  T value{};
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size()) return std::nullopt;
  return value;
}

std::vector<std::string_view> split(std::string_view text, char separator) {
  std::vector<std::string_view> parts;
  for (size_t begin = 0;;) {
    const size_t end = text.find(separator, begin);
    parts.push_back(text.substr(begin, end - begin));
    if (end == std::string_view::npos) return parts;
    begin = end + 1;
  }
}

/// " (did you mean 600x400?)" for "600*400" or "600,400".
std::string withTheRightSign(std::string_view text) {
  std::string meant(text);
  for (char& letter : meant)
    if (std::string_view("*,X; ").find(letter) != std::string_view::npos) letter = 'x';
  const bool is_size = meant != text && meant.find_first_not_of("0123456789x") == std::string::npos;
  return is_size ? fmt::format(" (did you mean {}?)", meant) : "";
}

}  // namespace

double parseNumber(std::string_view option, std::string_view text) {
  return parseNumbers(option, text, "a number").front();
}

double parsePositive(std::string_view option, std::string_view text) {
  const double value = parseNumber(option, text);
  if (!(value > 0)) throw UsageError("{} {}: expected a number above zero", option, text);
  return value;
}

std::vector<double> parseNumbers(std::string_view option, std::string_view text, std::string_view form) {
  std::vector<double> numbers;
  for (const std::string_view part : split(text, ',')) {
    const auto number = parseWhole<double>(part);
    if (!number || !std::isfinite(*number))
      throw UsageError("{} {}: expected {}, but '{}' is not a finite number", option, text, form, part);
    numbers.push_back(*number);
  }
  const size_t expected = split(form, ',').size();
  if (numbers.size() != expected)
    throw UsageError("{} {}: expected {}, found {}", option, text, form, countText(numbers.size(), "number"));
  return numbers;
}

glm::dvec3 parsePoint(std::string_view option, std::string_view text) {
  const auto numbers = parseNumbers(option, text, "x,y,z");
  return {numbers[0], numbers[1], numbers[2]};
}

std::vector<uint64_t> parseExtents(std::string_view option, std::string_view text, std::string_view form) {
  std::vector<uint64_t> extents;
  for (const std::string_view part : split(text, 'x')) {
    const auto extent = parseWhole<uint64_t>(part);
    if (!extent || *extent == 0)
      throw UsageError("{} {}: expected {}, but '{}' is not a whole number above zero{}", option, text, form,
                       part, withTheRightSign(text));
    extents.push_back(*extent);
  }
  if (const size_t found = extents.size(); found != split(form, 'x').size())
    throw UsageError("{} {}: expected {}, found {}", option, text, form, countText(found, "number"));
  return extents;
}

ImageSize parseImageSize(std::string_view option, std::string_view text) {
  const auto sides = parseExtents(option, text, "WIDTHxHEIGHT");
  if (std::max(sides[0], sides[1]) > kMaxImageSide)
    throw UsageError("{} {}: expected at most {} pixels in each direction", option, text, kMaxImageSide);
  return {static_cast<int>(sides[0]), static_cast<int>(sides[1])};
}

uint64_t parseByteSize(std::string_view option, std::string_view text) {
  const std::string_view digits = text.substr(0, text.find_first_not_of("0123456789."));
  const std::string_view unit = text.substr(digits.size());
  int shift = unit.empty() || unit == "B" ? 0 : -1;
  for (int prefix = 0; prefix < 4 && !unit.empty(); ++prefix) {
    const std::string_view rest = unit.substr(1);
    if (std::toupper(unit[0]) == "KMGT"[prefix] && (rest.empty() || rest == "B" || rest == "iB"))
      shift = 10 * (prefix + 1);
  }
  const auto number = parseWhole<double>(digits);
  const double bytes = number ? std::floor(std::ldexp(*number, std::max(shift, 0))) : 0;
  if (!number || shift < 0 || bytes < 1 || bytes > 0x1p62)
    throw UsageError("{} {}: expected a size such as 512M or 2G (K, M, G, T; powers of 1024)", option, text);
  return static_cast<uint64_t>(bytes);
}

uint64_t parseMemory(std::string_view option, std::string_view text) {
  return std::min(parseByteSize(option, text), machineMemory());
}

uint64_t parseCount(std::string_view option, std::string_view text) {
  const std::string_view digits = text.substr(0, text.find_first_not_of("0123456789"));
  const std::string_view letter = text.substr(digits.size());
  const auto number = parseWhole<uint64_t>(digits);
  const size_t place = std::string_view("KMGkmg").find(letter);
  const size_t power = letter.empty() || place == std::string_view::npos ? 0 : place % 3 + 1;
  uint64_t count = number.value_or(0);
  bool fits = count > 0 && letter.size() <= 1 && power <= 3 && (letter.empty() || power > 0);
  for (size_t n = 0; n < power && fits; ++n) {
    fits = count <= std::numeric_limits<uint64_t>::max() / 1000;
    count *= 1000;
  }
  if (!fits)
    throw UsageError("{} {}: expected a number above zero such as 500000 or 8M (K, M, G; powers of 1000)",
                     option, text);
  return count;
}

namespace {

/// "dark", "white", "black" or "#rrggbb", opaque.
std::optional<glm::vec4> opaqueColour(std::string_view text) {
  if (text == "dark") return kDefaultBackground;
  if (text == "white") return glm::vec4(1);
  if (text == "black") return glm::vec4(0, 0, 0, 1);
  uint32_t rgb = 0;
  if (text.size() == 7 && text[0] == '#') {
    const auto [end, error] = std::from_chars(text.data() + 1, text.data() + 7, rgb, 16);
    if (error == std::errc() && end == text.data() + 7)
      return glm::vec4(static_cast<float>(rgb >> 16 & 255) / 255, static_cast<float>(rgb >> 8 & 255) / 255,
                       static_cast<float>(rgb & 255) / 255, 1);
  }
  return std::nullopt;
}

}  // namespace

glm::vec4 parseBackground(std::string_view option, std::string_view text) {
  if (text == "transparent") return {0, 0, 0, 0};
  if (const auto colour = opaqueColour(text)) return *colour;
  const std::vector<std::string> names{"dark", "white", "black", "transparent"};
  throw UsageError("{} {}: expected dark, white, black, transparent or #rrggbb{}", option, text,
                   didYouMean(text, names));
}

glm::vec3 parseColour(std::string_view of, std::string_view text) {
  if (text == "transparent")
    throw UsageError("--{0}-colour transparent: give #rrggbb, and --{0}-opacity", of);
  const auto colour = opaqueColour(text);
  if (!colour) throw UsageError("--{}-colour {}: expected #rrggbb such as #e07020, white or black", of, text);
  return glm::vec3(*colour);
}

Backend parseBackend(std::string_view text) {
  if (text == "auto") return Backend::kAutomatic;
  if (text == "osmesa") return Backend::kOsmesa;
  if (text == "egl") return Backend::kEgl;
  if (text == "egl-quads") return Backend::kEglQuads;
  if (text == "cpu") return Backend::kCpu;
  requireChoice("--backend", text, {"auto", "osmesa", "egl", "egl-quads", "cpu"});
  return Backend::kAutomatic;
}

void requireChoice(std::string_view option, std::string_view text, const std::vector<std::string>& choices) {
  std::string listed;
  for (size_t n = 0; n < choices.size(); ++n) {
    if (choices[n] == text) return;
    listed += (n == 0 ? "" : n + 1 == choices.size() ? " or " : ", ") + choices[n];
  }
  throw UsageError("{} {}: expected {}{}", option, text, listed, didYouMean(text, choices));
}

}  // namespace curvisplat
