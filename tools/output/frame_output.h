// Writes the pictures of a command: to one file, to one file per frame (frame_%04d.png), or to a movie, which may be a web page. A
// file appears complete or not at all. ffmpeg, without a shell, encodes movies from raw pictures on its
// standard input. One thread at a time may use an object; writing a picture waits for its encoding and for
// the disk, or for ffmpeg.
#pragma once

#include <sys/types.h>

#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "render/image/image.h"
#include "stream/base/durable_file.h"

namespace curvisplat {

/// Whether the name ends in .mp4, .gif or .html, in letters of any case: one file of all frames.
bool isMovieName(const std::filesystem::path& path);
bool isGifName(const std::filesystem::path& path);
/// Whether ffmpeg is in PATH, which .mp4 and .gif need.
bool hasMovieEncoder();

/// A movie that ffmpeg encodes. Unless finish() was called, the destructor ends ffmpeg and removes the
/// unfinished movie.
class MovieWriter {
 public:
  /// Starts ffmpeg, with an encoder for H.264 (.mp4: width and height must be even) or for GIF. Follows a
  /// link at `path`. Throws Error if ffmpeg is not in PATH, or if `path` exists and is not a regular file.
  MovieWriter(const std::filesystem::path& path, ImageSize size, double frames_per_s);
  ~MovieWriter();
  MovieWriter(const MovieWriter&) = delete;
  MovieWriter& operator=(const MovieWriter&) = delete;

  /// Appends an opaque picture of the writer's size. Throws Error with ffmpeg's message if ffmpeg has ended.
  void append(const Image& image);
  /// Waits for ffmpeg and moves the complete movie to its path. Throws Error with ffmpeg's message if it
  /// failed.
  void finish();

 private:
  /// Closes ffmpeg's input and returns its wait status.
  int wait();
  /// Throws Error for a failed wait status of ffmpeg.
  [[noreturn]] void fail(int status) const;
  void closeInput();

  TemporaryFile unfinished_;
  const ImageSize size_;
  int input_ = -1;   // our end of ffmpeg's standard input
  int errors_ = -1;  // ffmpeg's standard error, a file in memory
  pid_t process_ = -1;
  std::vector<unsigned char> pixels_;  // one picture, RGB
};

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
  /// Writes a picture with further channels, which only .exr files hold.
  virtual void writeWith(uint64_t frame, const Image& image, std::span<const ImageChannel> /*more*/) {
    write(frame, image);
  }
  /// Call once after the last frame: completes the output.
  virtual void finish() {}
};

/// Throws UsageError if `path` does not suit the output: one picture, or `frames` (a pattern or a movie).
void checkOutputName(const std::filesystem::path& path, bool frames, ImageSize size);

/// Requires that checkOutputName() accepted `path`. `frames_per_s` applies to a movie. Throws Error if
/// ffmpeg is needed and not installed.
std::unique_ptr<FrameOutput> makeFrameOutput(const std::filesystem::path& path, bool frames, ImageSize size,
                                             double frames_per_s);

}  // namespace curvisplat
