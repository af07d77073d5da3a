#include "stream/base/message.h"

#include <atomic>
#include <cstdio>
#include <exception>
#include <string>

#include "stream/base/error.h"

namespace curvisplat {
namespace {

std::atomic<bool> muted = false;

}  // namespace

void muteMessages(bool mute) noexcept {
  muted = mute;
}

void printMessage(std::string_view text) noexcept {
  if (muted) return;
  try {
    const std::string line = "curvisplat: " + oneLine(std::string(text)) + "\n";
    std::fwrite(line.data(), 1, line.size(), stderr);  // in one call, so that threads' lines do not mix
  } catch (const std::exception&) {
    std::fputs("curvisplat: out of memory\n", stderr);
  }
}

}  // namespace curvisplat
