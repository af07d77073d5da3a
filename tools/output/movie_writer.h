// Writes a movie by running ffmpeg, without a shell, and sending raw pictures to its standard input.
#pragma once

#include <sys/types.h>

#include <filesystem>
#include <string>
#include <vector>

#include "render/image/image.h"
#include "stream/base/durable_file.h"

namespace curvisplat {

/// Whether the name ends in .mp4 or .gif, in letters of any case.
bool isMovieName(const std::filesystem::path& path);
bool isGifName(const std::filesystem::path& path);

/// For one thread. Unless finish() was called, the destructor ends ffmpeg and removes the unfinished movie.
class MovieWriter {
 public:
  /// Starts ffmpeg, with an encoder for H.264 (.mp4: width and height must be even) or for GIF. Follows a link at `path`. Throws
  /// Error if ffmpeg is not in PATH, or if `path` exists and is not a regular file.
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

}  // namespace curvisplat
