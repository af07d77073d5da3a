#include "tools/viewer/picture_layout.h"

#include <algorithm>

namespace curvisplat {
namespace {

std::string titleOf(const Manifest& manifest, const std::string& name) {
  const auto info = std::find_if(manifest.variables.begin(), manifest.variables.end(),
                                 [&](const VariableInfo& one) { return one.name == name; });
  return info == manifest.variables.end() ? name : scalarTitle(info->name, info->unit);
}

}  // namespace

ShownFunctions::ShownFunctions(const ViewState& state, const Manifest& manifest)
    : colours_(state.function.function()), title_(titleOf(manifest, state.variable)) {
  if (!state.faces.empty() && state.faces_by && state.faces_by->variable != state.variable) {
    of_faces_ = state.faces_by->function.function();
    faces_title_ = titleOf(manifest, state.faces_by->variable);
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
  std::vector<ShownFunction> bars{{&colours_, title_}};
  if (opacities_ && !opacity_title_.empty()) bars.push_back({&*opacities_, opacity_title_, true});
  if (of_faces_) bars.push_back({&*of_faces_, faces_title_});
  return bars;
}

ImageSize dataSizeOf(const ViewState& state, const Manifest& manifest, ImageSize picture) {
  const ShownFunctions functions(state, manifest);
  return dataSize(state.annotations, picture, functions.bars());
}

AnnotatedScene sceneOf(const ViewState& state, const ShownFunctions& functions, const ShownFrame& frame,
                       ImageSize picture) {
  return {picture, frame.view, functions.bars(), frame.data.lower, frame.data.upper, state.background()};
}

}  // namespace curvisplat
