#include "tools/commands/render_run.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <iterator>
#include <set>
#include <string>
#include <vector>

#include "render/image/image.h"
#include "render/image/image_file.h"
#include "stream/base/compute_permits.h"
#include "stream/base/error.h"
#include "stream/base/file.h"
#include "tools/options/frame_arguments.h"
#include "tools/options/frame_sequence.h"
#include "tools/options/opacity_arguments.h"
#include "tools/options/option_parsers.h"
#include "tools/options/picture_choice.h"
#include "tools/options/scene_arguments.h"
#include "tools/output/empty_picture.h"
#include "tools/output/frame_output.h"
#include "tools/output/launched_ranks.h"
#include "tools/output/results.h"
#include "tools/output/start_checks.h"

namespace curvisplat {

ValueChannels channelsOf(const RenderArguments& arguments) {
  // A first picture has none, so they have to be asked for.
  if (!arguments.channels && !arguments.first_image.empty()) return {};
  return valueChannels(arguments.channels, arguments.output);
}

bool severalFrames(const RenderArguments& arguments) {
  return arguments.camera.moves() || arguments.steps.severalSteps();
}

namespace {

void checkPartArguments(const RenderArguments& arguments) {
  if (!arguments.part) return;
  parsePart(*arguments.part);
  if (!severalFrames(arguments))
    throw UsageError(
        "--part {}: shares out several frames, but there is only one; give --orbit, --path or --steps",
        *arguments.part);
  if (isMovieName(arguments.output))
    throw UsageError(
        "--part {}: a part of a movie cannot be joined with others; write numbered pictures, -o "
        "frame_%04d.png, and join them with ffmpeg",
        *arguments.part);
  if (!arguments.first_image.empty())
    throw UsageError("--part {}: cannot be combined with --first-image, which is of frame 0 alone",
                     *arguments.part);
}

}  // namespace

std::vector<std::filesystem::path> inputsOf(const RenderArguments& arguments) {
  std::vector<std::filesystem::path> inputs = arguments.solutions;
  inputs.insert(inputs.end(),
                {arguments.cache, arguments.camera.path, arguments.scalar.transfer_function.value_or("")});
  const CurveArguments& curves = arguments.surfaces.curves;
  inputs.insert(inputs.end(), curves.lines.begin(), curves.lines.end());
  inputs.insert(inputs.end(), curves.points.begin(), curves.points.end());
  if (arguments.surfaces.map.isImage()) inputs.emplace_back(*arguments.surfaces.map.map);
  std::copy_if(arguments.surfaces.surfaces.begin(), arguments.surfaces.surfaces.end(),
               std::back_inserter(inputs), isSurfaceFile);
  return inputs;
}

void checkRenderArguments(const RenderArguments& arguments, ImageSize size) {
  checkMotionArguments(arguments.camera, arguments.steps);
  checkFunctionArguments(arguments.scalar);
  checkOpacityArguments(arguments.opacity, arguments.scalar);
  checkSurfaceArguments(arguments.surfaces, !arguments.opacity.by.scalar.empty());
  checkAnnotationArguments(arguments.annotations);
  checkOutputName(arguments.output, severalFrames(arguments), size);
  checkPartArguments(arguments);
  if (!arguments.first_image.empty() && !launchedRanks().alone())
    throw UsageError("--first-image {}: one process draws it; start curvisplat without mpirun",
                     arguments.first_image.string());
  if (arguments.frame_rate && !isMovieName(arguments.output))
    throw UsageError("--frame-rate needs a movie: -o NAME.mp4, NAME.gif or NAME.html");
  if (arguments.frame.background == "transparent" && arguments.output.extension() != ".png" &&
      arguments.output.extension() != ".exr")
    throw UsageError("--background transparent: {} files have no transparency; use .png or .exr",
                     arguments.output.extension().string());
  parseBackend(arguments.backend);
  if (channelsOf(arguments).any() && !arguments.first_image.empty())
    throw UsageError("--first-image {}: a first picture has no channels of values; leave out --channels",
                     arguments.first_image.string());
  std::vector<std::filesystem::path> others = inputsOf(arguments);
  checkOutputFile("-o", arguments.output, others);
  if (severalFrames(arguments) && !isMovieName(arguments.output)) {
    const FrameNames names(arguments.output);
    checkOutputFolder("-o", names.of(std::max<uint64_t>(arguments.camera.frames.value_or(1), 1) - 1));
    const uint64_t most = arguments.steps.severalSteps() ? kMaxFrames : arguments.camera.frameCount();
    const auto check_other = [&](const char* option, const std::filesystem::path& other) {
      if (names.include(linkTarget(other), most))
        throw Error("{} {}: a frame of -o would overwrite it; choose another name", option, other.string());
    };
    check_other("--first-image", arguments.first_image);
    check_other("--stats", arguments.statistics);
  }
  others.push_back(arguments.output);
  if (!arguments.first_image.empty()) {
    checkImageName(arguments.first_image);
    checkOutputFile("--first-image", arguments.first_image, others);
    others.push_back(arguments.first_image);
  }
  if (!arguments.statistics.empty()) checkJsonOutput("--stats", arguments.statistics, others);
}

void takeFilm(RenderArguments& arguments) {
  const CameraArguments& camera = arguments.camera;
  if (camera.path.empty()) return;
  const auto film = std::make_shared<const Film>(Film::fromFile(camera.path));
  const Film::Stated& has = film->stated();
  const auto refuse = [&](bool stated, bool given, const char* what, const std::string& options) {
    if (stated && given)
      throw UsageError("--path {}: its key frames have {}; leave out {}", camera.path.string(), what,
                       options);
  };
  ScalarArguments& scalar = arguments.scalar;
  const std::string& name = film->scalar();
  refuse(!name.empty(), !scalar.scalar.empty() && scalar.scalar != name, "another scalar", "--scalar");
  if (!name.empty()) scalar.scalar = name;
  ScalarArguments of_function = scalar;
  if (!arguments.opacity.by.scalar.empty()) {  // the film has the colours, options the opacities
    of_function.opacity.reset();
    of_function.opacity_unit.reset();
  }
  const std::string given = givenFunctionOptions(of_function);
  refuse(has.functions, !given.empty(), "functions", given);
  refuse(has.clip_boxes, arguments.frame.clip_box.has_value(), "clip boxes", "--clip-box");
  refuse(has.clip_planes, !arguments.frame.clip_planes.empty(), "clip planes", "--clip-plane");
  refuse(has.slices, !arguments.surfaces.slices.empty(), "slices", "--slice");
  scalar.film = film->looks().front().function;
  arguments.surfaces.film_has_slices = has.slices;
  checkSurfaceArguments(arguments.surfaces, !arguments.opacity.by.scalar.empty());
  arguments.camera.film = film;
}

void requireSameCache(const CacheReader& cache, Ranks& ranks) {
  if (ranks.alone()) return;
  const std::string own = cache.seriesManifest().toJson();
  const auto sent = fromBytes<char>(ranks.broadcast(toBytes(std::vector<char>(own.begin(), own.end()))));
  if (!std::equal(own.begin(), own.end(), sent.begin(), sent.end()))
    throw Error("{}: is another cache here than at rank 0, or another version of it; give all ranks the same",
                cache.path().string());
}

namespace {

/// See drawFrames().
class FrameRun {
 public:
  FrameRun(const FrameJob& job, Progress& progress)
      : arguments_(job.arguments),
        manifest_(job.manifest),
        player_(job.player),
        output_(job.output),
        report_(job.report),
        step_changed_(job.step_changed),
        show_(job.show),
        box_(job.box),
        progress_(progress),
        ranks_(launchedRanks()),
        channels_(channelsOf(job.arguments)) {}

  void draw(const MotionInTime& motion, const std::vector<uint64_t>& numbers) {
    const bool moves = severalFrames(arguments_);
    const bool dealt = areFramesDealt();
    const std::vector<uint64_t> own = dealt ? ownOf(numbers) : numbers;
    const size_t rounds = dealt ? (numbers.size() + ranks_.count() - 1) / ranks_.count() : numbers.size();
    if (moves) progress_.begin("drawing", own.size(), "frames");
    for (size_t n = 0; n < rounds; ++n) {
      picture_ = Image();
      if (n < own.size()) drawNext(motion, own, n);
      if (dealt && isMovieName(arguments_.output)) writeRound(numbers, n);
    }
    if (dealt) gatherReports(motion);
    if (output_) output_->finish();
    progress_.end();
  }

 private:
  std::vector<uint64_t> ownOf(const std::vector<uint64_t>& numbers) const {
    std::vector<uint64_t> own;
    for (size_t n = ranks_.rank(); n < numbers.size(); n += ranks_.count()) own.push_back(numbers[n]);
    return own;
  }

  /// Whether each rank draws pictures of its own.
  bool areFramesDealt() const { return !ranks_.alone() && report_.options.ranks->alone(); }

  /// The pictures that the ranks have drawn, into the movie at rank 0.
  void writeRound(const std::vector<uint64_t>& numbers, size_t round) {
    for (unsigned rank = 0; rank < ranks_.count(); ++rank) {
      const size_t at = round * ranks_.count() + rank;
      if (at >= numbers.size()) return;
      const bool own = rank == ranks_.rank();
      std::vector<Ranks::Bytes> sent = ranks_.gather(own ? toBytes(picture_.rgba) : Ranks::Bytes{});
      if (!ranks_.isFirst()) continue;
      Image picture;
      picture.size = report_.picture;
      picture.rgba = fromBytes<float>(sent[rank]);
      output_->write(numbers[at], picture);
    }
  }

  void gatherReports(const MotionInTime& motion) {
    const std::vector<Ranks::Bytes> sent = ranks_.gather(packStatistics(report_.frames));
    if (!ranks_.isFirst()) return;
    report_.frames.clear();
    for (const Ranks::Bytes& bytes : sent)
      for (FrameReport& frame : unpackStatistics(bytes)) {
        frame.camera = motion.camera(frame.number);
        report_.frames.push_back(std::move(frame));
      }
    std::sort(report_.frames.begin(), report_.frames.end(),
              [](const FrameReport& a, const FrameReport& b) { return a.number < b.number; });
  }

  void drawNext(const MotionInTime& motion, const std::vector<uint64_t>& numbers, size_t n) {
    const bool moves = severalFrames(arguments_);
    const uint64_t number = numbers[n];
    const uint64_t* const next = n + 1 < numbers.size() ? &numbers[n + 1] : nullptr;
    Progress of_frame;
    of_frame.stopWith(progress_);
    try {
      draw(number, next, motion, moves ? of_frame : progress_);
    } catch (const Interrupted&) {
      throw;
    } catch (const UsageError& error) {
      if (moves) throw UsageError("frame {}: {}", number, error.what());
      throw;
    } catch (const Error& error) {
      if (moves) throw Error("frame {}: {}", number, error.what());
      throw;
    }
    if (moves) progress_.advance(1);
  }

  void goTo(const StepPosition& position) {
    player_.goTo(position);
    if (position_ == position) return;
    step_changed_();
    position_ = position;
  }

  void draw(uint64_t number, const uint64_t* next, const MotionInTime& motion, Progress& progress) {
    goTo(motion.position(number));
    show_(number);
    drawn_step_ = position_->step;
    const double time = player_.time();
    const Camera camera = motion.camera(number);
    FrameStatistics statistics;
    if (channels_.any()) {
      Image image =
          player_.renderer().renderWithValues(camera, report_.options, statistics, values_, &progress);
      finish({number, time, camera, statistics}, std::move(image));
      return;
    }
    if (number > 0 || arguments_.first_image.empty()) {
      Image image = player_.renderer().render(camera, report_.options, statistics, &progress);
      if (next && report_.options.ranks->alone()) prefetch(motion, *next);
      finish({number, time, camera, statistics}, std::move(image));
      return;
    }
    const auto show = [&](const Image& image, bool is_final) {
      if (!report_.first_image) {
        annotate(image, {number, time, camera, statistics},
                 [&](const Image& picture) { writeImage(picture, arguments_.first_image); });
        report_.time_to_first_image_s = secondsSinceStart();
        report_.first_image = statistics;
      }
      if (is_final) finish({number, time, camera, statistics}, image);
    };
    player_.renderer().renderProgressively(camera, report_.options, statistics, show, &progress);
  }

  /// Reads the next frame's bricks, and goes to its time step, while this frame's picture is written.
  void prefetch(const MotionInTime& motion, uint64_t number) {
    goTo(motion.position(number));
    try {
      player_.renderer().prefetch(motion.camera(number), report_.options);
    } catch (const Error&) {
      // That frame will report its own invalid camera.
    }
  }

  void finish(FrameReport frame, Image image) {
    if (!report_.options.ranks->alone()) {
      for (const Ranks::Bytes& bytes : ranks_.gather(packStatistics({frame})))
        frame.of_ranks.push_back(unpackStatistics(bytes).front().statistics);
      if (!ranks_.isFirst()) return;
      frame.statistics = combined(frame.of_ranks);
    }
    // Bricks of the next picture are prepared meanwhile.
    const Computing computing(player_.renderer().permits(), Urgency::kUrgent);
    const uint64_t number = frame.number;
    const FrameStatistics& statistics = frame.statistics;
    const RenderedScene scene{manifest_,    report_.variable, report_.function(),
                              frame.camera, report_.options,  statistics};
    // Before the picture gives its memory to the annotated one.
    const bool empty = isEmpty(image, report_.options.background);
    std::string poor;
    if (report_.frames.empty() && !empty)
      poor = poorPictureWarning(image, scene, givenFunctionOptions(arguments_.scalar));
    annotate(std::move(image), frame, [&](const Image& picture) {
      if (isMovieName(arguments_.output) && areFramesDealt())
        picture_ = picture;  // for rank 0
      else if (channels_.any())
        output_->writeWith(number, picture, imageChannels(channels_, values_, report_.picture));
      else
        output_->write(number, picture);
    });
    if (report_.frames.empty() && !report_.first_image) report_.time_to_first_image_s = secondsSinceStart();
    report_.frames.push_back(frame);
    const std::string which = severalFrames(arguments_) ? fmt::format(" of frame {}", number) : "";
    reportUnreadable(which, statistics);
    if (!poor.empty()) {
      progress_.end();
      printMessage("warning: {}", poor);
    }
    if (reported_empty_ || !empty) return;
    reported_empty_ = true;
    progress_.end();
    for (const std::string& reason : whyEmpty(scene))
      printMessage("warning: the picture{} is empty: {}", which, reason);
  }

  /// Calls write() with the picture, annotated if annotations were requested.
  template <typename Write>
  void annotate(Image data, const FrameReport& frame, const Write& write) const {
    const AnnotationArguments& annotations = arguments_.annotations;
    if (annotations.shown == Annotations{}) return write(data);
    AnnotatedScene scene{report_.picture,        player_.renderer().screenView(frame.camera, report_.options),
                         report_.shown,          manifest_.lower,
                         manifest_.upper,        report_.background,
                         axisTitles(annotations)};
    annotations.put(box_, scene);
    const VariableInfo& shown = report_.colour_variable ? *report_.colour_variable : report_.variable;
    annotations.fill({frame.time, drawn_step_, frame.number, shown.name, shown.unit}, scene);
    write(annotated(std::move(data), annotations.shown, scene));
  }

  /// Prints one warning for a frame with unreadable bricks that no earlier frame reported; it names the
  /// first.
  void reportUnreadable(const std::string& which, const FrameStatistics& statistics) {
    const BrickFailure* first = nullptr;
    for (const BrickFailure& failure : statistics.bricks_unreadable)
      if (reported_unreadable_.insert(failure.brick).second && !first) first = &failure;
    if (!first) return;
    progress_.end();
    // Isosurfaces in cells read all leaves, also those that the picture does not need.
    const size_t unreadable = statistics.bricks_unreadable.size();
    printMessage("warning: {} of {} bricks{} cannot be read; they are drawn coarser or left out: {}",
                 unreadable, std::max<uint64_t>(statistics.bricks_drawn, unreadable), which, first->reason);
  }

  const RenderArguments& arguments_;
  const Manifest& manifest_;
  StepPlayer& player_;
  FrameOutput* output_;  // null at ranks that write nothing
  RenderReport& report_;
  const std::function<void()> step_changed_;
  const std::function<void(uint64_t)> show_;
  const std::optional<AnnotatedScene::OnGlobe> box_;
  std::optional<StepPosition> position_;  // that the player is at
  uint64_t drawn_step_ = 0;               // of the frame, while the player goes to the next
  Progress& progress_;
  Ranks& ranks_;
  const ValueChannels channels_;
  PixelValues values_;  // of the frame
  Image picture_;       // of a movie's round
  bool reported_empty_ = false;
  std::set<uint32_t> reported_unreadable_;  // bricks
};

}  // namespace

void drawFrames(const FrameJob& job, const MotionInTime& motion, const std::vector<uint64_t>& numbers,
                Progress& progress) {
  FrameRun(job, progress).draw(motion, numbers);
}

}  // namespace curvisplat
