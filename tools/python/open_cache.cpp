#include "tools/python/open_cache.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "stream/base/error.h"
#include "tools/options/picture_choice.h"
#include "tools/python/interruptible.h"
#include "tools/viewer/histogram.h"

namespace py = pybind11;

namespace curvisplat::python {
namespace {

/// Marks the cache as busy for a call.
class Busy {
 public:
  explicit Busy(bool& busy) : busy_(busy) {
    if (busy_) throw UsageError("the cache is drawing in another thread; open it once for each thread");
    busy_ = true;
  }
  ~Busy() { busy_ = false; }
  Busy(const Busy&) = delete;
  Busy& operator=(const Busy&) = delete;

 private:
  bool& busy_;
};

/// A numpy array that owns the image's pixels.
py::array_t<float> arrayOf(Image image) {
  auto pixels = std::make_unique<std::vector<float>>(std::move(image.rgba));
  const py::capsule owner(pixels.get(), [](void* at) { delete static_cast<std::vector<float>*>(at); });
  const float* data = pixels.release()->data();
  return py::array_t<float>({image.size.height, image.size.width, 4}, data, owner);
}

}  // namespace

FrameRenderer& OpenCache::rendererOf(size_t variable, Backend backend, const TransferFunction& function) {
  if (player_ && variable == variable_ && backend == backend_) {
    player_->setTransferFunction(function);
    return player_->renderer();
  }
  player_.reset();  // its memory is given back before the next one takes some
  player_ = std::make_unique<StepPlayer>(reader_, DrawnScalars(variable, function), backend);
  variable_ = variable;
  backend_ = backend;
  return player_->renderer();
}

void OpenCache::goTo(uint64_t step) {
  if (const size_t steps = reader_.series().steps.size(); step >= steps)
    throw UsageError("{}: there is no step {}; the last one is {}", path_.string(), step, steps - 1);
  if (player_)
    player_->goTo({step});
  else if (step != reader_.step())
    reader_ = reader_.atStep(step);
}

std::vector<double> OpenCache::histogram(const HistogramArguments& arguments) const {
  const size_t variable = reader_.variableNamed(arguments.scalar);
  if (!(arguments.low < arguments.high) || !std::isfinite(arguments.high - arguments.low) ||
      (arguments.log && !(arguments.low > 0)))
    throw UsageError("a histogram from {} to {}: expected a finite range that increases{}", arguments.low,
                     arguments.high, arguments.log ? " and is above zero" : "");
  constexpr size_t kMaxBins = 1 << 20;
  if (arguments.bins == 0 || arguments.bins > kMaxBins)
    throw UsageError("a histogram of {} bins: expected from 1 to {}", arguments.bins, kMaxBins);
  EditedFunction function("viridis", arguments.low, arguments.high, 1);
  function.setLogScale(arguments.log);
  return histogramOf(reader_, variable, function, arguments.bins);
}

DrawnPicture OpenCache::render(const PictureArguments& arguments, const py::object& progress) {
  const Busy busy(busy_);
  checkCameraArguments(arguments.camera);
  checkSurfaceArguments(arguments.surfaces);
  DrawnPicture picture;
  Image image;
  runInterruptibly(progress, [&](Progress& of_work) {
    goTo(arguments.step);
    const Manifest& manifest = reader_.manifest();
    FrameOptions frame = arguments.frame;
    const size_t variable = chooseVariable(reader_, arguments.scalar);
    PictureChoice choice(reader_, variable, frame.scale);
    const TransferFunction function = choice.function(arguments.scalar);
    const CameraArguments camera = choice.camera(arguments.camera, function, frame.size);
    const CameraMotion motion =
        chooseCameraMotion(camera, manifest.lower * frame.scale, manifest.upper * frame.scale, frame.size);
    frame.scene = sceneOf(arguments.surfaces, reader_, {variable, variable});
    image = rendererOf(variable, arguments.backend, function)
                .render(motion.camera(0), frame, picture.statistics, &of_work);
    picture.chosen = choice.chosenOptions();
    picture.notes = function.notes();
  });
  picture.rgba = arrayOf(std::move(image));
  return picture;
}

void OpenCache::release() {
  const Busy busy(busy_);
  player_.reset();
}

}  // namespace curvisplat::python
