// Parsers of option values that several subcommands share: sizes, lists of numbers, memory, and choices of a
// few words. Each function takes the option's name for its message, parses the whole text, and throws
// UsageError with the text found and the form expected. Any thread may call them.
#pragma once

#include <glm/vec3.hpp>
#include <glm/vec4.hpp>

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "render/backend/backend.h"
#include "render/camera/camera.h"
#include "stream/codec/values_codec.h"

namespace curvisplat {

inline constexpr unsigned kMaxThreads = 1024;  // limit of --threads

/// A finite number.
double parseNumber(std::string_view option, std::string_view text);
/// A finite number above zero.
double parsePositive(std::string_view option, std::string_view text);
/// Finite numbers separated by commas, as many as `form` ("x,y,z") names.
std::vector<double> parseNumbers(std::string_view option, std::string_view text, std::string_view form);
/// "x,y,z".
glm::dvec3 parsePoint(std::string_view option, std::string_view text);
/// Whole numbers above zero separated by x, as many as `form` ("NIxNJxNK") names.
std::vector<uint64_t> parseExtents(std::string_view option, std::string_view text, std::string_view form);
/// "600x400", at most 16384 each way.
ImageSize parseImageSize(std::string_view option, std::string_view text);
/// A number of bytes, optionally with a unit K, M, G or T (powers of 1024): "2G", "1.5GiB", "512MB".
uint64_t parseByteSize(std::string_view option, std::string_view text);
/// A number of bytes as parseByteSize() reads it, but at most the machine's memory.
uint64_t parseMemory(std::string_view option, std::string_view text);
/// A whole number above zero, optionally with a suffix K, M or G (powers of 1000): "8M".
uint64_t parseCount(std::string_view option, std::string_view text);
/// "dark" (kDefaultBackground), "white", "black", "transparent" or "#rrggbb". Returns premultiplied red, green, blue, alpha.
glm::vec4 parseBackground(std::string_view option, std::string_view text);
/// The value of --OF-colour: "#rrggbb", "white", "black" or "dark", without alpha. "transparent" is refused: --OF-opacity says that.
glm::vec3 parseColour(std::string_view of, std::string_view text);

/// The value of --backend: "auto", "osmesa", "egl", "egl-quads" or "cpu".
Backend parseBackend(std::string_view text);

/// Throws UsageError unless `text` is one of the choices: "--volume of: expected on or off (did you mean
/// off?)".
void requireChoice(std::string_view option, std::string_view text, const std::vector<std::string>& choices);

/// The value of --value-precision: "auto", "normal" or "fine".
inline ValuePrecision parseValuePrecision(std::string_view option, std::string_view text) {
  requireChoice(option, text, {"auto", "normal", "fine"});
  if (text == "auto") return ValuePrecision::kAuto;
  return text == "fine" ? ValuePrecision::kFine : ValuePrecision::kNormal;
}

}  // namespace curvisplat
