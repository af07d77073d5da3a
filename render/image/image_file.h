// Pictures as files.
#pragma once

#include <cstdint>
#include <filesystem>

#include "render/image/image.h"

namespace curvisplat {

/// Writes .png (8 bit), .exr or .pfm (32-bit float) by the name's ending. PNG and EXR keep alpha where the
/// image is not opaque everywhere (PNG unassociated, EXR associated); PFM has none. Written whole or not at
/// all. Throws UsageError for another ending, Error where the file cannot be written.
void writeImage(const Image& image, const std::filesystem::path& path);
/// Throws UsageError for a file name whose ending writeImage() would refuse; for use before long work.
void checkImageName(const std::filesystem::path& path);
/// What writeImage() takes in memory for an image of that size, beside the image.
uint64_t writingBytes(const std::filesystem::path& path, ImageSize size);
/// Reads what writeImage() writes, and ordinary PNG (8 and 16 bit), scan-line EXR and PFM files. Throws
/// Error.
Image readImage(const std::filesystem::path& path);

}  // namespace curvisplat
