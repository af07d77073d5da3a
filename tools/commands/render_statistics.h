// `render --stats`: what was drawn, how long every stage took, frame by frame and over all frames.
#pragma once

#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

#include "render/camera/camera.h"
#include "render/colour/transfer_function.h"
#include "render/frame/frame.h"
#include "stream/cache/manifest.h"

namespace curvisplat {

/// A picture that was drawn.
struct FrameReport {
  Camera camera;
  FrameStatistics statistics;
};

/// A run of `render`.
struct RenderReport {
  std::filesystem::path cache, output;
  ImageSize picture;  // with the scalar bar; options.size is of the data
  const VariableInfo& variable;
  const TransferFunction& transfer_function;
  const FrameOptions& options;
  std::string backend;
  std::vector<FrameReport> frames;
  double time_to_first_image_s = 0;            // since the start of the process
  std::optional<FrameStatistics> first_image;  // the coarse one of --first-image
};

nlohmann::json statisticsOf(const RenderReport& report);

}  // namespace curvisplat
