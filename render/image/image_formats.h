// Encoders and decoders of each image format, in memory; image_file.h reads and writes the files.
//
// Decoders take untrusted bytes: every size is bounded by the number of bytes given before anything is
// allocated. They throw Error with a message that begins with `name`, the name of the file.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "render/image/image.h"
#include "render/image/image_channel.h"

namespace curvisplat {

using Bytes = std::vector<std::byte>;

/// Longest side of an image, decoded or encoded, in pixels.
inline constexpr int kLargestImageSide = 1 << 16;

/// kQuick: five times as fast, some tenths larger. The same pixels.
enum class PngEffort { kUsual, kQuick };
Bytes encodePng(const Image& image);
Bytes encodePng(const Image& image, PngEffort effort);
Bytes encodeExr(const Image& image);
Bytes encodeExr(const Image& image, std::span<const ImageChannel> more);
Bytes encodePfm(const Image& image);

Image decodePng(std::span<const std::byte> bytes, const std::string& name);
Image decodeExr(std::span<const std::byte> bytes, const std::string& name);
/// The channels that are no colours.
std::vector<ImageChannel> decodeExrChannels(std::span<const std::byte> bytes, const std::string& name);
Image decodePfm(std::span<const std::byte> bytes, const std::string& name);

/// Throws Error unless width and height are in [1, kLargestImageSide] and `packed_bytes` can hold that many
/// pixels of `bytes_per_pixel`, compressed by at most `largest_ratio`.
void requirePlausibleSize(int64_t width, int64_t height, uint64_t bytes_per_pixel, uint64_t packed_bytes,
                          uint64_t largest_ratio, const std::string& name);

/// A channel as 8 bits: clamped to 0..1 and rounded; NaN gives 0.
uint8_t toByte(float value);

/// Whether every alpha is 1.
bool isOpaque(const Image& image);

}  // namespace curvisplat
