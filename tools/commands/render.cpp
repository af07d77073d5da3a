// `curvisplat render`: a cache in, pictures out.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <glm/geometric.hpp>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>
#include <string>
#include <thread>

#include "render/annotate/annotations.h"
#include "render/colour/transfer_function.h"
#include "render/frame/frame.h"
#include "render/image/image.h"
#include "render/image/image_file.h"
#include "stream/base/error.h"
#include "stream/base/message.h"
#include "stream/base/paths.h"
#include "stream/base/progress.h"
#include "stream/cache/cache_reader.h"
#include "tools/commands/commands.h"
#include "tools/commands/empty_picture.h"
#include "tools/commands/render_statistics.h"
#include "tools/options/camera_motion.h"
#include "tools/options/option_parsers.h"
#include "tools/options/scalar_arguments.h"
#include "tools/output/frame_output.h"
#include "tools/output/output_paths.h"
#include "tools/output/progress_bar.h"
#include "tools/output/run_statistics.h"

namespace curvisplat {
namespace {

/// The command line's words, as given.
struct RenderWords {
  std::filesystem::path cache, output, first_image, statistics;
  CameraWords camera;
  ScalarArguments scalar;
  std::string size = "600x600", background = "white";
  std::string classify = "pixel", scale = "1,1,1", backend = "auto", memory = "512M";
  std::string lod_pixels = "1";
  std::optional<std::string> clip_box, frame_rate, max_splats;
  unsigned threads = 0;
  bool keep_going = false;
  Annotations annotations;
};

WorldBox parseClipBox(const std::string& text) {
  const auto n = parseNumbers("--clip-box", text, "x0,x1,y0,y1,z0,z1");
  const WorldBox box{{n[0], n[2], n[4]}, {n[1], n[3], n[5]}};
  for (int axis = 0; axis < 3; ++axis)
    if (box.lower[axis] > box.upper[axis])
      throw UsageError("--clip-box {}: {} is given from {} to {}, the larger first", text, "xyz"[axis],
                       box.lower[axis], box.upper[axis]);
  return box;
}

constexpr double kMinScale = 1e-6, kMaxScale = 1e6;

FrameOptions frameOptions(const RenderWords& words) {
  FrameOptions options;
  options.size = parseImageSize("--size", words.size);
  options.lod_pixels = parseNumber("--lod-pixels", words.lod_pixels);
  if (options.lod_pixels < 0)
    throw UsageError("--lod-pixels {}: expected 0 (the finest level) or more", words.lod_pixels);
  if (words.max_splats) options.max_splats = parseCount("--max-splats", *words.max_splats);
  if (words.classify != "pixel" && words.classify != "flat")
    throw UsageError("--classify {}: expected pixel or flat", words.classify);
  options.classification = words.classify == "pixel" ? Classification::kPixel : Classification::kFlat;
  options.scale = parsePoint("--scale", words.scale);
  for (int axis = 0; axis < 3; ++axis)
    if (!(options.scale[axis] >= kMinScale && options.scale[axis] <= kMaxScale))
      throw UsageError("--scale {}: expected three numbers between {:g} and {:g}", words.scale, kMinScale,
                       kMaxScale);
  if (words.clip_box) options.clip_box = parseClipBox(*words.clip_box);
  options.background = parseBackground("--background", words.background);
  options.threads = words.threads;
  options.memory_bytes = parseMemory("--memory", words.memory);
  options.keep_going = words.keep_going;
  return options;
}

/// What contradicts itself whatever the cache holds.
void checkWords(const RenderWords& words, ImageSize size) {
  checkCameraWords(words.camera);
  checkOutputName(words.output, words.camera.moves(), size);
  if (words.frame_rate && !isMovieName(words.output))
    throw UsageError("--frame-rate is for a movie, -o NAME.mp4");
  if (words.background == "transparent" && words.output.extension() != ".png" &&
      words.output.extension() != ".exr")
    throw UsageError("--background transparent: a {} has no transparency; write .png or .exr",
                     words.output.extension().string());
  parseBackend(words.backend);
  std::vector<std::filesystem::path> others{words.cache, words.camera.path, words.scalar.transfer_function};
  checkOutputFile("-o", words.output, others);
  if (words.camera.moves() && !isMovieName(words.output)) {
    const FrameNames names(words.output);
    const auto check_other = [&](const char* option, const std::filesystem::path& other) {
      if (names.include(linkTarget(other), words.camera.frames.value_or(1)))
        throw Error("{} {}: a frame of -o would change it; choose another name", option, other.string());
    };
    check_other("--first-image", words.first_image);
    check_other("--stats", words.statistics);
  }
  if (!words.first_image.empty()) {
    checkImageName(words.first_image);
    checkOutputFile("--first-image", words.first_image, others);
  }
  others.insert(others.end(), {words.output, words.first_image});
  if (!words.statistics.empty()) checkOutputFile("--stats", words.statistics, others);
}

void tell(const char* kind, const std::string& text) {
  printMessage("{}: {}", kind, text);
}

/// What a picture takes in memory on the way to its file.
uint64_t outputBytes(const RenderWords& words, ImageSize picture) {
  uint64_t bytes = 0;
  if (isMovieName(words.output))
    bytes = 3 * picture.pixels();
  else
    bytes = writingBytes(words.output, picture);
  if (!words.first_image.empty()) bytes = std::max(bytes, writingBytes(words.first_image, picture));
  if (!(words.annotations == Annotations{})) bytes += annotatedBytes(picture);
  return bytes;
}

/// One run: draws frame after frame and keeps what there is to report.
class FrameRun {
 public:
  FrameRun(const RenderWords& words, const Manifest& manifest, FrameRenderer& renderer, FrameOutput& output,
           RenderReport& report)
      : words_(words), manifest_(manifest), renderer_(renderer), output_(output), report_(report) {}

  /// Pictures that were written stay if a later frame fails.
  void draw(const CameraMotion& motion) {
    const bool moves = words_.camera.moves();
    if (moves) progress_.begin("drawing", motion.frames, "frames");
    for (uint64_t number = 0; number < motion.frames; ++number) {
      try {
        draw(number, motion, moves ? nullptr : &progress_);
      } catch (const UsageError& error) {
        if (moves) throw UsageError("frame {}: {}", number, error.what());
        throw;
      } catch (const Error& error) {
        if (moves) throw Error("frame {}: {}", number, error.what());
        throw;
      }
      if (moves) progress_.advance(1);
    }
    output_.finish();
    progress_.end();
  }

 private:
  void draw(uint64_t number, const CameraMotion& motion, Progress* progress) {
    const Camera camera = motion.camera(number);
    FrameStatistics statistics;
    if (number > 0 || words_.first_image.empty()) {
      const Image image = renderer_.render(camera, report_.options, statistics, progress);
      if (number + 1 < motion.frames) prefetch(motion, number + 1);
      finish(number, camera, image, statistics);
      return;
    }
    const auto show = [&](const Image& image, bool is_final) {
      if (!report_.first_image) {
        annotate(image, camera, [&](const Image& picture) { writeImage(picture, words_.first_image); });
        report_.time_to_first_image_s = secondsSinceStart();
        report_.first_image = statistics;
      }
      if (is_final) finish(number, camera, image, statistics);
    };
    renderer_.renderProgressively(camera, report_.options, statistics, show, progress);
  }

  /// A frame's bricks come in while the picture before it is written.
  void prefetch(const CameraMotion& motion, uint64_t number) {
    try {
      renderer_.prefetch(motion.camera(number), report_.options);
    } catch (const Error&) {
      // A camera that cannot be is told when it is that frame's turn.
    }
  }

  void finish(uint64_t number, const Camera& camera, const Image& image, const FrameStatistics& statistics) {
    annotate(image, camera, [&](const Image& picture) { output_.write(number, picture); });
    if (number == 0 && !report_.first_image) report_.time_to_first_image_s = secondsSinceStart();
    report_.frames.push_back({camera, statistics});
    const std::string which = words_.camera.moves() ? fmt::format(" of frame {}", number) : "";
    tellUnreadable(which, statistics);
    if (said_empty_ || !isEmpty(image, report_.options.background)) return;
    said_empty_ = true;
    progress_.end();
    const RenderedScene scene{manifest_, report_.variable, report_.transfer_function,
                              camera,    report_.options,  statistics};
    for (const std::string& reason : whyEmpty(scene))
      tell("warning", fmt::format("the picture{} is empty: {}", which, reason));
  }

  /// Calls write(the whole picture).
  template <typename Write>
  void annotate(const Image& data, const Camera& camera, const Write& write) const {
    if (words_.annotations == Annotations{}) return write(data);
    const FrameOptions& options = report_.options;
    write(annotated(data, words_.annotations,
                    {report_.picture, renderer_.screenView(camera, options), report_.transfer_function,
                     scalarTitle(report_.variable.name, report_.variable.unit), manifest_.lower,
                     manifest_.upper, options.background}));
  }

  /// A line for a frame with bricks that no frame before it had: the first of them.
  void tellUnreadable(const std::string& which, const FrameStatistics& statistics) {
    const BrickFailure* first = nullptr;
    for (const BrickFailure& failure : statistics.bricks_unreadable)
      if (said_unreadable_.insert(failure.brick).second && !first) first = &failure;
    if (!first) return;
    progress_.end();
    tell("warning",
         fmt::format("{} of {} bricks{} cannot be read, and are drawn coarser or left out: {}",
                     statistics.bricks_unreadable.size(), statistics.bricks_drawn, which, first->reason));
  }

  const RenderWords& words_;
  const Manifest& manifest_;
  FrameRenderer& renderer_;
  FrameOutput& output_;
  RenderReport& report_;
  Progress progress_{progressBar()};
  bool said_empty_ = false;
  std::set<uint32_t> said_unreadable_;  // bricks
};

void tellResult(const RenderReport& report) {
  const FrameStatistics& last = report.frames.back().statistics;
  if (report.frames.size() == 1) {
    fmt::print("{}: {} splats of {} in {} bricks, {:.2f} s, {}\n", report.output.string(), last.splats_drawn,
               report.variable.name, last.bricks_drawn, last.total_s, report.backend);
    return;
  }
  double total_s = 0;
  for (const FrameReport& frame : report.frames) total_s += frame.statistics.total_s;
  fmt::print("{}: {} frames of {}, {:.2f} s a frame, {}\n", report.output.string(), report.frames.size(),
             report.variable.name, total_s / static_cast<double>(report.frames.size()), report.backend);
}

void render(const RenderWords& words) {
  FrameOptions options = frameOptions(words);
  checkWords(words, options.size);
  if (options.threads == 0) options.threads = std::max(1u, std::thread::hardware_concurrency());
  const double frames_per_s = words.frame_rate ? parsePositive("--frame-rate", *words.frame_rate) : 25;

  const CacheReader cache(words.cache);
  const Manifest& manifest = cache.manifest();
  const size_t variable = chooseVariable(cache, words.scalar);
  const VariableInfo& info = manifest.variables[variable];
  const glm::dvec3 lower = manifest.lower * options.scale, upper = manifest.upper * options.scale;
  const TransferFunction transfer_function =
      chooseTransferFunction(words.scalar, info, glm::length(upper - lower));
  for (const std::string& note : transfer_function.notes()) tell("note", note);
  const std::string range_warning = rangeMissesScalar(info, transfer_function);
  if (!range_warning.empty()) tell("warning", range_warning);

  const ImageSize picture = options.size;
  options.size = dataSize(words.annotations, picture, transfer_function);
  options.output_bytes = outputBytes(words, picture);
  const CameraMotion motion = chooseCameraMotion(words.camera, lower, upper, options.size);
  const auto output = makeFrameOutput(words.output, words.camera.moves(), picture, frames_per_s);
  FrameRenderer renderer(cache, variable, transfer_function, parseBackend(words.backend));
  RenderReport report{words.cache, words.output,           picture, info, transfer_function,
                      options,     renderer.backendName(), {},      0,    {}};
  FrameRun(words, manifest, renderer, *output, report).draw(motion);
  if (!words.statistics.empty()) writeStatistics(words.statistics, statisticsOf(report));
  tellResult(report);
}

}  // namespace

void addRender(CLI::App& app) {
  auto words = std::make_shared<RenderWords>();
  CLI::App* command = app.add_subcommand("render", "Render a cache to a picture, or to a movie");
  command->add_option("CACHE", words->cache, "The splat cache, a folder NAME.splats")->required();
  command
      ->add_option("-o,--output", words->output,
                   "The picture: .png, .exr or .pfm; of several frames: frame_%04d.png, or NAME.mp4 (ffmpeg)")
      ->required();
  command->add_option("--size", words->size, "WIDTHxHEIGHT in pixels")->capture_default_str();
  addScalarOption(*command, words->scalar);

  const std::string what = "What to see";
  addFunctionOptions(*command, words->scalar, what);
  command
      ->add_option("--classify", words->classify,
                   "pixel: the scalar varies within a splat; flat: one colour a splat")
      ->capture_default_str()
      ->group(what);
  command->add_option("--lod-pixels", words->lod_pixels, "Detail that may be merged away, in pixels; 0: none")
      ->capture_default_str()
      ->group(what);
  command
      ->add_option("--max-splats", words->max_splats,
                   "Read at most so many (8M, 500K), where they show most; as many as --lod-pixels takes "
                   "otherwise")
      ->group(what);
  command->add_option("--scale", words->scale, "sx,sy,sz: stretch the data")
      ->capture_default_str()
      ->group(what);
  command
      ->add_option("--clip-box", words->clip_box,
                   "x0,x1,y0,y1,z0,z1: leave out what is outside, before --scale")
      ->group(what);
  command->add_option("--background", words->background, "white, black, transparent or #rrggbb")
      ->capture_default_str()
      ->group(what);

  command
      ->add_flag("--scalar-bar", words->annotations.scalar_bar,
                 "Beside the data, which colour stands for which value")
      ->group(what);
  command->add_flag("--axes", words->annotations.axes, "Draw where x, y and z point")->group(what);
  command->add_flag("--outline", words->annotations.outline, "Draw the box around the data")->group(what);

  const std::string where = "Camera";
  CameraWords* camera = &words->camera;
  command
      ->add_option("--view", camera->view,
                   "Where the camera stands: iso, +x, -x, +y, -y, +z or -z; iso otherwise")
      ->group(where);
  command->add_option("--position", camera->position, "x,y,z of the camera, after --scale")->group(where);
  command->add_option("--focal-point", camera->focal_point, "x,y,z it looks at; the data's centre otherwise")
      ->group(where);
  command->add_option("--view-up", camera->view_up, "x,y,z that points up; 0,0,1 otherwise")->group(where);
  command
      ->add_option("--parallel-scale", camera->parallel_scale,
                   "Half the picture's height in world units; all of the data otherwise")
      ->group(where);
  command
      ->add_option("--view-angle", camera->view_angle,
                   "Perspective, with this angle over the picture's height, in degrees")
      ->group(where);

  command->add_option("--orbit", camera->orbit, "Degrees to move around the focal point, about view-up")
      ->group(where);
  command
      ->add_option("--path", camera->path,
                   "Key frames to move through, FILE.json; render/README.md describes it")
      ->group(where);
  command->add_option("--frames", camera->frames, "How many pictures of --orbit or --path")
      ->check(CLI::Range(1u, kMaxFrames))
      ->group(where);
  command->add_option("--frame-rate", words->frame_rate, "Frames a second of a movie; 25 otherwise")
      ->group(where);

  const std::string how = "Resources";
  command->add_option("--backend", words->backend, "auto, osmesa, egl or cpu: what draws; see info --system")
      ->capture_default_str()
      ->group(how);
  command->add_option("--memory", words->memory, "Memory for the data in flight: 512M, 2G")
      ->capture_default_str()
      ->group(how);
  command->add_option("--threads", words->threads, "Workers; 0: one a core")
      ->check(CLI::Range(0u, kMaxThreads))
      ->capture_default_str()
      ->group(how);
  command
      ->add_option("--first-image", words->first_image,
                   "Write a coarse picture as soon as there is one: .png, .exr or .pfm")
      ->group(how);
  command
      ->add_flag("--keep-going", words->keep_going,
                 "Draw damaged bricks from a coarser level, and say so, instead of failing")
      ->group(how);
  command->add_option("--stats", words->statistics, "Write what was done, and how long it took, to FILE.json")
      ->group(how);
  command->callback([words] { render(*words); });
}

}  // namespace curvisplat
