// What a page sends: JSON texts, one message each, with a "type". What they say is checked here as far as that can be done
// without a cache; the state of a view is checked against the cache's manifest by viewStateFromJson().
//
//   {"type": "open", "cache": 0, "size": [800, 600]}                   asks for a cache's facts and its first view
//   {"type": "view", "number": 7, "cache": 0, "size": [800, 600],      asks for a picture; `state` as ViewState's JSON,
//    "moving": true, "step": 0, "next": 1, "state": {...}}             `next` is the step that is wanted after this one
//   {"type": "choose", "cache": 0, "scalar": "density"}                asks for the automatic function of a scalar
//   {"type": "histogram", "cache": 0, "scalar": "density", "low": 0, "high": 1, "log": false}
//   {"type": "colours", "map": "viridis"}                              asks for a colour map's points
//   {"type": "pick", "x": 0.4, "y": 0.7}                               asks what is seen there in the picture at rest; shares of its sides
//   {"type": "shown", "picture": 3}                                    the page has drawn this picture
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <variant>

#include "render/image/image_size.h"

namespace curvisplat {

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
  uint64_t step = 0;
  std::optional<uint64_t> next;
  std::string state;
};
struct FunctionRequest {
  size_t cache = 0;
  std::string scalar;
};
struct HistogramRequest {
  size_t cache = 0;
  std::string scalar;
  double low = 0, high = 1;  // low < high, and above 0 if `log`
  bool log = false;
};
struct ColoursRequest {
  std::string map;
};
struct PickRequest {
  double x = 0, y = 0;  // 0..1, from the upper left corner
};
struct ShownReport {
  uint64_t picture = 0;
};

using ClientMessage = std::variant<OpenRequest, ViewRequest, FunctionRequest, HistogramRequest,
                                   ColoursRequest, PickRequest, ShownReport>;

/// `caches`: how many are served. Throws Error that begins with "message" for anything else.
ClientMessage parseClientMessage(std::string_view text, size_t caches);

}  // namespace curvisplat
