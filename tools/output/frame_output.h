// Where `render` puts its pictures: one file, a file a frame, or a movie.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>

#include "render/image/image.h"

namespace curvisplat {

/// File names with the frame's number in them: "frame_%04d.png".
class FrameNames {
 public:
  /// Exactly one %d in the file's name (folders have the names they have), which may have a width of at most
  /// two digits and a leading zero: %4d, %04d. A percent sign of the name itself is written %%. Throws
  /// UsageError that says what is wrong.
  explicit FrameNames(const std::filesystem::path& pattern);

  std::filesystem::path of(uint64_t frame) const;
  /// Whether `path` is the name of one of the first `frames`.
  bool include(const std::filesystem::path& path, uint64_t frames) const;

 private:
  std::filesystem::path folder_;
  std::string before_, after_;
  int width_ = 0;
  bool zeros_ = false;
};

/// Takes the pictures of frames 0, 1, 2, ... in this order.
class FrameOutput {
 public:
  virtual ~FrameOutput() = default;
  virtual void write(uint64_t frame, const Image& image) = 0;
  /// Once, after the last frame: what was written is whole now.
  virtual void finish() {}
};

bool isMovieName(const std::filesystem::path& path);

/// Throws UsageError where `path` is no name for what is to be written: one picture, or frames.
void checkOutputName(const std::filesystem::path& path, bool frames, ImageSize size);

/// For a name that checkOutputName() lets pass. `frames`: a file a frame, or a movie of `frames_per_s`.
/// Throws Error where a movie is asked for and there is no ffmpeg.
std::unique_ptr<FrameOutput> makeFrameOutput(const std::filesystem::path& path, bool frames, ImageSize size,
                                             double frames_per_s);

}  // namespace curvisplat
