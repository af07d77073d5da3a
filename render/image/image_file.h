// Reads and writes image files, and encodes and decodes each format in memory: PNG, EXR and PFM; JPEG is only read.
//
// A file that is written appears whole or not at all. Decoders take untrusted bytes: every size is compared
// with the number of bytes given before anything is allocated. They throw Error with a message that begins
// with the file's name. Encoding takes up to 48 bytes a pixel beside the image (writingBytes()). Any thread.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "render/image/image.h"

namespace curvisplat {

/// Writes .png (8 bits a channel), .exr or .pfm (32-bit floats), chosen by the name's extension. PNG and EXR
/// store alpha if the image is not fully opaque (PNG unassociated, EXR associated); PFM has no alpha. The
/// file appears whole or not at all. Throws UsageError for any other extension and as checkImageSize(), Error if
/// the file cannot be written.
void writeImage(const Image& image, const std::filesystem::path& path);
/// Writes an EXR file that has further channels beside the colours.
void writeExr(const Image& image, std::span<const ImageChannel> more, const std::filesystem::path& path);
/// The memory that a further channel takes for each pixel, beside its own.
inline constexpr uint64_t kChannelBytes = 8;
/// Reads the channels of an EXR file that are not colours. Throws Error.
std::vector<ImageChannel> readChannels(const std::filesystem::path& path);
/// Whether writeImage() takes the name: .png, .exr or .pfm.
bool isImageName(const std::filesystem::path& path);
/// Throws UsageError for a name that writeImage() would refuse. Call it before long work.
void checkImageName(const std::filesystem::path& path);
/// Throws UsageError unless width and height are in [1, kLargestImageSide]: Python's arrays may have any.
void checkImageSize(uint64_t width, uint64_t height, const std::filesystem::path& path);
/// Memory that writeImage() needs for an image of `size`, beside the image itself.
uint64_t writingBytes(const std::filesystem::path& path, ImageSize size);
/// Reads PNG (8 and 16 bits a channel), JPEG, scan-line EXR and PFM files. Throws Error.
Image readImage(const std::filesystem::path& path);
/// The size that the file's header states, which nothing else in it need bear out. Reads at most 4 MiB. Throws
/// Error as readImage(), and for an EXR file of more channels than a map has: decoding expands each of them.
ImageSize readImageSize(const std::filesystem::path& path);

/// An encoded image: all bytes of its file.
using Bytes = std::vector<std::byte>;

/// Longest side of an image, decoded or encoded, in pixels.
inline constexpr int kLargestImageSide = 1 << 16;

/// kQuick encodes the same pixels five times as fast into files that are some tenths larger.
enum class PngEffort { kUsual, kQuick };
Bytes encodePng(const Image& image);
Bytes encodePng(const Image& image, PngEffort effort);
Bytes encodeExr(const Image& image);
Bytes encodeExr(const Image& image, std::span<const ImageChannel> more);
Bytes encodePfm(const Image& image);

/// Decode an image file. `name` is the file's, for messages.
Image decodePng(std::span<const std::byte> bytes, const std::string& name);
Image decodeExr(std::span<const std::byte> bytes, const std::string& name);
/// Decodes the channels that are not colours.
std::vector<ImageChannel> decodeExrChannels(std::span<const std::byte> bytes, const std::string& name);
Image decodePfm(std::span<const std::byte> bytes, const std::string& name);
Image decodeJpeg(std::span<const std::byte> bytes, const std::string& name);
/// The size by the header alone; `bytes` may end behind it.
ImageSize sizeOfPng(std::span<const std::byte> bytes, const std::string& name);
ImageSize sizeOfExr(std::span<const std::byte> bytes, const std::string& name);
ImageSize sizeOfPfm(std::span<const std::byte> bytes, const std::string& name);
ImageSize sizeOfJpeg(std::span<const std::byte> bytes, const std::string& name);

/// Words for a message about a header that ends early, if it is longer than readImageSize() reads; else empty.
std::string limitOfHeader(std::span<const std::byte> bytes);

/// Throws Error unless width and height are in [1, kLargestImageSide].
void requirePossibleSize(int64_t width, int64_t height, const std::string& name);
/// Throws Error as requirePossibleSize(), and unless `packed_bytes` can hold that many pixels of `bytes_per_pixel`, compressed by
/// at most `largest_ratio`.
void requirePlausibleSize(int64_t width, int64_t height, uint64_t bytes_per_pixel, uint64_t packed_bytes,
                          uint64_t largest_ratio, const std::string& name);

/// A channel as 8 bits: clamped to 0..1 and rounded; NaN gives 0.
uint8_t toByte(float value);

/// Whether every alpha is 1.
bool isOpaque(const Image& image);

}  // namespace curvisplat
