// How a picture is divided and annotated, the same as `render` does it.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "render/annotate/annotations.h"
#include "stream/cache/manifest.h"
#include "tools/viewer/frame_loop.h"
#include "tools/viewer/view_state.h"

namespace curvisplat {

/// A state's functions, ready to be drawn and annotated. Outlives what it gives.
class ShownFunctions {
 public:
  ShownFunctions(const ViewState& state, const Manifest& manifest);

  DrawnScalars scalars(const CacheReader& cache, const ViewState& state) const;
  std::vector<ShownFunction> bars() const;

 private:
  TransferFunction colours_;
  std::optional<TransferFunction> opacities_, of_faces_;  // of faces that have a scalar of their own
  std::string title_, opacity_title_, faces_title_;
};

/// The part of a picture that shows the data.
ImageSize dataSizeOf(const ViewState& state, const Manifest& manifest, ImageSize picture);

/// What is annotated in a frame that was drawn for this state.
AnnotatedScene sceneOf(const ViewState& state, const ShownFunctions& functions, const ShownFrame& frame,
                       ImageSize picture);

}  // namespace curvisplat
