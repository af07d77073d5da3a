#include "tools/view/first_view.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <optional>
#include <utility>
#include <vector>

#include "render/automatic/first_choice.h"
#include "render/colour/control_points.h"
#include "stream/base/threads.h"
#include "stream/cache/value_histogram.h"

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
  // The outline is to be seen whole.
  const Framed framed = state.annotations.outline ? Framed::kBox : Framed::kSeen;
  state.camera =
      cameraOf(choice.view(state.function.function(), size, framed, manifest.lower, manifest.upper),
               manifest.lower, manifest.upper, size);
  return state;
}

EditedFunction automaticFunction(const CacheReader& cache, const std::string& scalar, bool with_sheets) {
  return EditedFunction::automatic(choiceOf(cache, scalar).function("", kMapsOnDark, with_sheets));
}

double middleOfSeen(const std::vector<double>& histogram, const EditedFunction& function, double share) {
  const OpacityCurve opacities(function.points());
  const auto count = static_cast<double>(histogram.size());
  const auto sumsOf = [&](bool with_opacity) {
    std::vector<double> sums{0};
    for (size_t bin = 0; bin < histogram.size(); ++bin) {
      const double opacity = with_opacity ? opacities.at((static_cast<double>(bin) + 0.5) / count) : 1;
      sums.push_back(sums.back() + histogram[bin] * opacity);
    }
    return sums;
  };
  std::vector<double> sums = sumsOf(true);
  if (!(sums.back() > 0)) sums = sumsOf(false);
  if (!(sums.back() > 0)) return function.scalarAt(share);
  const double below = share * sums.back();
  const auto next = std::ranges::lower_bound(sums, below);  // not the first, which is 0
  const double before = *(next - 1);
  return function.scalarAt(
      (static_cast<double>(next - sums.begin()) - 1 + (below - before) / (*next - before)) / count);
}

double firstIsovalue(const CacheReader& cache, const ViewState& state, const std::string& scalar) {
  const size_t variable = cache.variableNamed(scalar);
  const VariableInfo& info = cache.manifest().variables[variable];
  EditedFunction function(kMapsOnDark.sequential, info.min, info.max, state.function.opacityUnit());
  if (state.opacityScalar() == scalar)
    function = state.opacity_by ? state.opacity_by->function : state.function;
  const std::vector<double> histogram = histogramOf(cache, variable, function, kHistogramBins);
  // A second one at the place of the first would not be seen.
  constexpr double kShares[]{0.5, 0.75, 0.25, 0.875, 0.625, 0.375, 0.125}, kApart = 0.01;  // of the range
  const auto is_taken = [&](double value) {
    return std::ranges::any_of(state.isosurfaces, [&](const Isosurface& one) {
      return one.scalar == scalar &&
             std::abs(function.coordinateOf(one.value) - function.coordinateOf(value)) < kApart;
    });
  };
  for (const double share : kShares)
    if (const double value = middleOfSeen(histogram, function, share); !is_taken(value)) return value;
  return middleOfSeen(histogram, function);
}

EditedFunction chosenAnew(const EditedFunction& before, EditedFunction automatic) {
  const std::string& map = before.map();
  const bool is_default = map == kMapsOnDark.sequential || map == kMapsOnDark.diverging ||
                          map == kMapsOnLight.sequential || map == kMapsOnLight.diverging;
  if (!before.isAutomatic() && !map.empty() && !is_default) automatic.setColours(map);
  return automatic;
}

void chooseVariable(ViewState& state, const CacheReader& cache, const std::string& name) {
  // First: where reading fails, the state stays as it was.
  EditedFunction chosen = chosenAnew(state.function, automaticFunction(cache, name, state.coloursSheets()));
  chooseVariable(state, cache.manifest(), name);
  state.function = std::move(chosen);
  state.suitBackground();
}

void FunctionChooser::ask(const Question& question) {
  wanted(question.what) = question;
  if (!answering_.valid()) beginNext();
}

void FunctionChooser::takeQuestionsOf(FunctionChooser& other) {
  for (std::optional<Question>& wanted : other.wanted_)
    if (const auto question = std::exchange(wanted, std::nullopt)) ask(*question);
}

void FunctionChooser::drop() {
  wanted_ = {};
}

bool FunctionChooser::busy() const {
  return std::ranges::any_of(wanted_, [](const auto& wanted) { return wanted.has_value(); });
}

void FunctionChooser::beginNext() {
  const auto next = std::ranges::find_if(wanted_, [](const auto& wanted) { return wanted.has_value(); });
  if (next == wanted_.end()) return;
  question_ = **next;
  try {
    answering_ = std::async(std::launch::async, [&cache = cache_, wake = wake_, question = question_] {
      nameThisThread("function");
      struct WakeAtEnd {
        void (*call)();
        ~WakeAtEnd() { call(); }
      } const at_the_end{wake};
      return automaticFunction(cache, question.scalar, question.with_sheets);
    });
  } catch (...) {  // there is no thread to be had
    next->reset();
    throw;
  }
}

std::optional<FunctionChooser::Answer> FunctionChooser::poll() {
  if (answering_.valid() ? answering_.wait_for(std::chrono::seconds(0)) != std::future_status::ready
                         : !busy())
    return std::nullopt;
  std::future<EditedFunction> answered = std::move(answering_);
  const Question question = question_;
  const bool is_wanted = answered.valid() && wanted(question.what) == question;
  if (is_wanted) drop(question.what);
  beginNext();
  if (!is_wanted) return std::nullopt;
  return Answer{question, answered.get()};
}

}  // namespace curvisplat
