#include "tools/output/movie_writer.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <spawn.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <csignal>
#include <cstring>
#include <system_error>
#include <utility>

#include "render/image/image_formats.h"
#include "stream/base/check.h"
#include "stream/base/error.h"
#include "stream/base/file.h"
#include "stream/base/paths.h"

extern char** environ;

namespace curvisplat {
namespace {

[[noreturn]] void failToStart(const std::filesystem::path& movie, int error) {
  if (error == ENOENT)
    throw Error(
        "{}: movies are made by ffmpeg, which is not installed (not in PATH); install it, or write pictures, "
        "-o frame_%04d.png",
        movie.string());
  throw Error("{}: ffmpeg cannot be started: {}", movie.string(), std::strerror(error));
}

pid_t start(std::vector<std::string> words, int input, int errors, const std::filesystem::path& movie) {
  std::vector<char*> arguments;
  for (std::string& word : words) arguments.push_back(word.data());
  arguments.push_back(nullptr);
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_adddup2(&actions, input, STDIN_FILENO);
  posix_spawn_file_actions_adddup2(&actions, errors, STDOUT_FILENO);
  posix_spawn_file_actions_adddup2(&actions, errors, STDERR_FILENO);
  pid_t process = -1;
  const int error = posix_spawnp(&process, "ffmpeg", &actions, nullptr, arguments.data(), environ);
  posix_spawn_file_actions_destroy(&actions);
  if (error != 0) failToStart(movie, error);
  return process;
}

/// Its first line.
std::string textOf(int file) {
  std::array<char, 300> buffer;
  const ssize_t got = pread(file, buffer.data(), buffer.size(), 0);
  const std::string text(buffer.data(), got > 0 ? static_cast<size_t>(got) : 0);
  return text.substr(0, text.find('\n'));
}

}  // namespace

MovieWriter::MovieWriter(const std::filesystem::path& path, ImageSize size, double frames_per_s)
    : path_(writableTarget(path)),
      unfinished_(temporaryBeside(path_)),
      size_(size),
      pixels_(3 * size.pixels()) {
  // A pair of sockets instead of a pipe: sending to a process that has ended is an error, not a signal.
  int ends[2] = {-1, -1};
  errors_ = memfd_create("ffmpeg", MFD_CLOEXEC);
  if (errors_ < 0 || socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends) != 0) {
    const int error = errno;
    if (errors_ >= 0) close(errors_);
    failToStart(path, error);
  }
  input_ = ends[0];
  try {
    // A relative name could begin with a dash, or look like a protocol.
    const std::string output = std::filesystem::absolute(unfinished_).string();
    process_ = start({"ffmpeg",
                      "-nostdin",
                      "-loglevel",
                      "error",
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
                      "pipe:0",
                      "-c:v",
                      "libx264",
                      "-crf",
                      "18",
                      "-pix_fmt",
                      "yuv420p",
                      "-movflags",
                      "+faststart",
                      "-f",
                      "mp4",
                      "file:" + output},
                     ends[1], errors_, path);
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
  removeAll(unfinished_);
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
  const std::string said = textOf(errors_);
  const std::string ended = WIFSIGNALED(status) ? fmt::format("signal {}", WTERMSIG(status))
                                                : fmt::format("status {}", WEXITSTATUS(status));
  throw Error("{}: ffmpeg ended with {} before the movie was whole: {}", path_.string(), ended,
              said.empty() ? "it said nothing" : said);
}

void MovieWriter::append(const Image& image) {
  CURVISPLAT_CHECK_OP(image.size.width, ==, size_.width);
  CURVISPLAT_CHECK_OP(image.size.height, ==, size_.height);
  for (size_t n = 0; n < size_.pixels(); ++n)
    for (size_t c = 0; c < 3; ++c) pixels_[3 * n + c] = toByte(image.rgba[4 * n + c]);
  for (size_t sent = 0; sent < pixels_.size();) {
    const ssize_t count = send(input_, pixels_.data() + sent, pixels_.size() - sent, MSG_NOSIGNAL);
    if (count < 0 && errno == EINTR) continue;
    if (count < 0) fail(wait());
    sent += static_cast<size_t>(count);
  }
}

void MovieWriter::finish() {
  if (const int status = wait(); status != 0) fail(status);
  putFileIntoPlace(unfinished_, path_);
}

}  // namespace curvisplat
