// The transfer function and the camera of a picture: from options, and what they leave out from the data
// (render/automatic). Everything chosen is collected as options that draw the same picture.
#pragma once

#include <cstddef>
#include <glm/vec3.hpp>
#include <optional>
#include <string>

#include "render/automatic/first_choice.h"
#include "stream/cache/cache_reader.h"
#include "tools/options/camera_motion.h"
#include "tools/options/scalar_arguments.h"

namespace curvisplat {

class PictureChoice {
 public:
  /// `cache` must outlive this; `scale` as in FrameOptions; `what` is drawn with one function. Reads nothing.
  PictureChoice(const CacheReader& cache, size_t variable, const glm::dvec3& scale,
                ChosenFor what = ChosenFor::kStep)
      : cache_(cache), variable_(variable), scale_(scale), what_(what) {}

  /// Fills in the options that are not given. Throws UsageError, or Error if reading fails or a file does not
  /// hold a transfer function.
  TransferFunction function(const ScalarArguments& arguments);
  /// The same, for pictures of two scalars: of the scalar that gives the colours, or the opacities alone.
  TransferFunction colours(const ScalarArguments& arguments);
  TransferFunction opacities(const ScalarArguments& arguments);
  /// The arguments, with a view if they have no camera at all. `function`: that of the picture.
  /// `whole`: never of a part of the data.
  CameraArguments camera(CameraArguments arguments, const TransferFunction& function, ImageSize size,
                         bool whole = false);

  /// What was filled in, for a shell: "--tf viridis --range 0,1"; empty if nothing was.
  const std::string& chosenOptions() const { return chosen_; }

 private:
  const FirstChoice& data();
  VariableInfo info() const { return variableFor(cache_, variable_, what_); }
  std::pair<double, double> parseRange(const std::string& text);
  TransferFunction fromFile(const ScalarArguments& arguments);
  TransferFunction fromParts(FunctionParts parts, const ScalarArguments& arguments);
  TransferFunction automatic(const ScalarArguments& arguments);
  /// The function with the opacity unit that was given, or that suits the data.
  TransferFunction withUnit(const TransferFunctionDefinition& definition,
                            const std::pair<double, double>* range, const ScalarArguments& arguments);
  void add(const std::string& option, const std::string& value);
  bool isSaid(const std::string& option) const;

  const CacheReader& cache_;
  const size_t variable_;
  const glm::dvec3 scale_;
  const ChosenFor what_;
  enum class Part { kAll, kColours, kOpacities };
  Part part_ = Part::kAll;  // of a function: what is said of it
  std::optional<FirstChoice> data_;
  std::string chosen_;
};

/// Throws UsageError if options contradict each other; needs no cache.
void checkFunctionArguments(const ScalarArguments& arguments);

}  // namespace curvisplat
