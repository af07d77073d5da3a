// `render --stats`: counts and times of every stage, for each frame and summarised over all frames.
#pragma once

#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

#include "render/annotate/annotated_scene.h"
#include "render/camera/camera.h"
#include "render/colour/transfer_function.h"
#include "render/frame/frame.h"
#include "stream/base/ranks.h"
#include "stream/cache/manifest.h"

namespace curvisplat {

/// One drawn frame.
struct FrameReport {
  uint64_t number = 0;
  double time = 0;  // of the series
  Camera camera;
  FrameStatistics statistics;
  std::vector<FrameStatistics> of_ranks = {};  // that drew it together; `statistics` combines them
};

/// One run of `render`.
struct RenderReport {
  std::filesystem::path cache, output;
  ImageSize picture;  // includes the scalar bar; options.size is the data's part
  const DrawnScalars& scalars;
  const VariableInfo& variable;  // of the opacities
  const FrameOptions& options;
  std::string backend;
  unsigned ranks = 1;
  std::vector<FrameReport> frames;
  std::optional<double> time_to_first_image_s;    // since the process started; nullopt: none, or unknown
  std::optional<FrameStatistics> first_image;     // the coarse one of --first-image
  const VariableInfo* colour_variable = nullptr;  // of pictures of two scalars
  std::vector<ShownFunction> shown = {};          // by scalar bars
  glm::vec4 background{1, 1, 1, 1};               // that of the options may be left to the annotations

  const TransferFunction& function() const { return scalars.opacity.function; }
};

nlohmann::json statisticsOf(const RenderReport& report);

/// Statistics of a frame, or of several, as a message between ranks; and back.
Ranks::Bytes packStatistics(const std::vector<FrameReport>& frames);
/// Unpacks statistics; the reports have no cameras.
std::vector<FrameReport> unpackStatistics(const Ranks::Bytes& bytes);
/// The statistics of a picture that several ranks drew (combine).
FrameStatistics combined(const std::vector<FrameStatistics>& ranks);

}  // namespace curvisplat
