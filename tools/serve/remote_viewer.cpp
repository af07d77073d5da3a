#include "tools/serve/remote_viewer.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <deque>
#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>

#include "render/annotate/annotations.h"
#include "render/frame/frame_memory.h"
#include "render/frame/frame_plan.h"
#include "stream/base/error.h"
#include "stream/base/text.h"
#include "stream/base/threads.h"
#include "tools/serve/picture_message.h"
#include "tools/view/frame_loop.h"
#include "tools/view/picture_layout.h"

namespace curvisplat {
namespace {

constexpr size_t kMaxReports =
    16;  // that wait to be read; a page sends as many as there are pictures on their way
constexpr size_t kMaxAsked = 64;

double secondsNow() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

/// A request that the frame loop has, as far as its pictures need it.
struct Asked {
  uint64_t request = 0;  // the frame loop's number
  ViewRequest view;
  ViewState state;
  int reduction = 1;  // of the resolution in each direction
  ImageSize picture, data;
};

/// The memory that pictures take beside the frame that is drawn.
struct PictureMemory {
  bool one_at_a_time;  // while one is encoded, no other is drawn
  uint64_t bytes;
};

constexpr int kCoarsest = 8;        // reduction
constexpr uint64_t kLineShare = 4;  // of the longest message: as long as less is on its way, more is sent

/// The memory of a viewer that has `memory_bytes`.
PictureMemory memoryFor(ImageSize picture, const Annotations& annotations, uint64_t memory_bytes) {
  const uint64_t image = 4 * sizeof(float) * picture.pixels(), message = messageBytes(picture);
  // One after the other: an image of fewer pixels that is enlarged; the whole picture beside its data, at most twice as
  // large; a message, and a copy. And the messages on their way.
  const uint64_t making = annotations == Annotations{} ? std::max(image / 2, 2 * message)
                                                       : std::max(image, image / 2 + 2 * message);
  const uint64_t bytes = making + message / kLineShare + message;
  // One image more is encoded, and one waits for that.
  const bool has_room = bytes + 2 * image <= memory_bytes / 4;
  return {!has_room, has_room ? bytes + 2 * image : bytes};
}

}  // namespace

/// The part of a viewer that belongs to its thread.
class RemoteViewer::Work {
 public:
  Work(RemoteViewer& viewer, const ServedCaches& caches)
      : viewer_(viewer), caches_(caches), limits_(viewer.limits_) {}

  /// Answers what has come in.
  void serve(Inbox inbox) {
    for (const uint64_t picture : inbox.shown) line_.shown(picture, secondsNow());
    if (inbox.open) answer([&] { return caches_.cacheText(*inbox.open); });
    if (inbox.view) wanted_ = std::move(inbox.view);
    woken_ |= inbox.woken;
    advance();
    if (inbox.pick && frames_ && !asked_.empty() && !(inbox.pick->hovers && picked_ && !picked_->hovers)) {
      picked_ = inbox.pick;
      if (!values_) frames_->requestValues();
    }
    if (picked_ && frames_) answer([&] { return pickedText(); });
    // These may take some tenths of a second: behind the picture.
    if (inbox.function) answer([&] { return caches_.functionText(*inbox.function); });
    if (inbox.histogram) answer([&] { return caches_.histogramText(*inbox.histogram); });
    if (inbox.colours) answer([&] { return ServedCaches::coloursText(*inbox.colours); });
    if (inbox.isosurface) answer([&] { return caches_.isosurfaceText(*inbox.isosurface); });
    if (inbox.command) answer([&] { return commandText(*inbox.command); });
  }

 private:
  void advance() {
    if (wanted_ && (lineIsOpen() || !wanted_->moving)) ask(*std::exchange(wanted_, std::nullopt));
    if (woken_ && lineIsOpen()) {
      woken_ = false;
      show();
    }
  }

  bool lineIsOpen() const {
    return line_.isOpen(asked_.empty() ? UINT64_MAX : messageBytes(asked_.back().picture) / kLineShare);
  }

  /// The sample that is seen at the picked place, once the values of the picture are there. Empty until then.
  std::string pickedText() {
    if (auto values = frames_->takeValues()) values_ = std::move(values);
    if (!values_) return {};
    const Asked& asked = asked_.back();
    if (values_->request != asked.request) {  // of a picture before: the click waits for those of the newest
      values_.reset();
      frames_->requestValues();
      return {};
    }
    const PickRequest pick = *std::exchange(picked_, std::nullopt);
    const CacheReader& reader = caches_.reader(cache_);
    const glm::dvec2 pixel(pick.x * asked.picture.width, pick.y * asked.picture.height);
    const auto point = pointSeenAt(*values_, reader.manifest(), pixel, asked.data);
    return caches_.markerText(cache_, {asked.state.variable, values_->step, pick.hovers, pick.x, pick.y},
                              point);
  }

  /// Turns any error into one of the page: the state that it sent is wrong.
  std::string commandText(const CommandRequest& request) const try {
    return caches_.commandText(request);
  } catch (const Error& error) {
    throw UsageError("{}", error.what());
  }

  template <typename Text>
  void answer(const Text& text) {
    try {
      if (std::string message = text(); !message.empty()) viewer_.send_(std::move(message), true);
    } catch (const Error& error) {
      report(error);
    }
  }

  void report(const Error& error) {
    // What a page has asked wrongly is its own affair; what the disk or a file has is the server's, too.
    if (!dynamic_cast<const UsageError*>(&error)) printMessage("warning: a viewer: {}", error.what());
    viewer_.send_(caches_.errorText(error.what()), true);
  }

  void ask(const ViewRequest& view) {
    try {
      const CacheReader& reader = caches_.reader(view.cache);
      if (view.step >= reader.series().steps.size())
        throw UsageError("there is no step {}; the last one is {}", view.step,
                         reader.series().steps.size() - 1);
      ViewState state = viewStateFromJson(view.state, "view", reader.manifest());
      state.surfaces.clear();  // they name files
      state.memory_bytes = limits_.memory_bytes;
      if (view.saves) state.annotations = savedAnnotations(state);
      request(view, std::move(state));
    } catch (const UsageError& error) {
      report(error);
    } catch (const Error& error) {
      report(UsageError(error.what()));
    }
  }

  void request(const ViewRequest& view, ViewState state) {
    const CacheReader& reader = caches_.reader(view.cache);
    const ShownFunctions functions(state, reader.manifest());
    nlohmann::json parsed = nlohmann::json::parse(view.state);
    std::string text = parsed.at("preset").dump() + parsed.at("function").dump();
    if (state.opacity_by) text += parsed.at("opacity_by").dump();
    if (text != function_text_) {
      function_text_ = std::move(text);
      ++function_version_;
    }
    parsed.erase("camera");
    std::string look =
        fmt::format("{} {} {} {}", view.cache, view.size.width, view.size.height, parsed.dump());
    if (look != look_) reduction_ = 1;
    look_ = std::move(look);
    const ImageSize picture{std::max(1, view.size.width / reduction_),
                            std::max(1, view.size.height / reduction_)};
    const ImageSize data = dataSizeOf(state, reader.manifest(), picture);
    FrameRequest request{functions.scalars(reader, state), function_version_, state.camera,
                         state.frameOptions(data, reader.manifest())};
    screenViewOf(reader.manifest(), state.camera, request.options, data);  // refuses what cannot be drawn
    const PictureMemory memory = memoryFor(picture, state.annotations, limits_.memory_bytes);
    request.options.output_bytes = memory.bytes;
    request.faces = state.faceNames();
    request.faces_at = limits_.faces_at;
    request.one_at_a_time = memory.one_at_a_time;
    request.moving = view.moving;
    request.wants_bytes = false;
    request.target_s = limits_.target_s;
    request.step = view.step;
    if (view.next && *view.next < reader.series().steps.size()) request.next = StepPosition{*view.next};
    if (!frames_ || cache_ != view.cache) {
      frames_.reset();  // frees its memory before the next one allocates
      try {
        limits_.require_threads();
      } catch (const Error& error) {
        return report(error);
      }
      frames_ = std::make_unique<FrameLoop>(reader, limits_.backend, [this] { viewer_.wake(); });
      cache_ = view.cache;
      globe_grid_ = {};
      damaged_said_.clear();
      asked_.clear();
    }
    // A click waits for the same picture at rest, which a page asks for when the button is released; one into another is gone.
    if (asked_.empty() || !asked_.back().view.showsSameAs(view)) picked_.reset();
    values_.reset();
    const uint64_t number = frames_->request(std::move(request));
    if (picked_) frames_->requestValues();
    // A page that asks faster than pictures come does not make this grow.
    if (asked_.size() == kMaxAsked) asked_.pop_front();
    if (!view.moving) warnOfFiner(view, state);
    asked_.push_back({number, view, std::move(state), reduction_, picture, data});
  }

  /// Sends the warnings of a view at rest, unless the last ones are about the same.
  void warnOfFiner(const ViewRequest& view, const ViewState& state) {
    ServedCaches::AskedStep asked{view.cache, view.step, state.askedDifferences(caches_.reader(view.cache))};
    if (warned_of_ == asked) return;
    answer([&] { return caches_.finerText(view.number, asked); });
    warned_of_ = std::move(asked);
  }

  /// Draws the newest request's picture with fewer pixels.
  void reduce(const TooLittleMemory& error) {
    if (asked_.empty() || asked_.back().data != error.size)
      return;  // it was of a view that has been replaced
    const ViewRequest view = asked_.back().view;
    if (reduction_ == 1) least_bytes_ = error.least_bytes;
    if (reduction_ >= kCoarsest) return report(UsageError("{}", tooLittle(view.size)));
    reduction_ *= 2;
    ask(view);
  }

  std::string tooLittle(ImageSize size) const {
    return fmt::format("--viewer-memory {}: too little for {}x{} pixels of this cache{}",
                       byteText(limits_.memory_bytes), size.width, size.height,
                       least_bytes_ == 0 ? "" : fmt::format(", which need {} MiB", (least_bytes_ >> 20) + 1));
  }

  /// Sends the newest picture, if there is one.
  void show() {
    if (!frames_) return;
    std::optional<ShownFrame> frame;
    try {
      frame = frames_->poll();
    } catch (const TooLittleMemory& error) {
      return reduce(error);
    } catch (const UsageError& error) {
      report(error);
    } catch (const Error& error) {
      report(error);
      frames_.reset();  // it has ended; the next request begins anew
      return;
    } catch (const std::exception&) {
      frames_.reset();
      throw;
    }
    if (!frame) return;
    const GivesBack gives_back{*frames_};
    show(std::move(*frame));
  }

  /// Gives the last picture's memory back, whatever happens to it.
  struct GivesBack {
    FrameLoop& frames;
    ~GivesBack() { frames.giveBack(); }
  };

  void show(ShownFrame frame) {
    reportDamage(frame.step, frame.statistics.bricks_unreadable);
    while (!asked_.empty() && asked_.front().request < frame.request) asked_.pop_front();
    if (asked_.empty() || asked_.front().request != frame.request) return;
    send(asked_.front(), std::move(frame));
  }

  /// Reports damage if there is more of it than was said of this step.
  void reportDamage(uint64_t step, const std::vector<BrickFailure>& damaged) {
    if (damaged.empty()) return;
    size_t& said = damaged_said_[step];
    if (damaged.size() <= said) return;
    said = damaged.size();
    report(Error("{} bricks cannot be read; coarser data is drawn there, or none: {}", damaged.size(),
                 damaged.front().reason));
  }

  void send(const Asked& asked, ShownFrame frame) {
    sayIfReduced(asked, frame.is_final);
    const Manifest& manifest = caches_.reader(cache_).manifest();
    const ShownFunctions functions(asked.state, manifest);
    const AnnotatedScene scene = sceneOf(asked.state, functions, frame, asked.picture,
                                         globe_grid_.boxOf(asked.state, caches_.reader(cache_)));
    const Image picture = annotated(std::move(frame.image), asked.state.annotations, scene);
    PictureHeader header;
    header.picture = ++pictures_;
    header.request = static_cast<double>(asked.view.number);
    header.step = static_cast<uint32_t>(frame.step);
    header.size = asked.view.size;
    header.data_width = asked.data.width * asked.view.size.width / asked.picture.width;
    header.is_final = frame.is_final && !asked.view.moving;
    header.is_png = header.is_final;
    header.level = static_cast<uint8_t>(line_.level());
    header.seconds = static_cast<float>(frame.statistics.total_s);
    header.error_px = static_cast<float>(frame.statistics.largest_error_px);
    header.splats = static_cast<uint32_t>(frame.statistics.splats_drawn);
    std::string message =
        header.is_png ? losslessMessage(header, picture) : jpegMessage(header, picture, line_.quality());
    line_.sent(header.picture, secondsNow(), !header.is_png, message.size());
    viewer_.send_(std::move(message), false);
  }

  /// Reports that a picture has fewer pixels: of a view once, of each picture that is saved right before it.
  void sayIfReduced(const Asked& asked, bool is_final) {
    const std::pair said(asked.view.size, asked.reduction);
    if (asked.reduction == 1 || (asked.view.saves ? !is_final : reduction_said_ == said)) return;
    if (!asked.view.saves) reduction_said_ = said;
    const std::string text =
        fmt::format("{}; the picture has 1/{} of them each way", tooLittle(asked.view.size), asked.reduction);
    viewer_.send_(ServedCaches::refusalText(text, /*reduced=*/true), true);
  }

  RemoteViewer& viewer_;
  const ServedCaches& caches_;
  const ViewerLimits& limits_;
  std::optional<ViewRequest> wanted_;  // waits until the line is open
  std::optional<PickRequest> picked_;  // waits for the picture's values
  std::optional<ShownValues> values_;  // of the newest request, once they were asked for
  bool woken_ = false;
  size_t cache_ = 0;
  GlobeGrid globe_grid_;  // of that cache
  std::optional<ServedCaches::AskedStep> warned_of_;
  std::string function_text_;
  uint64_t function_version_ = 0;
  std::deque<Asked> asked_;
  std::string look_;          // all of the last request but its camera and step
  int reduction_ = 1;         // of the pictures of look_, as its memory allows
  uint64_t least_bytes_ = 0;  // that it would need for all pixels, if that is known
  std::pair<ImageSize, int> reduction_said_;
  LineQuality line_;
  uint32_t pictures_ = 0;
  std::map<uint64_t, size_t> damaged_said_;  // by step: bricks of the cache, of which the viewer was told
  std::unique_ptr<FrameLoop> frames_;        // the last: its thread calls wake()
};

RemoteViewer::RemoteViewer(ServedFolders& folders, const ViewerLimits& limits, Send send)
    : folders_(folders), limits_(limits), send_(std::move(send)), thread_([this] { loop(); }) {}

RemoteViewer::~RemoteViewer() {
  {
    const MutexLock lock(mutex_);
    stopping_ = true;
  }
  changed_.notify_all();
  thread_.join();
}

void RemoteViewer::receive(ClientMessage message) {
  {
    const MutexLock lock(mutex_);
    if (auto* const open = std::get_if<OpenRequest>(&message)) inbox_.open = *open;
    if (auto* const view = std::get_if<ViewRequest>(&message)) {
      inbox_.view = std::move(*view);
      inbox_.pick.reset();  // it was of another picture
    }
    if (auto* const function = std::get_if<FunctionRequest>(&message)) inbox_.function = std::move(*function);
    if (auto* const one = std::get_if<HistogramRequest>(&message)) inbox_.histogram = std::move(*one);
    if (auto* const colours = std::get_if<ColoursRequest>(&message)) inbox_.colours = std::move(*colours);
    if (auto* const iso = std::get_if<IsosurfaceRequest>(&message)) inbox_.isosurface = std::move(*iso);
    if (auto* const pick = std::get_if<PickRequest>(&message))
      if (!pick->hovers || !inbox_.pick || inbox_.pick->hovers) inbox_.pick = *pick;  // a click is not lost
    if (auto* const command = std::get_if<CommandRequest>(&message)) inbox_.command = std::move(*command);
    if (auto* const shown = std::get_if<ShownReport>(&message))
      if (inbox_.shown.size() < kMaxReports) inbox_.shown.push_back(shown->picture);
    news_ = true;
  }
  changed_.notify_all();
}

void RemoteViewer::wake() {
  {
    const MutexLock lock(mutex_);
    inbox_.woken = news_ = true;
  }
  changed_.notify_all();
}

void RemoteViewer::loop() {
  nameThisThread("viewer");
  try {
    const std::shared_ptr<const ServedCaches> caches = folders_.caches();
    send_(caches->helloText(), true);
    serve(*caches);
  } catch (const std::exception& error) {
    reportFailure(error);
  }
}

void RemoteViewer::serve(const ServedCaches& caches) {
  Work work(*this, caches);
  while (true) {
    Inbox inbox;
    {
      MutexLock lock(mutex_);
      while (!news_ && !stopping_) changed_.wait(lock);
      if (stopping_) return;
      news_ = false;
      inbox = std::exchange(inbox_, {});
    }
    try {
      work.serve(std::move(inbox));
    } catch (const std::exception& error) {  // such as a lack of memory: of this viewer alone
      reportFailure(error);
    }
  }
}

void RemoteViewer::reportFailure(const std::exception& error) noexcept {
  try {
    printMessage("warning: a viewer: {}", error.what());
    send_(ServedCaches::refusalText(
              "the server could not do this; the reason is in its messages (standard error)"),
          true);
  } catch (const std::exception&) {
    printMessage("warning: a viewer: too little memory");
  }
}

}  // namespace curvisplat
