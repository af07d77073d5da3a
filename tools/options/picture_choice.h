// Options that choose a scalar and its transfer function, shared by the subcommands that draw, and
// PictureChoice, which chooses from the data (render/automatic) what these options and those of the camera
// leave open. It collects what it has chosen as options that draw the same picture. It reads the cache once,
// when it first needs the data. One thread at a time may use it.
#pragma once

#include <CLI/CLI.hpp>
#include <glm/vec3.hpp>

#include <cstddef>
#include <optional>
#include <string>

#include "render/annotate/annotated_scene.h"
#include "render/automatic/first_choice.h"
#include "render/colour/function_parts.h"
#include "render/colour/transfer_function.h"
#include "stream/cache/cache_reader.h"
#include "tools/options/frame_sequence.h"

namespace curvisplat {

/// Command-line arguments as given; checked and parsed later.
struct ScalarArguments {
  std::string scalar;
  std::optional<std::string> transfer_function, range, opacity, asinh, opacity_unit;
  std::optional<TransferFunctionDefinition> film = std::nullopt;  // a film's first, in place of these
  bool with_sheets = false;   // that have its colours: FirstChoice::function()'s
  const char* prefix = "--";  // of --tf, --range and --asinh; "--opacity-" of those of the opacities' scalar
};

/// Adds --scalar.
void addScalarOption(CLI::App& command, ScalarArguments& arguments);
/// Adds --tf, --range, --opacity, --asinh and --opacity-unit under the heading `group`.
void addFunctionOptions(CLI::App& command, ScalarArguments& arguments, const std::string& group);

/// The names of the options among those of addFunctionOptions() that were given: "--tf and --range".
std::string givenFunctionOptions(const ScalarArguments& arguments);

/// Position of the chosen scalar in the manifest; without a name, the first that varies. Throws Error, not
/// UsageError, for a scalar that the cache lacks: the cache decides, not the usage.
size_t chooseVariable(const CacheReader& cache, const ScalarArguments& arguments);

/// Throws UsageError if options contradict each other; needs no cache.
void checkFunctionArguments(const ScalarArguments& arguments);

/// Chooses the transfer function and the camera of a picture, and collects what it has chosen.
class PictureChoice {
 public:
  /// `cache` must outlive this. `scale`: FrameOptions::scale. `what`: the step, or the whole series, that one
  /// function is chosen for. `maps`: it has one of these colour maps if none is given. Reads nothing.
  PictureChoice(const CacheReader& cache, size_t variable, const glm::dvec3& scale,
                ChosenFor what = ChosenFor::kStep, const DefaultMaps& maps = kMapsOnDark)
      : cache_(cache), variable_(variable), scale_(scale), what_(what), maps_(maps) {}

  /// The transfer function by the options, with those that are not given chosen from the data. Throws
  /// UsageError if an option is wrong, Error if reading fails or a file does not hold a transfer function.
  TransferFunction function(const ScalarArguments& arguments);
  /// The functions of a picture of two scalars: of the one that gives the colours, and of the one that gives
  /// the opacities.
  TransferFunction colours(const ScalarArguments& arguments);
  TransferFunction opacities(const ScalarArguments& arguments);
  struct Framing {
    ShownBox box;
    ImageSize size;
    bool whole = false;  // frame the whole box, not only the part of it that the function makes visible
    std::optional<AnnotatedScene::OnGlobe> above =
        std::nullopt;  // data around an Earth that hides what is behind it
  };
  /// The arguments, with a camera chosen from the data if they do not place one, and the scale that fits if they leave it
  /// open. `function`: the picture's.
  CameraArguments camera(CameraArguments arguments, const TransferFunction& function, const Framing& framing);

  /// Frees what it has read of the data: some 15 MiB, which no frame's budget counts. Call it before frames
  /// are drawn. The next choice reads the data again.
  void release() { data_.reset(); }

  /// The options that were filled in, for a shell: "--tf viridis --range 0,1"; empty if nothing was.
  const std::string& chosenOptions() const { return chosen_; }

 private:
  void place(CameraArguments& arguments, const TransferFunction& function, const Framing& framing);
  const FirstChoice& data();
  VariableInfo info() const { return variableFor(cache_, variable_, what_); }
  std::pair<double, double> parseRange(const ScalarArguments& arguments);
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
  const DefaultMaps maps_;
  enum class Part { kAll, kColours, kOpacities };
  Part part_ = Part::kAll;  // of a function: what is said of it
  std::optional<FirstChoice> data_;
  std::string chosen_;
};

}  // namespace curvisplat
