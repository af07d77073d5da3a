// Pictures for a window, made in the background: coarse ones at once, then finer ones until the asked detail
// is reached. The newest request is the one that counts.
//
//   window --request()--> [ frame loop's thread: FrameRenderer ] --picture, wake()--> window takes it
//
// While the camera moves a picture is as good as its time allows, and is never given up: the next one begins
// when it is shown. Once the camera rests, pictures take four times as long from one to the next, and are
// given up at the next request.
#pragma once

#include <algorithm>
#include <condition_variable>
#include <cstdint>
#include <exception>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "render/frame/frame.h"
#include "stream/cache/cache_reader.h"

namespace curvisplat {

struct FrameRequest {
  size_t variable = 0;
  uint64_t function_version = 0;  // differs where the function does
  TransferFunction function;
  Camera camera;
  FrameOptions options;
  bool moving = false;
  double target_s = 0.1;  // for a picture while moving
};

struct ShownFrame {
  Image image;
  std::vector<uint8_t> bytes;  // the image as a screen has it: four a pixel, clamped
  FrameStatistics statistics;
  uint64_t request = 0;   // what request() returned
  bool is_final = false;  // as render() draws it
};

/// How many splats a picture may have, and how coarse its pixels are, so that it takes a given time: learnt
/// from the pictures before.
class Effort {
 public:
  /// `least`: the splats of the coarsest picture there is.
  explicit Effort(uint64_t least) : least_(least), splats_(std::max(least, kFirst)) {}

  uint64_t splats() const { return splats_; }
  /// The finest detail that is to be shown, in pixels; 0: all.
  double detailPixels() const { return reduction_ > 1 ? 2 * reduction_ : 0; }
  /// A picture of this effort took `seconds` where `target` were wanted. `complete`: no more splats would
  /// have been drawn with leave to.
  void learn(double seconds, double target, bool complete);

 private:
  static constexpr uint64_t kFirst = 100'000;
  static constexpr uint64_t kMax = 1'000'000'000;
  static constexpr double kMaxReduction = 8;
  uint64_t least_, splats_;
  double reduction_ = 1;  // of the pixels, each way
};

/// Members may be called from one thread, the window's.
class FrameLoop {
 public:
  /// `wake` is called, from the loop's thread, whenever there is something to take. The cache outlives it.
  FrameLoop(const CacheReader& cache, Backend backend, std::function<void()> wake);
  /// Gives up what is under way.
  ~FrameLoop();
  FrameLoop(const FrameLoop&) = delete;
  FrameLoop& operator=(const FrameLoop&) = delete;

  /// Returns the request's number: 1, 2, ...
  uint64_t request(FrameRequest request);
  /// The newest picture since the last take(). Throws what ended the loop: an Error of reading or drawing; a
  /// UsageError (too little memory for this size) only ends the request.
  std::optional<ShownFrame> take();
  /// Whether pictures of the newest request are still to come.
  bool busy() const;
  /// What draws; empty until the first picture.
  std::string backendName() const;
  /// Whether the processor draws; so until the first picture.
  bool drawsInSoftware() const;

 private:
  struct Drawing;
  void loop();
  void serve(Drawing& drawing, const FrameRequest& request, uint64_t number);
  bool superseded(uint64_t number) const;
  void publish(ShownFrame frame);

  const CacheReader& cache_;
  const Backend backend_;
  const std::function<void()> wake_;

  mutable std::mutex mutex_;  // guards all below
  std::condition_variable changed_;
  std::optional<FrameRequest> waiting_;
  uint64_t newest_ = 0;               // number of the newest request
  bool serving_ = false;              // a request is under way
  bool may_give_up_ = false;          // and is no moving one
  FrameRenderer* drawing_ = nullptr;  // for cancel()
  std::optional<ShownFrame> shown_;
  std::exception_ptr failure_;
  bool ended_ = false;  // by a failure
  bool stopping_ = false;
  std::string backend_name_;
  bool software_ = true;
  std::thread thread_;
};

}  // namespace curvisplat
