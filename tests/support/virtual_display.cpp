#include "tests/support/virtual_display.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <stdexcept>
#include <thread>

#include "tests/support/run_program.h"
#include "tests/support/temporary_folder.h"

namespace curvisplat {
namespace {

namespace fs = std::filesystem;

/// The screen as Xvfb keeps it, in an XWD file that it has mapped: a header of 32-bit words, most significant byte first, a colour
/// table, rows of pixels. A pointer would be among them.
class ScreenFile {
 public:
  explicit ScreenFile(const fs::path& path) : file_(path, std::ios::binary) {
    file_.exceptions(std::ios::failbit | std::ios::badbit);
    unsigned char header[4 * kHeaderWords];
    file_.read(reinterpret_cast<char*>(header), sizeof header);
    const auto word = [&](size_t n) {
      uint32_t value = 0;
      for (size_t byte = 4 * n; byte < 4 * n + 4; ++byte) value = value << 8 | header[byte];
      return value;
    };
    size_ = {static_cast<int>(word(4)), static_cast<int>(word(5))};
    stride_ = word(12);
    pixel_bytes_ = word(11) / 8;
    begin_ = word(0) + 12 * word(19);
    if (pixel_bytes_ < 3) throw std::runtime_error("the screenshot has a colour table");
  }

  ImageSize size() const { return size_; }
  size_t pixelBytes() const { return pixel_bytes_; }
  /// The first `count` pixels of a row from x on: blue, green, red, and perhaps a byte that says nothing, of each.
  void read(int x, int y, int count, std::vector<unsigned char>& pixels) {
    pixels.resize(pixel_bytes_ * static_cast<size_t>(count));
    file_.seekg(static_cast<std::streamoff>(begin_ + static_cast<size_t>(y) * stride_ +
                                            static_cast<size_t>(x) * pixel_bytes_));
    file_.read(reinterpret_cast<char*>(pixels.data()), static_cast<std::streamsize>(pixels.size()));
  }

 private:
  static constexpr size_t kHeaderWords = 25;

  std::ifstream file_;
  ImageSize size_;
  size_t stride_ = 0, pixel_bytes_ = 0, begin_ = 0;
};

void runXdotool(const std::vector<std::string>& words) {
  const ProgramResult result = RunningProgram(words, "xdotool").wait();
  if (result.status != 0) throw std::runtime_error("xdotool: " + result.err);
}

}  // namespace

bool eventually(const std::function<bool()>& holds, double seconds) {
  const auto end = std::chrono::steady_clock::now() + std::chrono::duration<double>(seconds);
  while (std::chrono::steady_clock::now() < end) {
    if (holds()) return true;
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  return holds();
}

std::string VirtualDisplay::missing() {
  for (const char* program : {"Xvfb", "xdotool"})
    if (pathOf(program).empty()) return program;
  return {};
}

/// A running Xvfb, which its destructor ends.
class VirtualDisplay::Server {
 public:
  Server(ImageSize size, const std::vector<std::string>& options) : size_(size), options_(options) {
    const std::string sockets = "/tmp/.X11-unix/X";
    int number = 100 + getpid() % 20000;
    while (fs::exists(sockets + std::to_string(number))) ++number;
    name_ = fmt::format(":{}", number);
    const std::string screen = fmt::format("{}x{}x24", size.width, size.height);
    std::vector<std::string> words{name_,          "-screen",   "0",        screen,      "-fbdir",
                                   folder_.path(), "-nocursor", "-noreset", "-nolisten", "tcp"};
    words.insert(words.end(), options.begin(), options.end());
    process_ = std::make_unique<RunningProgram>(words, "Xvfb");
    const auto listens = [&] { return fs::exists(sockets + std::to_string(number)); };
    if (!eventually(listens)) throw std::runtime_error("Xvfb does not start");
    setenv("DISPLAY", name_.c_str(), 1);
    // Its socket is there a little before it listens.
    const auto answers = [] { return RunningProgram({"getmouselocation"}, "xdotool").wait().status == 0; };
    if (!eventually(answers)) throw std::runtime_error("Xvfb does not answer");
  }
  ~Server() {
    process_->signal(SIGTERM);  // it takes its socket away
    process_->wait();
  }
  Server(const Server&) = delete;
  Server& operator=(const Server&) = delete;

  bool is(ImageSize size, const std::vector<std::string>& options) const {
    return size.width == size_.width && size.height == size_.height && options == options_;
  }
  /// Waits until nothing is seen of programs that have ended, and leaves no key and no button pressed.
  void beAsNew() const {
    setenv("DISPLAY", name_.c_str(), 1);
    if (!eventually([this] { return isBlack(); }))
      throw std::runtime_error("a window is left on the display");
    runXdotool(
        {"keyup", "ctrl", "keyup", "shift", "keyup", "alt", "mouseup", "1", "mouseup", "2", "mouseup", "3"});
  }
  ScreenFile screen() const { return ScreenFile(folder_ / "Xvfb_screen0"); }

 private:
  bool isBlack() const {
    ScreenFile file = screen();
    std::vector<unsigned char> row;
    for (int y = 0; y < file.size().height; ++y) {
      file.read(0, y, file.size().width, row);
      for (size_t n = 0; n < row.size(); ++n)
        if (n % file.pixelBytes() < 3 && row[n] != 0) return false;
    }
    return true;
  }

  const TemporaryFolder folder_;  // of the file that holds the screen's pixels
  const ImageSize size_;
  const std::vector<std::string> options_;
  std::string name_;  // ":1234"
  std::unique_ptr<RunningProgram> process_;
};

std::unique_ptr<VirtualDisplay::Server>& VirtualDisplay::idleServer() {
  static std::unique_ptr<Server> idle;
  return idle;
}

VirtualDisplay::VirtualDisplay(ImageSize size, const std::vector<std::string>& options)
    : server_(std::move(idleServer())) {
  if (server_ && server_->is(size, options)) {
    server_->beAsNew();
  } else {
    server_.reset();
    server_ = std::make_unique<Server>(size, options);
  }
}

VirtualDisplay::~VirtualDisplay() {
  unsetenv("DISPLAY");
  idleServer() = std::move(server_);
}

void VirtualDisplay::act(const std::vector<std::string>& words) const {
  runXdotool(words);
}

Image VirtualDisplay::screenshot() const {
  ScreenFile file = server_->screen();
  Image image(file.size());
  std::vector<unsigned char> row;
  for (int y = 0; y < image.size.height; ++y) {
    file.read(0, y, image.size.width, row);
    for (int x = 0; x < image.size.width; ++x) {
      const unsigned char* const blue = &row[file.pixelBytes() * static_cast<size_t>(x)];
      for (size_t c = 0; c < 3; ++c) image.pixel(x, y)[2 - c] = static_cast<float>(blue[c]) / 255;
      image.pixel(x, y)[3] = 1;
    }
  }
  return image;
}

float VirtualDisplay::brightness(int x, int y) const {
  ScreenFile file = server_->screen();
  std::vector<unsigned char> pixel;
  file.read(x, y, 1, pixel);
  return static_cast<float>(pixel[0] + pixel[1] + pixel[2]) / 255;
}

}  // namespace curvisplat
