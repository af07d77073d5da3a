// Reads and writes image files.
#pragma once

#include <cstdint>
#include <filesystem>
#include <span>
#include <vector>

#include "render/image/image.h"
#include "render/image/image_channel.h"

namespace curvisplat {

/// Writes .png (8 bits a channel), .exr or .pfm (32-bit floats), chosen by the name's extension. PNG and EXR
/// store alpha if the image is not fully opaque (PNG unassociated, EXR associated); PFM has no alpha. The
/// file appears whole or not at all. Throws UsageError for any other extension, Error if the file cannot be
/// written.
void writeImage(const Image& image, const std::filesystem::path& path);
/// With further channels, as EXR.
void writeExr(const Image& image, std::span<const ImageChannel> more, const std::filesystem::path& path);
/// The memory that a further channel takes for each pixel, beside its own.
inline constexpr uint64_t kChannelBytes = 8;
/// The channels of an EXR file but for its colours. Throws Error.
std::vector<ImageChannel> readChannels(const std::filesystem::path& path);
/// Whether writeImage() takes the name: .png, .exr or .pfm.
bool isImageName(const std::filesystem::path& path);
/// Throws UsageError for a name that writeImage() would refuse. For checking before long work.
void checkImageName(const std::filesystem::path& path);
/// Memory that writeImage() needs for an image of `size`, beside the image itself.
uint64_t writingBytes(const std::filesystem::path& path, ImageSize size);
/// Reads PNG (8 and 16 bits a channel), scan-line EXR and PFM files. Throws Error.
Image readImage(const std::filesystem::path& path);

}  // namespace curvisplat
