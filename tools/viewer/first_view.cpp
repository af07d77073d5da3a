#include "tools/viewer/first_view.h"

#include <optional>
#include <utility>

#include "render/automatic/first_choice.h"

namespace curvisplat {
namespace {

/// One function for all steps: they are played.
FirstChoice choiceOf(const CacheReader& cache, const std::string& scalar) {
  return {cache, cache.variableNamed(scalar), glm::dvec3(1), ChosenFor::kSeries};
}

}  // namespace

ViewState firstViewOf(const CacheReader& cache, const std::string& scalar, ImageSize picture) {
  const Manifest& manifest = cache.manifest();
  ViewState state = firstViewOf(manifest, picture);
  if (!scalar.empty()) state.variable = scalar;
  const FirstChoice choice = choiceOf(cache, state.variable);
  state.function = EditedFunction::automatic(choice.function());
  const ImageSize size = dataSize(state.annotations, picture, state.function.function());
  const ViewChoice view = choice.view(state.function.function(), size);
  state.camera = Camera::named(view.view, manifest.lower, manifest.upper, size, Projection::kOrthographic);
  // The outline is to be seen whole.
  if (view.focal_point && !state.annotations.outline) {
    state.camera.position += *view.focal_point - state.camera.focal_point;
    state.camera.focal_point = *view.focal_point;
    state.camera.parallel_scale = view.parallel_scale;
  }
  return state;
}

EditedFunction automaticFunction(const CacheReader& cache, const std::string& scalar) {
  return EditedFunction::automatic(choiceOf(cache, scalar).function());
}

void chooseVariable(ViewState& state, const CacheReader& cache, const std::string& name) {
  std::optional<EditedFunction> chosen;  // first: where reading fails, the state stays as it was
  if (state.function.isAutomatic()) chosen = automaticFunction(cache, name);
  chooseVariable(state, cache.manifest(), name);
  if (chosen) state.function = *std::move(chosen);
}

}  // namespace curvisplat
