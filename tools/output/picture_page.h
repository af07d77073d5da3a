// Writes the pictures of several frames as one web page (.html): a turntable that is dragged, or a film that plays. It needs no server and
// no network: the pictures are in it. The page appears complete or not at all. One thread at a time may use an object.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>

#include "render/image/image.h"
#include "stream/base/durable_file.h"
#include "stream/base/file.h"

namespace curvisplat {

/// Whether the name ends in .html, in letters of any case.
bool isPageName(const std::filesystem::path& path);

/// A page that is being written. The destructor removes it unless finish() was called.
class PicturePage {
 public:
  /// Follows a link at `path`. Throws Error if it cannot be written.
  PicturePage(const std::filesystem::path& path, ImageSize size, double frames_per_s);

  /// Appends a picture, losslessly: a third more bytes than its PNG has. Throws Error.
  void append(const Image& image);
  /// Moves the complete page to its path.
  void finish();

 private:
  void write(const std::string& text);

  const std::string name_;
  const double frames_per_s_;
  uint64_t pictures_ = 0;
  TemporaryFile unfinished_;
  OutputFile file_;
};

}  // namespace curvisplat
