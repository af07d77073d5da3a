// Explains why a picture is empty: the transfer function, its range, blanking, the clip box or the camera.
// Without an explanation the user sees a white image and no reason. Notices pictures that show next to nothing
// as well.
#pragma once

#include <string>
#include <vector>

#include "render/camera/camera.h"
#include "render/colour/transfer_function.h"
#include "render/frame/frame.h"
#include "render/image/image.h"
#include "stream/cache/manifest.h"

namespace curvisplat {

/// Whether no pixel differs from the background by half a step of an 8-bit display or more.
bool isEmpty(const Image& image, const glm::vec4& background);

/// A rendered picture, in which whyEmpty() looks for reasons.
struct RenderedScene {
  const Manifest& manifest;
  const VariableInfo& variable;
  const TransferFunction& transfer_function;
  const Camera& camera;
  const FrameOptions& options;
  const FrameStatistics& statistics;
};

/// The reasons for an empty picture, most likely first; at least one.
std::vector<std::string> whyEmpty(const RenderedScene& scene);

/// A warning if the picture is nearly blank, of one colour, or dark by shadows, with the option that helps; else empty.
/// `function_options`: those of --tf, --range, --opacity, --asinh and --opacity-unit that were given, for
/// people to read.
std::string poorPictureWarning(const Image& image, const RenderedScene& scene,
                               const std::string& function_options);

/// A warning if the transfer function's range and the scalar's range are disjoint, so that all samples get
/// the colour and opacity of one end; empty otherwise.
std::string rangeMissesScalar(const VariableInfo& variable, const TransferFunction& transfer_function);

}  // namespace curvisplat
