// Reads and writes image files.
#pragma once

#include <cstdint>
#include <filesystem>

#include "render/image/image.h"

namespace curvisplat {

/// Writes .png (8 bits a channel), .exr or .pfm (32-bit floats), chosen by the name's extension. PNG and EXR
/// store alpha if the image is not fully opaque (PNG unassociated, EXR associated); PFM has no alpha. The
/// file appears whole or not at all. Throws UsageError for any other extension, Error if the file cannot be
/// written.
void writeImage(const Image& image, const std::filesystem::path& path);
/// Throws UsageError for a name that writeImage() would refuse. For checking before long work.
void checkImageName(const std::filesystem::path& path);
/// Memory that writeImage() needs for an image of `size`, beside the image itself.
uint64_t writingBytes(const std::filesystem::path& path, ImageSize size);
/// Reads PNG (8 and 16 bits a channel), scan-line EXR and PFM files. Throws Error.
Image readImage(const std::filesystem::path& path);

}  // namespace curvisplat
