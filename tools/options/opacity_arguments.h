// Options of pictures of two scalars: the colours of --scalar, the opacities of --opacity-by.
#pragma once

#include <CLI/CLI.hpp>
#include <string>

#include "render/frame/frame_options.h"
#include "tools/options/picture_choice.h"
#include "tools/options/scene_arguments.h"

namespace curvisplat {

/// Command-line arguments as given; checked and parsed later.
struct OpacityArguments {
  /// The scalar of the opacities. Their points and unit are --opacity and --opacity-unit, which
  /// ScalarArguments of the --scalar has.
  ScalarArguments by;
};

/// Adds --opacity-by, --opacity-range, --opacity-asinh and --opacity-tf under this heading.
void addOpacityOptions(CLI::App& command, OpacityArguments& arguments, const std::string& group);

/// Throws UsageError if options contradict each other: without a look at any file.
void checkOpacityArguments(const OpacityArguments& arguments, const ScalarArguments& scalar);

/// The scalars of a picture with their functions, and the choice of the one whose opacities are drawn, which chooses
/// the view as well.
struct ScalarChoice {
  DrawnScalars scalars;
  PictureChoice picture;
  std::string chosen_colours;  // of two scalars: as PictureChoice::chosenOptions(), of the colours

  /// The options that were filled in, for all scalars.
  std::string chosenOptions() const;
};

/// `shown`: the variable of --scalar; the scale and the background are those of `frame`. Throws as PictureChoice.
ScalarChoice chooseScalars(const OpacityArguments& arguments, const ScalarArguments& scalar,
                           const CacheReader& cache, size_t shown, const FrameOptions& frame, ChosenFor what);

}  // namespace curvisplat
