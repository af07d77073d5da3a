// Checks what comes in from browsers: who may talk to the server (the token, Host and Origin), what a page
// says (ClientMessage), and how often it may say something (MessageRate).
//
// The token keeps other users of the machine out. Host and Origin keep other pages in the same browser out:
// a page of another site may send requests here, also under a name of its own that it makes resolve to this
// machine.
//
// A page sends JSON texts, one message each, with a "type". Messages are checked here as far as that can be
// done without a cache: ServedCaches checks its number, viewStateFromJson() the state of a view against its manifest.
//
//   {"type": "open", "cache": 0,                 asks for a cache's facts and its first view
//    "size": [800, 600]}
//   {"type": "view", "number": 7, "cache": 0,    asks for a picture; `state` is ViewState's JSON, `next` the
//    "size": [800, 600], "moving": true,         step that is wanted after this one; "saves": true draws markers, too
//    "step": 0, "next": 1, "state": {...}}
//   {"type": "choose", "cache": 0,               asks for the automatic function of a scalar on a dark or
//    "scalar": "density", "dark": true,          a white background; "sheets": slices have its colours, too
//    "sheets": false}
//   {"type": "histogram", "cache": 0,            asks for a scalar's histogram
//    "scalar": "density", "low": 0, "high": 1,
//    "log": false, "asinh": [0.5, 0.1]}          along its range; in asinh: centre and width
//   {"type": "colours", "map": "viridis",        asks for a colour map's points; with `parts`, as ViewState's
//    "parts": {...}}                             JSON has those of a function: along its range
//   {"type": "isosurface", "cache": 0,           asks for the value at which an isosurface begins
//    "step": 0, "scalar": "density",
//    "state": {...}}
//   {"type": "pick", "x": 0.4, "y": 0.7}         asks what the picture at rest shows there; x and y are
//                                                fractions of its sides; "hovers": true asks for the value
//                                                under a mouse that rests, which may be nothing
//   {"type": "command", "cache": 0,              asks for the `render` command of a view
//    "size": [800, 600], "step": 0, "state": {...}}
//   {"type": "shown", "picture": 3}              the page has drawn this picture
//
// The functions keep no state: any thread may call them.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "render/colour/function_parts.h"
#include "render/image/image.h"

namespace curvisplat {

/// 128 random bits from the kernel, as 32 hexadecimal digits. Throws Error.
std::string newToken();
/// The token in the first line of a file that only its owner may read. Throws Error for any other file, and
/// for a token that is shorter than 16 characters, longer than 256, or has others than letters, digits, '-'
/// and '_'.
std::string readToken(const std::filesystem::path& path);

/// Compares two tokens in the same time, wherever they differ.
bool isSameToken(std::string_view given, std::string_view expected);

/// The parts of a request's target: "/socket?token=abc" is path "/socket" and token "abc".
struct RequestTarget {
  std::string_view path, token;  // the token is empty if there is none
};
RequestTarget targetOf(std::string_view target);

/// Whether a Host header names this machine: localhost, an address in digits (which no one can make resolve
/// to somewhere else), or one of `names`. Ports are not compared: tunnels have their own.
bool isKnownHost(std::string_view host, const std::vector<std::string>& names);

/// Whether an Origin header is that of our own page, which `host` has sent.
bool isOwnOrigin(std::string_view origin, std::string_view host);

/// Longest message, in bytes.
inline constexpr size_t kLongestMessage = 64 << 10;
/// Longest side of a picture, and the most pixels of one.
inline constexpr int kLargestSide = 4096;
inline constexpr uint64_t kMaxPixels = 8'300'000;  // 3840 x 2160

struct OpenRequest {
  size_t cache = 0;
  ImageSize size;
};
struct ViewRequest {
  uint64_t number = 0;
  size_t cache = 0;
  ImageSize size;
  bool moving = false;
  bool saves = false;  // the picture has the state's markers
  uint64_t step = 0;
  std::optional<uint64_t> next;
  std::string state;

  bool showsSameAs(const ViewRequest& other) const {
    return cache == other.cache && size == other.size && step == other.step && state == other.state &&
           saves == other.saves;
  }
};
struct FunctionRequest {
  size_t cache = 0;
  std::string scalar;
  bool dark = true;          // the background
  bool with_sheets = false;  // slices or faces have its colours
};
struct HistogramRequest {
  size_t cache = 0;
  std::string scalar;
  double low = 0, high = 1;  // low < high, and above 0 if `log`
  bool log = false;
  std::optional<AsinhScale> asinh = std::nullopt;  // not with `log`
};
struct ColoursRequest {
  std::string map;
  std::optional<FunctionParts> parts = std::nullopt;
};
struct IsosurfaceRequest {
  size_t cache = 0;
  uint64_t step = 0;
  std::string scalar;
  std::string state;
};
struct PickRequest {
  double x = 0, y = 0;  // 0..1, from the upper left corner
  bool hovers = false;  // nothing there is an answer, not an error
};
/// A view, as in ViewRequest.
struct CommandRequest {
  size_t cache = 0;
  ImageSize size;
  uint64_t step = 0;
  std::string state;
};
struct ShownReport {
  uint64_t picture = 0;
};

using ClientMessage =
    std::variant<OpenRequest, ViewRequest, FunctionRequest, HistogramRequest, ColoursRequest,
                 IsosurfaceRequest, PickRequest, CommandRequest, ShownReport>;

/// Parses and checks a message. Throws Error that begins with "message" for any other text.
ClientMessage parseClientMessage(std::string_view text);

/// Limits how many messages a page may send, by a token bucket. While its camera moves, a page sends two
/// messages in each frame of its screen, and screens have up to 240 frames a second. A value type.
class MessageRate {
 public:
  static constexpr double kPerSecond = 600, kAtOnce = 1200;

  /// A message came in at `now_s`. Returns whether the page may go on.
  bool admits(double now_s) {
    if (last_s_ >= 0) left_ = std::min(kAtOnce, left_ + (now_s - last_s_) * kPerSecond);
    last_s_ = now_s;
    left_ -= 1;
    return left_ >= 0;
  }

 private:
  double left_ = kAtOnce, last_s_ = -1;
};

}  // namespace curvisplat
