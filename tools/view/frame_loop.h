// Draws the pictures of a window on a thread of its own: first a coarse one, then finer ones until the
// requested error is reached. A new request replaces the one before.
//
//   window --request()--> [ frame loop's thread: FrameRenderer ] --picture, wake()--> window calls poll()
//
// While the camera moves, each picture is as fine as its time budget allows and is always completed; the
// next one begins when it is shown. At rest, each picture draws four times the splats of the previous one,
// and is stopped by the next request. Where a brick is damaged, coarser ones are drawn in its place from
// then on, and each picture's statistics list it (bricks_unreadable); a picture that would show nothing for
// that reason is an error.
//
//             a request whose camera moves
//   kIdle <------------------------------> kMoving     its one picture is completed
//     ^  \      a request at rest
//     |   \------------------------------> kRefining   until the picture is final; the next request stops it
//     |    \    requestValues()
//     |     \----------------------------> kValues     of the last picture; the next request stops it
//     |                                        |
//     '--------- done, or stopped -------------'
//
//   each of these --an error of reading or drawing--> kFailed     poll() throws it; nothing more is drawn
//   every state   --destructor----------------------> kStopping   the thread ends
#pragma once

#include <algorithm>
#include <cstdint>
#include <exception>
#include <functional>
#include <future>
#include <memory>
#include <optional>
#include <stop_token>
#include <string>
#include <thread>
#include <vector>

#include "render/frame/frame.h"
#include "stream/base/mutex.h"
#include "stream/cache/cache_reader.h"

namespace curvisplat {

/// Faces of a grid, by the names that users give.
struct FaceNames {
  struct Faces {
    std::string name;
    bool has_opacities = false;  // of the scalar `opacity_by`
    bool operator==(const Faces&) const = default;
  };
  std::vector<Faces> faces;
  std::string by, opacity_by;  // the scalars of colours and of opacities; empty: none
  bool operator==(const FaceNames&) const = default;
};

/// Finds these faces in the grid at the cache's step, in the order of FaceNames::faces; does not set colours
/// and factors of opacities. Called on the loop's thread; an Error ends the request only.
using FacesAtStep = std::function<std::vector<GridSurface>(const CacheReader&, const FaceNames&)>;

/// `faces` with the colours and opacities of `looks`, one for each.
std::vector<GridSurface> facesWithLooks(std::vector<GridSurface> faces,
                                        const std::vector<GridSurface>& looks);

/// A request for a picture.
struct FrameRequest {
  DrawnScalars scalars;
  uint64_t function_version = 0;  // changes whenever a function changes
  Camera camera;
  FrameOptions options;
  bool moving = false;
  double target_s = 0.033;                // time budget of a picture while moving
  uint64_t step = 0;                      // time step
  double part = 0;                        // of the way to the next step: for values; faces stay at `step`
  bool wants_bytes = true;                // ShownFrame::bytes; a picture of 1280 x 800 pixels takes 3 ms
  bool may_stay_on_card = false;          // ShownFrame::on_card instead of an image, if that can be
  bool only_final = false;                // no coarser pictures come before it
  bool one_at_a_time = false;             // nothing is drawn until a picture has been given back
  std::optional<StepPosition> next = {};  // is likely to be wanted next, with this camera: read ahead
  FaceNames faces = {};                   // of options.scene's grid surfaces, which have their look only
  FacesAtStep faces_at = {};              // needed where there are faces
};

/// A picture as 8-bit RGBA, clamped: ShownFrame::bytes.
std::vector<uint8_t> bytesOf(const Image& image);

/// A picture for the window.
struct ShownFrame {
  Image image;
  std::vector<uint8_t> bytes;  // the image as 8-bit RGBA, clamped; empty unless the request wants it
  std::shared_ptr<CardPicture>
      on_card;  // not null: image and bytes are empty; it may have fewer pixels (ReducedSize)
  FrameStatistics statistics;
  uint64_t request = 0;  // what request() returned
  uint64_t step = 0;
  bool is_final = false;  // the same picture as FrameRenderer::render() draws
  Camera camera;          // of the request
  FrameOptions options;
  ScreenView view;  // with the size of the options
  WorldBox data;    // where the step's data lie
};

/// The values under the pixels of a picture that is shown, for the mouse; with half as many pixels each way.
struct ShownValues {
  PixelValues values;
  uint64_t request = 0;  // of the picture
  uint64_t step = 0;
  Camera camera;
  FrameOptions options;  // with the size of `values`
};

/// Chooses the number of splats and the resolution of a picture so that it takes a given time. Learns from
/// the times of previous pictures.
class Effort {
 public:
  /// `min_splats`: the splats of the coarsest possible picture.
  explicit Effort(uint64_t min_splats) : min_(min_splats), splats_(std::max(min_splats, kFirst)) {}

  uint64_t splats() const { return splats_; }
  bool hasLearned() const { return has_learned_; }
  /// Size in pixels of the finest detail to draw; 0: full resolution.
  double detailPixels() const { return reduction_ > 1 ? 2 * reduction_ : 0; }
  /// Adapts to a picture that took `seconds` instead of `target`. `complete`: a higher splat limit would not
  /// have drawn more splats.
  void learn(double seconds, double target, bool complete);

 private:
  static constexpr uint64_t kFirst = 100'000;
  static constexpr uint64_t kMax = 1'000'000'000;
  static constexpr double kMaxReduction = 8;
  uint64_t min_, splats_;
  bool has_learned_ = false;
  double reduction_ = 1;  // of the resolution in each direction
};

/// Draws the newest request on a thread of its own. All members are for one other thread, such as the
/// window's.
class FrameLoop {
 public:
  /// Calls `wake` on the loop's thread whenever poll() has something to return. Opens the cache for itself,
  /// since it goes from step to step. If `after` is valid, nothing is drawn before it is ready: until then
  /// another loop holds the memory. `window`: as makeBackend(); outlives the loop.
  FrameLoop(const CacheReader& cache, Backend backend, std::function<void()> wake,
            std::shared_future<void> after = {}, GlSharing* window = nullptr);
  /// Stops the picture being drawn.
  ~FrameLoop();
  FrameLoop(const FrameLoop&) = delete;
  FrameLoop& operator=(const FrameLoop&) = delete;

  /// Returns the request's number: 1, 2, ...
  uint64_t request(FrameRequest request);
  /// The newest picture since the last poll(), or nullopt. Throws the error of reading or drawing that ended
  /// the loop, or UsageError (too little memory for this size, no faces at this step), which ends only the
  /// request.
  std::optional<ShownFrame> poll();
  /// Says that the memory of the last picture from poll() is free, for requests that are one_at_a_time. No
  /// effect otherwise.
  void giveBack();
  /// Asks for the values of the newest request's picture, once that is shown. The next request() cancels
  /// this.
  void requestValues();
  /// The values that requestValues() asked for, once.
  std::optional<ShownValues> takeValues();
  /// Whether more pictures of the newest request will follow.
  bool busy() const;
  /// Name of the drawing back end; empty until the first picture.
  std::string backendName() const;

 private:
  enum class State { kIdle, kMoving, kRefining, kValues, kFailed, kStopping };  // the diagram above
  struct Drawing;

  void loop();
  void serveDamaged(Drawing& drawing, FrameRequest& request, const std::function<void()>& serve);
  void serve(Drawing& drawing, FrameRequest request, uint64_t number);
  void preparePlayer(Drawing& drawing, const FrameRequest& request);
  void readAhead(Drawing& drawing, const FrameRequest& request);
  void findValues(Drawing& drawing, FrameRequest request, uint64_t number);
  bool superseded(uint64_t number) const;
  /// Whether the next request stops what is being done.
  bool isStoppedByRequests() const REQUIRES(mutex_) {
    return state_ == State::kRefining || state_ == State::kValues;
  }
  void publish(ShownFrame frame);
  void waitForUse();

  CacheReader cache_;  // at the step that is drawn; of the loop's thread
  const Backend backend_;
  const std::function<void()> wake_;
  const std::shared_future<void> after_;
  GlSharing* const window_;

  mutable Mutex mutex_;
  ConditionVariable changed_;
  State state_ GUARDED_BY(mutex_) = State::kIdle;
  std::optional<FrameRequest> pending_ GUARDED_BY(mutex_);
  uint64_t newest_ GUARDED_BY(mutex_) = 0;  // number of the newest request
  std::stop_source drawing_ GUARDED_BY(mutex_);
  std::optional<ShownFrame> shown_ GUARDED_BY(mutex_);
  bool in_use_ GUARDED_BY(mutex_) = false;  // the last picture from poll(), until giveBack()
  bool values_wanted_ GUARDED_BY(mutex_) = false;
  std::optional<ShownValues> values_ GUARDED_BY(mutex_);
  std::exception_ptr failure_ GUARDED_BY(mutex_);  // of the loop in kFailed, else of the last request
  std::string backend_name_ GUARDED_BY(mutex_);
  std::thread thread_;
};

}  // namespace curvisplat
