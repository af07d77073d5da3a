// Why a picture has nothing on it, or less than the user may think: the transfer function, its range,
// blanking, the clip box or the camera. People otherwise see a white image and no reason.
#pragma once

#include <string>
#include <vector>

#include "render/camera/camera.h"
#include "render/colour/transfer_function.h"
#include "render/frame/frame.h"
#include "render/image/image.h"
#include "stream/cache/manifest.h"

namespace curvisplat {

/// Whether no pixel differs from the background by what a screen would show.
bool isEmpty(const Image& image, const glm::vec4& background);

/// What was rendered, for a reason to be found in it.
struct RenderedScene {
  const Manifest& manifest;
  const VariableInfo& variable;
  const TransferFunction& transfer_function;
  const Camera& camera;
  const FrameOptions& options;
  const FrameStatistics& statistics;
};

/// The reasons for an empty picture, in the order in which one should look into them; never none.
std::vector<std::string> whyEmpty(const RenderedScene& scene);

/// A warning if the transfer function's range has no value of the scalar in it, so that everything has the
/// colour and opacity of one end; empty otherwise.
std::string rangeMissesScalar(const VariableInfo& variable, const TransferFunction& transfer_function);

}  // namespace curvisplat
