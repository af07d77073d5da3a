#include "tests/support/virtual_display.h"

#include <fmt/format.h>
#include <unistd.h>

#include <chrono>
#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <stdexcept>
#include <thread>

namespace curvisplat {
namespace {

namespace fs = std::filesystem;

constexpr const char* kEnv = "/usr/bin/env";  // which looks for programs on the path

uint32_t bigEndian(const std::string& bytes, size_t word) {
  uint32_t value = 0;
  for (size_t n = 0; n < 4; ++n) value = value << 8 | static_cast<unsigned char>(bytes.at(4 * word + n));
  return value;
}

}  // namespace

bool eventually(const std::function<bool()>& holds, double seconds) {
  const auto end = std::chrono::steady_clock::now() + std::chrono::duration<double>(seconds);
  while (std::chrono::steady_clock::now() < end) {
    if (holds()) return true;
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  }
  return holds();
}

std::string VirtualDisplay::missing() {
  for (const char* program : {"Xvfb", "xdotool"}) {
    RunningProgram which({"sh", "-c", std::string("command -v ") + program}, kEnv);
    if (which.wait().status != 0) return program;
  }
  return {};
}

VirtualDisplay::VirtualDisplay(ImageSize size, const std::vector<std::string>& options) {
  int number = 100 + getpid() % 20000;
  while (fs::exists("/tmp/.X11-unix/X" + std::to_string(number))) ++number;
  name_ = fmt::format(":{}", number);
  const std::string screen = fmt::format("{}x{}x24", size.width, size.height);
  std::vector<std::string> words{"Xvfb",         name_,       "-screen",  "0",         screen, "-fbdir",
                                 folder_.path(), "-nocursor", "-noreset", "-nolisten", "tcp"};
  words.insert(words.end(), options.begin(), options.end());
  server_ = std::make_unique<RunningProgram>(words, kEnv);
  setenv("DISPLAY", name_.c_str(), 1);
  const auto answers = [] {
    return RunningProgram({"xdotool", "getmouselocation"}, kEnv).wait().status == 0;
  };
  if (!eventually(answers)) throw std::runtime_error("Xvfb does not start");
}

VirtualDisplay::~VirtualDisplay() {
  unsetenv("DISPLAY");
  server_->signal(SIGTERM);  // it takes its socket away
  server_->wait();
}

void VirtualDisplay::act(const std::vector<std::string>& words) const {
  std::vector<std::string> arguments{"xdotool"};
  arguments.insert(arguments.end(), words.begin(), words.end());
  const ProgramResult result = RunningProgram(arguments, kEnv).wait();
  if (result.status != 0) throw std::runtime_error("xdotool: " + result.err);
}

// Xvfb keeps what it shows in an XWD file that it has mapped: a header of 32-bit words, most significant byte first, a colour table,
// rows of pixels. A pointer would be among them.
Image VirtualDisplay::screenshot() const {
  const std::string bytes = bytesOfFile(folder_ / "Xvfb_screen0");
  const uint32_t header = bigEndian(bytes, 0), stride = bigEndian(bytes, 12);
  const uint32_t colours = bigEndian(bytes, 19);
  Image image({static_cast<int>(bigEndian(bytes, 4)), static_cast<int>(bigEndian(bytes, 5))});
  const size_t pixel_bytes = bigEndian(bytes, 11) / 8;
  if (pixel_bytes < 3) throw std::runtime_error("the screenshot has a colour table");
  for (int y = 0; y < image.size.height; ++y)
    for (int x = 0; x < image.size.width; ++x) {
      const size_t at =
          header + 12 * colours + static_cast<size_t>(y) * stride + pixel_bytes * static_cast<size_t>(x);
      for (size_t c = 0; c < 3; ++c)  // blue, green, red
        image.pixel(x, y)[2 - c] = static_cast<float>(static_cast<unsigned char>(bytes.at(at + c))) / 255;
      image.pixel(x, y)[3] = 1;
    }
  return image;
}

}  // namespace curvisplat
