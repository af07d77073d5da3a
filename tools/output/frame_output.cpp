#include "tools/output/frame_output.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <spawn.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <cerrno>
#include <charconv>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <sstream>
#include <string>
#include <system_error>
#include <utility>

#include "render/image/image_file.h"
#include "stream/base/error.h"
#include "stream/base/file.h"
#include "stream/base/os.h"
#include "stream/base/trace.h"
#include "tools/output/picture_page.h"

extern char** environ;

namespace curvisplat {
namespace {

[[noreturn]] void failToStart(const std::filesystem::path& movie, int error) {
  if (error == ENOENT)
    throw Error(
        "{}: ffmpeg, which writes movies, was not found in PATH; install it, or write numbered pictures: "
        "frame_%04d.png",
        movie.string());
  throw Error("{}: cannot start ffmpeg: {}", movie.string(), std::strerror(error));
}

pid_t start(std::vector<std::string> arguments, int input, int errors, const std::filesystem::path& movie) {
  std::vector<char*> argv;
  for (std::string& argument : arguments) argv.push_back(argument.data());
  argv.push_back(nullptr);
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_adddup2(&actions, input, STDIN_FILENO);
  posix_spawn_file_actions_adddup2(&actions, errors, STDOUT_FILENO);
  posix_spawn_file_actions_adddup2(&actions, errors, STDERR_FILENO);
  // A process group of its own: Ctrl-C is for curvisplat, which stops ffmpeg in order.
  posix_spawnattr_t attributes;
  posix_spawnattr_init(&attributes);
  posix_spawnattr_setpgroup(&attributes, 0);
  posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETPGROUP);
  pid_t process = -1;
  const int error = posix_spawnp(&process, "ffmpeg", &actions, &attributes, argv.data(), environ);
  posix_spawnattr_destroy(&attributes);
  posix_spawn_file_actions_destroy(&actions);
  if (error != 0) failToStart(movie, error);
  return process;
}

/// The first line of a file.
std::string firstLineOf(int file) {
  std::array<char, 300> buffer;
  const ssize_t got = pread(file, buffer.data(), buffer.size(), 0);
  const std::string text(buffer.data(), got > 0 ? static_cast<size_t>(got) : 0);
  return text.substr(0, text.find('\n'));
}

/// H.264 for .mp4. GIFs have 256 colours: a palette for each frame, so that no frame waits for the last.
std::vector<std::string> encoderOf(bool is_gif) {
  if (is_gif)
    return {"-filter_complex",
            "split[a][b];[a]palettegen=stats_mode=single[p];[b][p]paletteuse=new=1:dither=sierra2_4a",
            "-loop",
            "0",
            "-f",
            "gif"};
  return {"-c:v", "libx264", "-crf", "18", "-pix_fmt", "yuv420p", "-movflags", "+faststart", "-f", "mp4"};
}

}  // namespace

bool isMovieName(const std::filesystem::path& path) {
  return extensionOf(path) == ".mp4" || isGifName(path) || isPageName(path);
}

bool isGifName(const std::filesystem::path& path) {
  return extensionOf(path) == ".gif";
}

bool hasMovieEncoder() {
  const char* const path = std::getenv("PATH");
  std::istringstream folders(path ? path : "");
  for (std::string folder; std::getline(folders, folder, ':');)
    if (access((std::filesystem::path(folder.empty() ? "." : folder) / "ffmpeg").c_str(), X_OK) == 0)
      return true;
  return false;
}

MovieWriter::MovieWriter(const std::filesystem::path& path, ImageSize size, double frames_per_s)
    : unfinished_(writableTarget(path)), size_(size), pixels_(3 * size.pixels()) {
  // Sockets instead of a pipe: writing to a process that has ended is then an error, not SIGPIPE.
  std::array<int, 2> ends{-1, -1};
  errors_ = os::openInMemory("ffmpeg");
  if (errors_ < 0 || os::connectSockets(ends) != 0) {
    const int error = errno;
    if (errors_ >= 0) close(errors_);
    failToStart(path, error);
  }
  input_ = ends[0];
  try {
    // ffmpeg would take a relative name that begins with a dash for an option, and one with a colon for a
    // protocol.
    const std::string output = std::filesystem::absolute(unfinished_.path()).string();
    std::vector<std::string> arguments{"ffmpeg",
                                       "-nostdin",
                                       "-loglevel",
                                       "error",
                                       "-xerror",  // else its status is 0 where the file's end is not written
                                       "-y",
                                       "-f",
                                       "rawvideo",
                                       "-pixel_format",
                                       "rgb24",
                                       "-video_size",
                                       fmt::format("{}x{}", size.width, size.height),
                                       "-framerate",
                                       fmt::format("{}", frames_per_s),
                                       "-i",
                                       "pipe:0"};
    for (std::string& word : encoderOf(isGifName(path))) arguments.push_back(std::move(word));
    arguments.push_back("file:" + output);
    process_ = start(std::move(arguments), ends[1], errors_, path);
  } catch (...) {
    close(ends[1]);
    close(errors_);
    closeInput();
    throw;
  }
  close(ends[1]);
}

MovieWriter::~MovieWriter() {
  if (process_ >= 0) {
    kill(process_, SIGKILL);
    wait();
  }
  closeInput();
  close(errors_);
}

void MovieWriter::closeInput() {
  if (input_ >= 0) close(input_);
  input_ = -1;
}

int MovieWriter::wait() {
  closeInput();
  int status = 0;
  while (waitpid(process_, &status, 0) < 0 && errno == EINTR) {
  }
  process_ = -1;
  return status;
}

void MovieWriter::fail(int status) const {
  const std::string message = unfinished_.aboutTarget(firstLineOf(errors_));
  const std::string ended = WIFSIGNALED(status) ? fmt::format("signal {}", WTERMSIG(status))
                                                : fmt::format("status {}", WEXITSTATUS(status));
  throw Error("{}: ffmpeg ended with {} before the movie was complete: {}", unfinished_.target().string(),
              ended, message.empty() ? "it printed no message" : message);
}

void MovieWriter::append(const Image& image) {
  CURVISPLAT_CHECK_OP(image.size.width, ==, size_.width);
  CURVISPLAT_CHECK_OP(image.size.height, ==, size_.height);
  for (size_t n = 0; n < size_.pixels(); ++n)
    for (size_t c = 0; c < 3; ++c) pixels_[3 * n + c] = toByte(image.rgba[4 * n + c]);
  for (size_t sent = 0; sent < pixels_.size();) {
    const ssize_t count = os::sendQuietly(input_, pixels_.data() + sent, pixels_.size() - sent);
    if (count < 0 && errno == EINTR) continue;
    if (count < 0) fail(wait());
    sent += static_cast<size_t>(count);
  }
}

void MovieWriter::finish() {
  if (const int status = wait(); status != 0) fail(status);
  unfinished_.putIntoPlace();
}

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

template <class Writer>
class Movie : public FrameOutput {
 public:
  Movie(const std::filesystem::path& path, ImageSize size, double frames_per_s)
      : writer_(path, size, frames_per_s) {}
  void write(uint64_t, const Image& image) override { writer_.append(image); }
  void finish() override { writer_.finish(); }

 private:
  Writer writer_;
};

[[noreturn]] void refusePattern(const std::string& pattern, std::string_view why) {
  throw UsageError("-o {}: {}; use a name such as frame_%04d.png, or a movie: .mp4, .gif or .html", pattern,
                   why);
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
  if (extensionOf(path) == ".mp4" && (size.width % 2 != 0 || size.height % 2 != 0))
    throw UsageError("--size {}x{}: the width and height of an .mp4 must be even", size.width, size.height);
}

std::unique_ptr<FrameOutput> makeFrameOutput(const std::filesystem::path& path, bool frames, ImageSize size,
                                             double frames_per_s) {
  if (isPageName(path)) return std::make_unique<Movie<PicturePage>>(path, size, frames_per_s);
  if (isMovieName(path)) return std::make_unique<Movie<MovieWriter>>(path, size, frames_per_s);
  if (frames) return std::make_unique<NumberedFiles>(path);
  return std::make_unique<SingleFile>(path);
}

}  // namespace curvisplat
