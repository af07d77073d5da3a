#include "tools/view/frame_loop.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "render/frame/frame.h"
#include "render/surface/curve_times.h"
#include "stream/base/progress.h"
#include "stream/base/threads.h"

namespace curvisplat {
namespace {

constexpr uint64_t kRefinement = 4;  // ratio of the splats of successive pictures

/// Number of splats of the root bricks.
uint64_t coarsestSplats(const CacheReader& cache) {
  uint64_t splats = 0;
  for (const Brick& brick : cache.bricks())
    if (brick.parent == kNoBrick) splats += brick.splats;
  return splats;
}

}  // namespace

std::vector<uint8_t> bytesOf(const Image& image) {
  std::vector<uint8_t> bytes(image.rgba.size());
  std::transform(image.rgba.begin(), image.rgba.end(), bytes.begin(), [](float channel) {
    return static_cast<uint8_t>(std::clamp(channel, 0.0f, 1.0f) * 255 + 0.5f);
  });
  return bytes;
}

// Adapts the effort. A picture that was too slow reduces splats as long as that helps, then the resolution;
// one that was fast raises them in reverse order.
void Effort::learn(double seconds, double target, bool complete) {
  has_learned_ = true;
  const double factor = std::clamp(target / std::max(seconds, 1e-6), 0.25, 2.0);
  const bool splats_help = !complete && splats_ > min_;
  if (factor < 1 && !splats_help)
    reduction_ = std::min(kMaxReduction, reduction_ / std::sqrt(factor));
  else if (factor > 1 && reduction_ > 1)
    reduction_ = std::max(1.0, reduction_ / std::sqrt(factor));
  else if (factor < 1 || !complete)
    splats_ =
        std::clamp(static_cast<uint64_t>(static_cast<double>(splats_) * factor), min_, std::max(min_, kMax));
}

std::vector<GridSurface> facesWithLooks(std::vector<GridSurface> faces,
                                        const std::vector<GridSurface>& looks) {
  for (size_t n = 0; n < faces.size(); ++n) faces[n].takeLookOf(looks.at(n));
  return faces;
}

/// State that the loop's thread keeps between requests.
struct FrameLoop::Drawing {
  explicit Drawing(uint64_t coarsest) : effort(coarsest) {}

  std::unique_ptr<StepPlayer> player;  // of one variable
  std::vector<size_t> variables;
  uint64_t function_version = 0;
  std::optional<FrameRequest> last;  // that was drawn
  bool keeps_going = false;          // past damaged bricks, since one was met
  Effort effort;

  struct Faces {
    uint64_t step = 0;
    FaceNames names;
    std::vector<GridSurface> found;
  };
  Faces faces;  // of the last step

  void takeFaces(const CacheReader& cache, FrameRequest& request);
};

/// The request's faces at its step, and its curves at its time. The same ones as for the last request, where they can be: their meshes
/// are kept.
void FrameLoop::Drawing::takeFaces(const CacheReader& cache, FrameRequest& request) {
  const auto& scene = request.options.scene;
  request.options.scene = sceneAtTime(scene, cache.series().timeAt({request.step, request.part}));
  if (!request.faces_at || !scene || scene->grid_surfaces.empty()) return;
  const bool change_with_steps =
      cache.series().geometries() > 1 || !request.faces.by.empty() || !request.faces.opacity_by.empty();
  const bool same_step = faces.step == request.step || !change_with_steps;
  if (!same_step || faces.found.empty() || faces.names != request.faces) {
    faces = {};  // if it throws
    try {
      const auto found = cache.step() == request.step
                             ? request.faces_at(cache, request.faces)
                             : request.faces_at(cache.atStep(request.step), request.faces);
      faces = {request.step, request.faces, found};
    } catch (const Interrupted&) {
      throw;
    } catch (const Error& error) {
      throw UsageError("{}", error.what());  // another step may have them
    }
  }
  auto found = std::make_shared<SurfaceScene>(*scene);
  found->grid_surfaces = facesWithLooks(faces.found, scene->grid_surfaces);
  request.options.scene = std::move(found);
}

FrameLoop::FrameLoop(const CacheReader& cache, Backend backend, std::function<void()> wake,
                     std::shared_future<void> after, GlSharing* window)
    : cache_(cache.atStep(cache.step())),
      backend_(backend),
      wake_(std::move(wake)),
      after_(std::move(after)),
      window_(window),
      thread_([this] { loop(); }) {}

FrameLoop::~FrameLoop() {
  {
    const MutexLock lock(mutex_);
    state_ = State::kStopping;
    drawing_.request_stop();
  }
  changed_.notify_all();
  thread_.join();
}

uint64_t FrameLoop::request(FrameRequest request) {
  const MutexLock lock(mutex_);
  pending_ = std::move(request);
  values_wanted_ = false;
  values_.reset();
  if (isStoppedByRequests()) drawing_.request_stop();
  changed_.notify_all();
  return ++newest_;
}

std::optional<ShownFrame> FrameLoop::poll() {
  const MutexLock lock(mutex_);
  if (failure_)
    std::rethrow_exception(state_ == State::kFailed ? failure_ : std::exchange(failure_, nullptr));
  in_use_ = shown_.has_value();
  return std::exchange(shown_, std::nullopt);
}

void FrameLoop::requestValues() {
  const MutexLock lock(mutex_);
  values_wanted_ = true;
  changed_.notify_all();
}

void FrameLoop::giveBack() {
  const MutexLock lock(mutex_);
  in_use_ = false;
  changed_.notify_all();
}

std::optional<ShownValues> FrameLoop::takeValues() {
  const MutexLock lock(mutex_);
  return std::exchange(values_, std::nullopt);
}

bool FrameLoop::busy() const {
  const MutexLock lock(mutex_);
  return state_ != State::kFailed && (pending_ || state_ == State::kMoving || state_ == State::kRefining);
}

std::string FrameLoop::backendName() const {
  const MutexLock lock(mutex_);
  return backend_name_;
}

bool FrameLoop::superseded(uint64_t number) const {
  const MutexLock lock(mutex_);
  return state_ == State::kStopping || number != newest_;
}

void FrameLoop::publish(ShownFrame frame) {
  {
    const MutexLock lock(mutex_);
    shown_ = std::move(frame);
  }
  wake_();
}

void FrameLoop::waitForUse() {
  MutexLock lock(mutex_);
  while ((shown_ || in_use_) && state_ != State::kStopping) changed_.wait(lock);
}

void FrameLoop::loop() {
  nameThisThread("frames");
  if (after_.valid()) after_.wait();
  Drawing drawing(coarsestSplats(cache_));
  MutexLock lock(mutex_);
  while (true) {
    while (!pending_ && state_ != State::kStopping && !(values_wanted_ && drawing.last)) changed_.wait(lock);
    if (state_ == State::kStopping) return;
    const bool draws = pending_.has_value();
    FrameRequest request = draws ? *std::exchange(pending_, std::nullopt) : *drawing.last;
    if (!draws) values_wanted_ = false;
    const uint64_t number = newest_;
    drawing_ = std::stop_source();
    request.options.stop = drawing_.get_token();
    state_ = !draws ? State::kValues : request.moving ? State::kMoving : State::kRefining;
    lock.unlock();
    std::exception_ptr failure;
    bool ends = false;
    try {
      serveDamaged(drawing, request, [&] {
        if (draws)
          serve(drawing, request, number);
        else
          findValues(drawing, request, number);
      });
    } catch (const Interrupted&) {
    } catch (const UsageError&) {
      failure = std::current_exception();
    } catch (...) {
      failure = std::current_exception();
      ends = true;
    }
    lock.lock();
    if (failure) failure_ = failure;
    if (state_ != State::kStopping) state_ = ends ? State::kFailed : State::kIdle;
    lock.unlock();
    wake_();
    if (ends) return;
    lock.lock();
  }
}

/// Draws coarser bricks in place of damaged ones, once one was found. Not from the beginning: then nothing is
/// left out because it is hidden (FrameWorkers::prepare()).
void FrameLoop::serveDamaged(Drawing& drawing, FrameRequest& request, const std::function<void()>& serve) {
  request.options.keep_going |= drawing.keeps_going;
  try {
    return serve();
  } catch (const DamagedBrick&) {
    if (request.options.keep_going) throw;
  }
  request.options.keep_going = drawing.keeps_going = true;
  drawing.player.reset();  // its frame was not completed
  serve();
}

void FrameLoop::serve(Drawing& drawing, FrameRequest request, uint64_t number) {
  preparePlayer(drawing, request);
  drawing.takeFaces(cache_, request);
  FrameRenderer& renderer = drawing.player->renderer();
  {
    const MutexLock lock(mutex_);
    backend_name_ = renderer.backendName();
  }

  Effort& effort = drawing.effort;
  double detail_px = request.moving ? effort.detailPixels() : 0;
  for (uint64_t splats = request.only_final ? CutOptions::kNoLimit : effort.splats();;
       splats *= kRefinement) {
    ShownFrame frame;
    frame.request = number;
    frame.step = request.step;
    frame.camera = request.camera;
    frame.options = request.options;
    frame.view = renderer.screenView(request.camera, request.options);
    frame.data = {cache_.manifest().lower, cache_.manifest().upper};
    frame.image = renderer.renderQuickly(request.camera, request.options,
                                         {.max_splats = splats, .detail_px = detail_px}, frame.statistics,
                                         frame.is_final, request.may_stay_on_card ? &frame.on_card : nullptr);
    const std::vector<BrickFailure>& damaged = frame.statistics.bricks_unreadable;
    if (!damaged.empty() && frame.statistics.splats_drawn == 0 && !request.options.scene) {
      if (frame.is_final) throw DamagedBrick(damaged.front().reason);
      if (superseded(number)) return;
      detail_px = 0;  // the picture is final in the end
      continue;       // finer bricks may be intact
    }
    if (request.wants_bytes && !frame.on_card) frame.bytes = bytesOf(frame.image);
    // A view's first picture, at rest, teaches too: else the first movement of the mouse would wait for one
    // that takes too long.
    if (request.moving || !effort.hasLearned()) {
      // Drawing fewer splats than the limit does not mean that the view is complete: the next level may
      // exceed it.
      const bool complete = frame.is_final || frame.statistics.largest_error_px <= request.options.lod_pixels;
      effort.learn(frame.statistics.total_s, request.target_s, complete);
    }
    const bool is_final = frame.is_final;
    publish(std::move(frame));
    if (request.next) readAhead(drawing, request);
    if (request.one_at_a_time) waitForUse();
    if (is_final || request.moving || superseded(number)) return;
  }
}

/// Prepares the player of the request's scalars and functions, at its time.
void FrameLoop::preparePlayer(Drawing& drawing, const FrameRequest& request) {
  const DrawnScalars& scalars = request.scalars;
  std::vector<size_t> variables{scalars.opacity.variable};
  if (scalars.colour) variables.push_back(scalars.colour->variable);
  const bool same_function = drawing.function_version == request.function_version;
  // In a picture of two scalars the renderer can change neither the colours nor which of the functions
  // changed.
  if (!drawing.player || drawing.variables != variables || (scalars.colour && !same_function)) {
    drawing.player.reset();  // frees its memory before the next one allocates
    if (request.step != cache_.step()) cache_ = cache_.atStep(request.step);
    drawing.player = std::make_unique<StepPlayer>(cache_, scalars, backend_, window_);
    drawing.variables = variables;
  } else if (!same_function) {
    drawing.player->setTransferFunction(scalars.opacity.function);
  }
  drawing.function_version = request.function_version;
  drawing.last = request;
  drawing.player->goTo({request.step, request.part});
}

/// The place under the mouse need not be known to the pixel, and the values there are read from the data: a
/// quarter of the pixels take a quarter of the time.
void FrameLoop::findValues(Drawing& drawing, FrameRequest request, uint64_t number) {
  preparePlayer(drawing, request);
  drawing.takeFaces(cache_, request);
  ShownValues found;
  found.request = number;
  found.step = request.step;
  found.camera = request.camera;
  ImageSize& size = request.options.size;
  size = {std::max(1, size.width / 2), std::max(1, size.height / 2)};
  found.options = request.options;
  FrameStatistics ignored;
  drawing.player->renderer().renderWithValues(request.camera, request.options, ignored, found.values);
  {
    const MutexLock lock(mutex_);
    if (number == newest_) values_ = std::move(found);
  }
  wake_();
}

/// Goes to the step that is likely to be wanted next, and begins to decode it while this one is looked at.
void FrameLoop::readAhead(Drawing& drawing, const FrameRequest& request) {
  drawing.player->goTo(*request.next);
  const double detail_px = request.moving ? drawing.effort.detailPixels() : 0;
  drawing.player->renderer().prefetch(request.camera, request.options,
                                      {.max_splats = drawing.effort.splats(), .detail_px = detail_px});
}

}  // namespace curvisplat
