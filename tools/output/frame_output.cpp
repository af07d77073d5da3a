#include "tools/output/frame_output.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <charconv>
#include <system_error>

#include "render/image/image_file.h"
#include "stream/base/error.h"
#include "stream/base/file.h"
#include "stream/base/paths.h"
#include "stream/base/trace.h"
#include "tools/output/movie_writer.h"

namespace curvisplat {
namespace {

/// A picture that is encoded and written.
void writeTraced(const Image& image, const std::filesystem::path& path) {
  const TraceScope trace("write picture");
  writeImage(image, path);
}

void writeTraced(const Image& image, std::span<const ImageChannel> more, const std::filesystem::path& path) {
  const TraceScope trace("write picture");
  writeExr(image, more, path);
}

class SingleFile : public FrameOutput {
 public:
  explicit SingleFile(std::filesystem::path path) : path_(std::move(path)) {}
  void write(uint64_t, const Image& image) override { writeTraced(image, path_); }
  void writeWith(uint64_t, const Image& image, std::span<const ImageChannel> more) override {
    writeTraced(image, more, path_);
  }

 private:
  const std::filesystem::path path_;
};

class NumberedFiles : public FrameOutput {
 public:
  explicit NumberedFiles(const std::filesystem::path& pattern) : names_(pattern) {}
  void write(uint64_t frame, const Image& image) override { writeTraced(image, names_.of(frame)); }
  void writeWith(uint64_t frame, const Image& image, std::span<const ImageChannel> more) override {
    writeTraced(image, more, names_.of(frame));
  }

 private:
  const FrameNames names_;
};

class Movie : public FrameOutput {
 public:
  Movie(const std::filesystem::path& path, ImageSize size, double frames_per_s)
      : writer_(path, size, frames_per_s) {}
  void write(uint64_t, const Image& image) override { writer_.append(image); }
  void finish() override { writer_.finish(); }

 private:
  MovieWriter writer_;
};

[[noreturn]] void refusePattern(const std::string& pattern, std::string_view why) {
  throw UsageError("-o {}: {}; use a name such as frame_%04d.png, or a movie: .mp4 or .gif", pattern, why);
}

}  // namespace

FrameNames::FrameNames(const std::filesystem::path& pattern_path) : folder_(pattern_path.parent_path()) {
  const std::string pattern = pattern_path.filename().string();
  int numbers = 0;
  for (size_t at = 0; at < pattern.size(); ++at) {
    std::string& part = numbers == 0 ? before_ : after_;
    if (pattern[at] != '%') {
      part += pattern[at];
    } else if (pattern.substr(at + 1, 1) == "%") {
      part += pattern[++at];
    } else {
      const size_t end = std::min(pattern.find_first_not_of("0123456789", at + 1), pattern.size());
      const std::string flags = pattern.substr(at + 1, end - at - 1);
      if (end == pattern.size() || pattern[end] != 'd')
        refusePattern(pattern, fmt::format("'{}' is not a frame number", pattern.substr(at, end + 1 - at)));
      if (++numbers > 1) refusePattern(pattern, "found two frame numbers, expected one");
      zeros_ = flags.starts_with('0');
      const std::string width = flags.substr(zeros_ ? 1 : 0);
      if (width.size() > 2) refusePattern(pattern, "the frame number is wider than 99 digits");
      width_ = width.empty() ? 0 : std::stoi(width);
      at = end;
    }
  }
  if (numbers > 0) return;
  const std::string ending = pattern_path.extension().string();
  if (!ending.empty() && !isImageName(pattern_path))
    refusePattern(pattern, fmt::format("'{}' is not the ending of a supported picture or movie", ending));
  refusePattern(pattern, "all frames would have the same name");
}

std::filesystem::path FrameNames::of(uint64_t frame) const {
  const std::string number =
      zeros_ ? fmt::format("{:0{}}", frame, width_) : fmt::format("{:{}}", frame, width_);
  return folder_ / (before_ + number + after_);
}

bool FrameNames::include(const std::filesystem::path& path, uint64_t frames) const {
  const std::string name = path.filename().string();
  if (name.size() <= before_.size() + after_.size()) return false;
  const std::string number = name.substr(before_.size(), name.size() - before_.size() - after_.size());
  const size_t digits = std::min(number.find_first_not_of(' '), number.size());
  uint64_t frame = 0;
  const auto [end, error] = std::from_chars(number.data() + digits, number.data() + number.size(), frame);
  std::error_code none_there;
  return error == std::errc{} && frame < frames && of(frame).filename() == name &&
         std::filesystem::equivalent(folderOf(path), folderOf(of(frame)), none_there);
}

void checkOutputName(const std::filesystem::path& path, bool frames, ImageSize size) {
  if (!isMovieName(path)) {
    if (frames) (void)FrameNames(path);
    checkImageName(path);
    return;
  }
  if (!frames) throw UsageError("-o {}: a movie needs --orbit, --path or --steps", path.string());
  if (!isGifName(path) && (size.width % 2 != 0 || size.height % 2 != 0))
    throw UsageError("--size {}x{}: the width and height of an .mp4 must be even", size.width, size.height);
}

std::unique_ptr<FrameOutput> makeFrameOutput(const std::filesystem::path& path, bool frames, ImageSize size,
                                             double frames_per_s) {
  if (isMovieName(path)) return std::make_unique<Movie>(path, size, frames_per_s);
  if (frames) return std::make_unique<NumberedFiles>(path);
  return std::make_unique<SingleFile>(path);
}

}  // namespace curvisplat
