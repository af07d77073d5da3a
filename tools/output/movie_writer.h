// Makes a movie of pictures through the ffmpeg program, which gets them raw on its standard input. No shell
// is in between.
#pragma once

#include <sys/types.h>

#include <filesystem>
#include <string>
#include <vector>

#include "render/image/image.h"

namespace curvisplat {

/// One thread. Unless finish() was called, the destructor ends ffmpeg and leaves nothing at `path`.
class MovieWriter {
 public:
  /// Starts ffmpeg: H.264 of `frames_per_s`. The sides of `size` are even. Throws Error if there is no ffmpeg
  /// in PATH, or if something else than a file is at `path`. Links are followed.
  MovieWriter(const std::filesystem::path& path, ImageSize size, double frames_per_s);
  ~MovieWriter();
  MovieWriter(const MovieWriter&) = delete;
  MovieWriter& operator=(const MovieWriter&) = delete;

  /// An opaque picture of the writer's size. Throws Error with what ffmpeg said if it has ended.
  void append(const Image& image);
  /// Waits for ffmpeg and puts the movie at its path, whole. Throws Error with what ffmpeg said if it failed.
  void finish();

 private:
  /// Closes its input and returns its wait status.
  int wait();
  /// For a wait status of ffmpeg that is no success.
  [[noreturn]] void fail(int status) const;
  void closeInput();

  const std::filesystem::path path_, unfinished_;
  const ImageSize size_;
  int input_ = -1;   // our end of ffmpeg's standard input
  int errors_ = -1;  // ffmpeg's standard error, a file in memory
  pid_t process_ = -1;
  std::vector<unsigned char> pixels_;  // of one picture
};

}  // namespace curvisplat
