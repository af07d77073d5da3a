#include "tools/view/picture_layout.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <utility>

#include "render/annotate/globe_box.h"
#include "render/frame/frame_plan.h"
#include "render/surface/scene_layers.h"
#include "stream/base/error.h"

namespace curvisplat {
namespace {

std::string titleOf(const Manifest& manifest, const std::string& name) {
  const VariableInfo* const info = manifest.variable(name);
  return info ? scalarTitle(info->name, info->unit) : name;
}

}  // namespace

ShownFunctions::ShownFunctions(const ViewState& state, const Manifest& manifest)
    : colours_(state.function.function()),
      title_(titleOf(manifest, state.variable)),
      shows_opacities_(!state.opacity_by && state.drawsVolume()) {
  const bool has_faces = state.faces_by && !state.faceNames().faces.empty();
  const bool faces_differ = has_faces && state.faces_by->variable != state.variable;
  const auto scene = state.frameOptions({1, 1}, manifest).scene;
  shows_colours_ = !scene || usesColours(*scene) || (has_faces && !faces_differ);
  if (faces_differ) {
    of_faces_ = state.faces_by->function.function();
    faces_title_ = titleOf(manifest, state.faces_by->variable);
  }
  if (state.given && !state.given->curves.empty()) {
    const Curves& curves = state.given->curves.front();
    if (curves.title != state.variable) of_curves_ = curves.function;
    curves_title_ = curves.title;
  }
  if (!state.opacity_by) return;
  opacities_ = state.opacity_by->function.function();
  if (state.volume) opacity_title_ = titleOf(manifest, state.opacity_by->variable) + " (opacity)";
}

DrawnScalars ShownFunctions::scalars(const CacheReader& cache, const ViewState& state) const {
  const size_t shown = cache.variableNamed(state.variable);
  if (!opacities_) return DrawnScalars(shown, colours_);
  return DrawnScalars(DrawnScalar{cache.variableNamed(state.opacity_by->variable), *opacities_},
                      DrawnScalar{shown, colours_});
}

std::vector<ShownFunction> ShownFunctions::bars() const {
  using Part = ShownFunction::Part;
  std::vector<ShownFunction> bars;
  if (shows_colours_) bars.push_back({&colours_, title_, shows_opacities_ ? Part::kBoth : Part::kColours});
  if (opacities_ && !opacity_title_.empty()) bars.push_back({&*opacities_, opacity_title_, Part::kOpacities});
  if (of_faces_) bars.push_back({&*of_faces_, faces_title_});
  if (of_curves_) bars.push_back({of_curves_.get(), curves_title_});
  return bars;
}

ImageSize dataSizeOf(const ViewState& state, const Manifest& manifest, ImageSize picture) {
  const ShownFunctions functions(state, manifest);
  return dataSize(state.annotations, picture, functions.bars());
}

Annotations savedAnnotations(const ViewState& state) {
  Annotations saved = state.annotations;
  saved.markers = !state.markers.empty();
  return saved;
}

AnnotatedScene sceneOf(const ViewState& state, const ShownFunctions& functions, const ShownFrame& frame,
                       ImageSize picture, const std::optional<AnnotatedScene::OnGlobe>& box) {
  AnnotatedScene scene{picture,          frame.view,       functions.bars(),
                       frame.data.lower, frame.data.upper, state.background()};
  scene.text_size = state.annotations.text_size;
  scene.title = state.title;
  for (const Marker& marker : state.markers)
    scene.markers.push_back({marker.point, signOf(marker, state.variable)});
  showOnGlobe(box, scene);
  return scene;
}

const std::optional<AnnotatedScene::OnGlobe>& GlobeGrid::boxOf(const ViewState& state,
                                                               const CacheReader& cache) {
  static const std::optional<AnnotatedScene::OnGlobe> kNone;
  if (!state.annotations.axes_grid) return kNone;
  if (std::exchange(is_found_, true)) return box_;
  try {
    box_ = boxOnGlobe(cache, cache.manifest().globe);
  } catch (const Error&) {  // drawing the data reports it
  }
  return box_;
}

std::string placeText(const glm::dvec3& point, const std::optional<Globe>& globe) {
  if (!globe || !globe->degrees())
    return fmt::format("x {:.5g}, y {:.5g}, z {:.5g}", point.x, point.y, point.z);
  const glm::dvec3 place = globe->geographic(point);
  const double east = std::remainder(place.x, 360);
  return fmt::format("{:.3f}°{}, {:.3f}°{}, {} {:.0f} m", std::abs(east), east < 0 ? "W" : "E",
                     std::abs(place.y), place.y < 0 ? "S" : "N", place.z < 0 ? "depth" : "height",
                     1000 * std::abs(place.z));
}

std::optional<glm::dvec3> pointSeenAt(const ShownValues& shown, const Manifest& manifest,
                                      const glm::dvec2& pixel, ImageSize size) {
  const ImageSize own = shown.values.size;
  if (own.width <= 0 || size.width <= 0 || size.height <= 0) return std::nullopt;
  const glm::dvec2 at(pixel.x * own.width / size.width, pixel.y * own.height / size.height);
  const int column = static_cast<int>(std::floor(at.x)), row = static_cast<int>(std::floor(at.y));
  if (column < 0 || row < 0 || column >= own.width || row >= own.height) return std::nullopt;
  const auto index = static_cast<size_t>(row) * static_cast<size_t>(own.width) + static_cast<size_t>(column);
  const auto depth = static_cast<double>(shown.values.depth[index]);
  if (!std::isfinite(depth)) return std::nullopt;
  const ScreenView view = screenViewOf(manifest, shown.camera, shown.options, own);
  const glm::dvec3 place = placeOf(view, column, row, depth);
  const glm::dvec3 stretched = view.eye + place.x * view.right + place.y * view.down + place.z * view.forward;
  return stretched / view.scale;
}

void PointProbe::ask(const Question& question, bool again) {
  if (asked_ == question && !again) return;
  asked_ = next_ = question;
}

std::optional<PointProbe::Answer> PointProbe::poll() {
  std::optional<Answer> answer;
  if (answering_.valid() && answering_.wait_for(std::chrono::seconds(0)) == std::future_status::ready)
    answer = answering_.get();
  if (next_ && !answering_.valid())
    answering_ = std::async(std::launch::async,
                            [&cache = cache_, question = *std::exchange(next_, std::nullopt)]() -> Answer {
                              const CacheReader reader = cache.at(question.at);
                              const size_t variables[]{question.variable};
                              return {question, probe(reader, variables, question.point)};
                            });
  return answer;
}

}  // namespace curvisplat
