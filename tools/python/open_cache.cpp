#include "tools/python/open_cache.h"

#include <pybind11/stl.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>
#include <vector>

#include "render/annotate/annotations.h"
#include "render/annotate/globe_box.h"
#include "render/automatic/stored_steps.h"
#include "stream/base/error.h"
#include "tools/options/globe_arguments.h"
#include "tools/options/option_parsers.h"
#include "tools/options/picture_choice.h"
#include "tools/output/empty_picture.h"
#include "tools/output/start_checks.h"
#include "tools/python/interruptible.h"
#include "tools/view/edited_function.h"

namespace py = pybind11;

namespace curvisplat::python {
namespace {

using Texts = std::vector<std::string>;

std::optional<std::string> given(const Options& options, const std::string& name) {
  const auto found = options.find(name);
  return found == options.end() ? std::nullopt : std::optional(found->second);
}

template <typename Value>
Value of(const py::dict& others, const char* name) {
  return py::cast<Value>(others[name]);
}

ScalarArguments scalarArguments(const Options& function) {
  return {function.at("scalar"),      given(function, "tf"),    given(function, "range"),
          given(function, "opacity"), given(function, "asinh"), given(function, "opacity_unit")};
}

OpacityArguments opacityArguments(const Options& function) {
  OpacityArguments arguments;
  arguments.by.scalar = given(function, "opacity_by").value_or("");
  arguments.by.transfer_function = given(function, "opacity_tf");
  arguments.by.range = given(function, "opacity_range");
  arguments.by.asinh = given(function, "opacity_asinh");
  return arguments;
}

FrameArguments frameArguments(const Options& frame, const py::dict& others) {
  FrameArguments arguments;
  arguments.size = frame.at("size");
  arguments.background = frame.at("background");
  arguments.classify = frame.at("classify");
  arguments.scale = frame.at("scale");
  arguments.memory = frame.at("memory");
  arguments.card_memory = given(frame, "card_memory");
  arguments.lod_pixels = frame.at("lod_pixels");
  arguments.clip_box = given(frame, "clip_box");
  arguments.max_splats = given(frame, "max_splats");
  arguments.clip_planes = of<Texts>(others, "clip_planes");
  arguments.shade = of<bool>(others, "shade");
  arguments.light = given(frame, "light");
  arguments.light_direction = given(frame, "light_direction");
  arguments.shadow = given(frame, "shadow");
  arguments.ambient_occlusion = given(frame, "ambient_occlusion");
  arguments.gradient_opacity = given(frame, "gradient_opacity");
  arguments.threads = of<unsigned>(others, "threads");
  arguments.keep_going = of<bool>(others, "keep_going");
  return arguments;
}

SurfaceArguments surfaceArguments(const Options& frame, const py::dict& others) {
  SurfaceArguments arguments;
  arguments.surfaces = of<Texts>(others, "surfaces");
  arguments.colours = of<Texts>(others, "surface_colours");
  arguments.surface_by = of<std::string>(others, "surface_by");
  arguments.surface_opacities = of<Texts>(others, "surface_opacity");
  arguments.slices = of<Texts>(others, "slices");
  arguments.slice_opacity = of<std::string>(others, "slice_opacity");
  arguments.isovalues = of<Texts>(others, "isovalues");
  arguments.iso_by = of<std::string>(others, "iso_by");
  arguments.iso_colours = of<Texts>(others, "iso_colour");
  if (others.contains("iso_opacity")) arguments.iso_opacity = of<std::string>(others, "iso_opacity");
  arguments.volume = of<bool>(others, "volume") ? "on" : "off";
  CurveArguments& curves = arguments.curves;
  curves.lines = of<Texts>(others, "lines");
  curves.points = of<Texts>(others, "points");
  curves.colours = of<Texts>(others, "lines_colour");
  curves.by = of<std::string>(others, "lines_by");
  curves.line_width = of<std::string>(others, "line_width");
  curves.point_size = of<std::string>(others, "point_size");
  curves.opacity = of<std::string>(others, "lines_opacity");
  curves.time = given(frame, "lines_time");
  arguments.globe = given(frame, "globe");
  arguments.map.map = given(frame, "map");
  arguments.map.height = given(frame, "map_height");
  return arguments;
}

AnnotationArguments annotationArguments(const Options& frame, const py::dict& others) {
  AnnotationArguments arguments;
  arguments.bar_titles = of<Texts>(others, "scalar_bar_titles");
  arguments.markers = of<Texts>(others, "markers");
  arguments.axis_titles = given(frame, "axes_titles");
  arguments.title = given(frame, "title");
  arguments.label = given(frame, "label");
  arguments.text_size = given(frame, "text_size");
  arguments.shown.scalar_bar = of<bool>(others, "scalar_bar");
  arguments.shown.axes = of<bool>(others, "axes");
  arguments.shown.axes_grid = of<bool>(others, "axes_grid");
  arguments.shown.outline = of<bool>(others, "outline");
  arguments.showTitles();
  return arguments;
}

StepArguments stepArguments(const Options& frame, const py::dict& others) {
  StepArguments arguments;
  arguments.step = of<std::optional<uint64_t>>(others, "step");
  arguments.time = given(frame, "time");
  arguments.interpolates = of<bool>(others, "interpolate");
  return arguments;
}

}  // namespace

CameraArguments cameraArguments(const Options& camera) {
  CameraArguments arguments;
  arguments.view = given(camera, "view");
  arguments.position = given(camera, "position");
  arguments.focal_point = given(camera, "focal_point");
  arguments.view_up = given(camera, "view_up");
  arguments.parallel_scale = given(camera, "parallel_scale");
  arguments.view_angle = given(camera, "view_angle");
  arguments.orbit = given(camera, "orbit");
  arguments.look_at = given(camera, "look_at");
  arguments.from_height = given(camera, "from_height");
  arguments.azimuth = given(camera, "azimuth");
  arguments.elevation = given(camera, "elevation");
  arguments.roll = given(camera, "roll");
  arguments.zoom = given(camera, "zoom");
  return arguments;
}

PictureArguments pictureArguments(const Options& function, const Options& camera, const Options& frame,
                                  const py::dict& others) {
  return {scalarArguments(function),
          opacityArguments(function),
          cameraArguments(camera),
          frameOptions(frameArguments(frame, others)),
          surfaceArguments(frame, others),
          annotationArguments(frame, others),
          stepArguments(frame, others),
          valueChannels(given(frame, "channels"), "picture.exr"),
          parseBackend(of<std::string>(others, "backend")),
          given(frame, "vertical_scale")};
}

namespace {

/// A numpy array that owns the image's pixels.
py::array_t<float> pixelArray(Image image) {
  auto pixels = std::make_unique<std::vector<float>>(std::move(image.rgba));
  const py::capsule owner(pixels.get(), [](void* at) { delete static_cast<std::vector<float>*>(at); });
  const float* data = pixels.release()->data();
  return py::array_t<float>({image.size.height, image.size.width, 4}, data, owner);
}

/// The warnings that the command prints about such a picture.
std::vector<std::string> warningsOf(const PictureArguments& arguments, const Image& image,
                                    const RenderedScene& scene) {
  std::vector<std::string> warnings =
      slicesThatMiss(arguments.surfaces, scene.manifest.lower, scene.manifest.upper);
  if (scene.options.scene)
    for (std::string& miss :
         curvesThatMiss(arguments.surfaces, *scene.options.scene, scene.manifest.lower, scene.manifest.upper))
      warnings.push_back(std::move(miss));
  if (std::string missed = rangeMissesScalar(scene.variable, scene.transfer_function); !missed.empty())
    warnings.push_back(std::move(missed));
  if (isEmpty(image, scene.options.background)) {
    for (const std::string& reason : whyEmpty(scene)) warnings.push_back("the picture is empty: " + reason);
  } else if (std::string poor = poorPictureWarning(image, scene, givenFunctionOptions(arguments.scalar));
             !poor.empty()) {
    warnings.push_back(std::move(poor));
  }
  return warnings;
}

/// Replaces the reader that others see when a picture is done or has failed: by then its thread has ended, and this one has
/// the interpreter's lock.
struct LaterReader {
  std::shared_ptr<const CacheReader>& shown;
  std::shared_ptr<const CacheReader> reader = nullptr;
  ~LaterReader() {
    if (reader) shown = std::move(reader);
  }
};

}  // namespace

OpenCache::OpenCache(CacheReader reader, std::shared_ptr<void> mirror)
    : mirror_(std::move(mirror)),
      process_(::getpid()),
      shown_(std::make_shared<const CacheReader>(reader.at(reader.position()))),
      reader_(std::move(reader)) {}

/// Gives up the interpreter's lock meanwhile if the cache is remote: threads that still read need it. Where the interpreter
/// ends, they have been stopped.
void OpenCache::endPlayer() {
  std::optional<UnlockedWork> unlocked;
  try {
    if (player_ && mirror_ && PyGILState_Check() != 0) unlocked.emplace();
  } catch (const Error&) {
  }
  player_.reset();
}

OpenCache& OpenCache::ownBlanks(size_t set) {
  if (const auto known = own_blanks_.find(set); known != own_blanks_.end()) return *known->second;
  requireOwnProcess();
  std::unique_ptr<OpenCache> opened;
  {
    const std::shared_ptr<const CacheReader> reader = shown_;
    const UnlockedWork unlocked;
    opened = std::make_unique<OpenCache>(reader->ownBlanks(set), mirror_);
  }
  // Others may have opened it meanwhile: another thread, or what Python ran for a remote one.
  return *own_blanks_.try_emplace(set, std::move(opened)).first->second;
}

std::vector<OpenCache*> OpenCache::allOwnBlanks() {
  std::vector<OpenCache*> all;
  for (size_t n = 0; n < shown_->seriesManifest().own_blanks.size(); ++n) all.push_back(&ownBlanks(n));
  return all;
}

OpenCache& OpenCache::withScalar(const std::string& name) {
  const std::optional<size_t> set = shown_->ownBlanksOf(name);
  return set ? ownBlanks(*set) : *this;
}

OpenCache::~OpenCache() {
  // The player would wait for threads that only its own process has.
  if (::getpid() != process_)
    player_.release();
  else
    endPlayer();
}

void OpenCache::requireOwnProcess() const {
  if (::getpid() != process_)
    throw UsageError("the cache was opened before this process was forked; open it again in each process");
}

OpenCache::Use OpenCache::use() {
  requireOwnProcess();
  if (busy_)
    throw UsageError(
        "the cache is in use by another thread, or by the call that calls this one; open it once for each");
  busy_ = true;
  return Use(busy_);
}

FrameRenderer& OpenCache::rendererOf(const DrawnScalars& scalars, Backend backend) {
  const size_t variable = scalars.opacity.variable;
  // In a picture of two scalars the colours' function cannot be replaced.
  if (player_ && !scalars.colour && !two_scalars_ && variable == variable_ && backend == backend_) {
    player_->setTransferFunction(scalars.opacity.function);
    return player_->renderer();
  }
  endPlayer();  // its memory is given back before the next one takes some
  player_ = std::make_unique<StepPlayer>(reader_, scalars, backend);
  two_scalars_ = scalars.colour.has_value();
  variable_ = variable;
  backend_ = backend;
  return player_->renderer();
}

void OpenCache::goTo(const StepPosition& position) {
  if (player_)
    player_->goTo(position);
  else if (!(position == reader_.position()))
    reader_ = reader_.at(position);
}

std::vector<double> OpenCache::histogram(const HistogramArguments& arguments) const {
  const std::shared_ptr<const CacheReader> reader = shown_;
  const UnlockedWork unlocked;
  const size_t variable = reader->variableNamed(arguments.scalar);
  if (!(arguments.low < arguments.high) || !std::isfinite(arguments.high - arguments.low) ||
      (arguments.log && !(arguments.low > 0)))
    throw UsageError("range: from {} to {}; expected a finite range that increases{}", arguments.low,
                     arguments.high, arguments.log ? " and is above zero, as log needs" : "");
  constexpr size_t kMaxBins = 1 << 20;
  if (arguments.bins == 0 || arguments.bins > kMaxBins)
    throw UsageError("bins: {}; expected from 1 to {}", arguments.bins, kMaxBins);
  EditedFunction function(kMapsOnDark.sequential, arguments.low, arguments.high, 1);
  function.setLogScale(arguments.log);
  return histogramOf(*reader, variable, function, arguments.bins);
}

DrawnPicture OpenCache::render(const PictureArguments& arguments, const py::object& progress) {
  const bool has_opacities = !arguments.opacity.by.scalar.empty();
  checkCameraArguments(arguments.camera);
  checkFunctionArguments(arguments.scalar);
  checkOpacityArguments(arguments.opacity, arguments.scalar);
  checkSurfaceArguments(arguments.surfaces, has_opacities);
  checkAnnotationArguments(arguments.annotations);
  DrawnPicture picture;
  Image image;
  PixelValues values;
  const ImageSize size = arguments.frame.size;
  requireThreads(arguments.frame.threads, "threads");
  LaterReader later{shown_};
  runInterruptibly(progress, [&](Progress& of_work) {
    goTo(chosenSteps(arguments.steps, reader_).front());
    if (!(shown_->position() == reader_.position()))
      later.reader = std::make_shared<const CacheReader>(reader_.at(reader_.position()));
    const Manifest manifest = reader_.manifest();
    FrameOptions frame = arguments.frame;
    const std::optional<Globe> globe = globeOf(arguments.surfaces.globe, manifest);
    frame.scale = verticallyScaled(frame.scale, arguments.vertical_scale, globe);
    const size_t shown = chooseVariable(reader_, arguments.scalar);
    ScalarChoice choice =
        chooseScalars(arguments.opacity, arguments.scalar, reader_, shown, frame, ChosenFor::kStep);
    const DrawnScalars& scalars = choice.scalars;
    const TransferFunction& function = scalars.opacity.function;
    frame.scene = sceneOf(arguments.surfaces, reader_,
                          {shown, scalars.opacity.variable, has_opacities, mapsOn(frame.background)});
    const Annotations& annotations = arguments.annotations.shown;
    const std::vector<ShownFunction> functions = shownFunctions(
        arguments.annotations, scalars, manifest, frame.scene.get(), arguments.surfaces.surface_by);
    frame.size = dataSize(annotations, size, functions);
    if (!(annotations == Annotations{})) frame.output_bytes += annotatedBytes(size, frame.size);
    const auto box_on_globe = annotations.axes_grid ? boxOnGlobe(reader_, globe) : std::nullopt;
    const ShownBox box =
        withGrid(shownBox(manifest, frame.scale, frame.clip_box, annotations), box_on_globe, frame.scale);
    const bool whole = annotations.lieBehind() || frame.clip_box;
    const CameraArguments camera =
        choice.picture.camera(placedAbove(arguments.camera, globe, frame.scale), function,
                              {box, frame.size, whole, boxOnEarth(arguments.surfaces.map, reader_, globe)});
    const Camera at = chooseCameraMotion(camera, box, frame.size).camera(0);
    // The grid of the axes and edges of the box lie behind the data, before the background.
    if (annotations.lieBehind()) frame.background = glm::vec4(0);
    FrameRenderer& renderer = rendererOf(scalars, arguments.backend);
    image = arguments.channels.any()
                ? renderer.renderWithValues(at, frame, picture.statistics, values, &of_work)
                : renderer.render(at, frame, picture.statistics, &of_work);
    picture.warnings = warningsOf(
        arguments, image,
        {manifest, manifest.variables[scalars.opacity.variable], function, at, frame, picture.statistics});
    const TransferFunction& colours = scalars.colour ? scalars.colour->function : function;
    for (std::string& finer :
         finerThanStored(reader_, {{{scalars.opacity.variable, function.axis()}, {shown, colours.axis()}},
                                   askedIsovalues(frame.scene.get(), scalars.opacity.variable, shown)}))
      picture.warnings.push_back(std::move(finer));
    if (!(annotations == Annotations{})) {
      AnnotatedScene scene{size,
                           renderer.screenView(at, frame),
                           functions,
                           manifest.lower,
                           manifest.upper,
                           arguments.frame.background,
                           axisTitles(arguments.annotations)};
      arguments.annotations.put(box_on_globe, scene);
      const VariableInfo& of_texts = manifest.variables[shown];
      arguments.annotations.fill({reader_.time(), reader_.step(), 0, of_texts.name, of_texts.unit}, scene);
      image = annotated(std::move(image), annotations, scene);
    }
    picture.chosen = choice.chosenOptions();
    picture.notes = function.notes();
    if (scalars.colour)
      for (const std::string& note : scalars.colour->function.notes()) picture.notes.push_back(note);
  });
  picture.rgba = pixelArray(std::move(image));
  for (const ImageChannel& channel : imageChannels(arguments.channels, values, size))
    picture.channels[py::str(channel.name)] =
        py::array_t<float>({size.height, size.width}, channel.values.data());
  return picture;
}

void OpenCache::release() {
  const Use in_use = use();
  // Others may open further ones meanwhile, which have nothing to end.
  for (const auto& [set, cache] : own_blanks_) cache->endPlayer();
  endPlayer();
}

}  // namespace curvisplat::python
