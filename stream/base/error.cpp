#include "stream/base/error.h"

#include <atomic>
#include <cstddef>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <string>
#include <string_view>

namespace curvisplat {
namespace {

/// The length of the UTF-8 sequence that `text` begins with; 1 if it begins with none.
size_t sequenceAt(std::string_view text) {
  const auto byte = [&](size_t n) { return static_cast<unsigned char>(text[n]); };
  const size_t length = byte(0) < 0xc2 || byte(0) > 0xf4 ? 1 : byte(0) < 0xe0 ? 2 : byte(0) < 0xf0 ? 3 : 4;
  if (length > text.size()) return 1;
  for (size_t n = 1; n < length; ++n)
    if (byte(n) < 0x80 || byte(n) > 0xbf) return 1;
  return length;
}

/// Whether a UTF-8 sequence is a control character: U+0000 to U+001F, or U+007F to U+009F. A byte that is
/// not UTF-8 is read as Latin-1.
bool isControl(std::string_view sequence) {
  const auto byte = [&](size_t n) { return static_cast<unsigned char>(sequence[n]); };
  if (sequence.size() == 1) return byte(0) < ' ' || (byte(0) >= 0x7f && byte(0) < 0xa0);
  return byte(0) == 0xc2 && byte(1) < 0xa0;
}

std::atomic<bool> muted = false;

}  // namespace

std::string oneLine(const std::string& text) {
  std::string shown;
  shown.reserve(text.size());
  for (std::string_view rest = text; !rest.empty();) {
    const std::string_view sequence = rest.substr(0, sequenceAt(rest));
    if (isControl(sequence))
      shown += ' ';
    else
      shown += sequence;
    rest.remove_prefix(sequence.size());
  }
  return shown;
}

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

void checkFailed(const char* file, int line, const char* expression, const std::string& values) {
  printMessage("internal error at {}:{}: check failed: {}{}{}", file, line, expression,
               values.empty() ? "" : ": ", values);
  std::abort();
}

}  // namespace curvisplat
