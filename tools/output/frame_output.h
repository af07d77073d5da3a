// Writes the pictures of `render`: to one file, to one file per frame, or to a movie.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <string>

#include "render/image/image.h"
#include "render/image/image_channel.h"

namespace curvisplat {

/// File names that contain the frame number, from a pattern such as "frame_%04d.png".
class FrameNames {
 public:
  /// The file name (not its folders) must contain exactly one %d, optionally with a leading zero and a width
  /// of at most two digits: %4d, %04d. %% stands for a percent sign. Throws UsageError if it does not.
  explicit FrameNames(const std::filesystem::path& pattern);

  std::filesystem::path of(uint64_t frame) const;
  /// Whether `path` is the file of one of the first `frames` frames.
  bool include(const std::filesystem::path& path, uint64_t frames) const;

 private:
  std::filesystem::path folder_;
  std::string before_, after_;
  int width_ = 0;
  bool zeros_ = false;
};

/// Receives the pictures of frames 0, 1, 2, ... in this order.
class FrameOutput {
 public:
  virtual ~FrameOutput() = default;
  virtual void write(uint64_t frame, const Image& image) = 0;
  /// With further channels: to .exr files.
  virtual void writeWith(uint64_t frame, const Image& image, std::span<const ImageChannel> /*more*/) {
    write(frame, image);
  }
  /// Call once after the last frame: completes the output.
  virtual void finish() {}
};

/// Throws UsageError if `path` does not suit the output: one picture, or `frames` (a pattern or a movie).
void checkOutputName(const std::filesystem::path& path, bool frames, ImageSize size);

/// Requires that checkOutputName() accepted `path`. `frames_per_s` applies to a movie. Throws Error if ffmpeg
/// is needed and not installed.
std::unique_ptr<FrameOutput> makeFrameOutput(const std::filesystem::path& path, bool frames, ImageSize size,
                                             double frames_per_s);

}  // namespace curvisplat
