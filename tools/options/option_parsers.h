// Words of the command line that several subcommands share: sizes, lists of numbers, memory. Each function
// takes the option's name for its message, reads the whole text, and throws UsageError that shows what was
// given and what is expected.
#pragma once

#include <cstdint>
#include <glm/vec3.hpp>
#include <glm/vec4.hpp>
#include <string_view>
#include <vector>

#include "render/camera/camera.h"
#include "render/frame/backend.h"

namespace curvisplat {

inline constexpr unsigned kMaxThreads = 1024;  // of --threads

/// One finite number.
double parseNumber(std::string_view option, std::string_view text);
/// One finite number above zero.
double parsePositive(std::string_view option, std::string_view text);
/// As many finite numbers as `form` ("x,y,z") names, separated by commas.
std::vector<double> parseNumbers(std::string_view option, std::string_view text, std::string_view form);
/// "x,y,z".
glm::dvec3 parsePoint(std::string_view option, std::string_view text);
/// As many whole numbers above zero as `form` ("NIxNJxNK") names, separated by x.
std::vector<uint64_t> parseExtents(std::string_view option, std::string_view text, std::string_view form);
/// "600x400", at most 16384 each way.
ImageSize parseImageSize(std::string_view option, std::string_view text);
/// Bytes: a number with K, M, G or T (powers of 1024; "2G", "1.5GiB", "512MB"), or of bytes.
uint64_t parseByteSize(std::string_view option, std::string_view text);
/// The same, of memory: no more than the machine has.
uint64_t parseMemory(std::string_view option, std::string_view text);
/// A whole number of things above zero: with K, M or G (powers of 1000; "8M"), or without.
uint64_t parseCount(std::string_view option, std::string_view text);
/// "white", "black", "transparent" or "#rrggbb"; premultiplied red, green, blue, alpha.
glm::vec4 parseBackground(std::string_view option, std::string_view text);

/// "auto", "osmesa", "egl" or "cpu", of --backend.
Backend parseBackend(std::string_view text);

}  // namespace curvisplat
