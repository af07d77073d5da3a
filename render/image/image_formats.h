// The image files behind render/image.h: each format in memory. Decoders trust nothing: every size is bounded
// by the bytes that are there before memory is asked for, and what is wrong is an Error that begins with
// `name`, the file's.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "render/image/image.h"

namespace curvisplat {

using Bytes = std::vector<std::byte>;

/// Neither a decoded image nor an encoded one has a longer side.
inline constexpr int kLargestImageSide = 1 << 16;

Bytes encodePng(const Image& image);
Bytes encodeExr(const Image& image);
Bytes encodePfm(const Image& image);

Image decodePng(std::span<const std::byte> bytes, const std::string& name);
Image decodeExr(std::span<const std::byte> bytes, const std::string& name);
Image decodePfm(std::span<const std::byte> bytes, const std::string& name);

/// Throws Error unless width and height are in [1, kLargestImageSide] and `packed_bytes` of a file can hold
/// an image of `bytes_per_pixel` that was compressed by at most `largest_ratio`.
void requirePlausibleSize(int64_t width, int64_t height, uint64_t bytes_per_pixel, uint64_t packed_bytes,
                          uint64_t largest_ratio, const std::string& name);

/// A channel of 8 bits: rounded, values beyond 0 and 1 cut off, 0 for what is no number.
uint8_t toByte(float value);

/// Whether every alpha is 1.
bool isOpaque(const Image& image);

}  // namespace curvisplat
