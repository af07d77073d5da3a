// All that makes a picture in the window: camera, variable, function, detail. Kept from one window to the
// next, and told as a `curvisplat render` command.
#pragma once

#include <cstdint>
#include <filesystem>
#include <glm/vec3.hpp>
#include <optional>
#include <string>

#include "render/annotate/annotations.h"
#include "render/camera/camera.h"
#include "render/frame/frame.h"
#include "stream/cache/manifest.h"
#include "tools/viewer/edited_function.h"

namespace curvisplat {

struct ViewState {
  std::string variable;
  Camera camera;
  EditedFunction function;
  double lod_pixels = 1;
  uint64_t memory_bytes = 512 << 20;
  Classification classification = Classification::kPixel;
  glm::dvec3 scale{1.0};
  std::optional<WorldBox> clip_box = std::nullopt;
  bool dark = false;  // background
  Annotations annotations{true, true, true};

  glm::vec4 background() const { return dark ? glm::vec4(0, 0, 0, 1) : glm::vec4(1); }
  FrameOptions frameOptions(ImageSize size) const;
};

/// What a cache is opened with: its first variable, all of it in the picture beside the scalar bar. Throws
/// Error where the cache has no variable.
ViewState firstViewOf(const Manifest& manifest, ImageSize picture);

/// Another variable, with the function's colours and points over that one's range. Throws UsageError that
/// lists the variables there are.
void chooseVariable(ViewState& state, const Manifest& manifest, const std::string& name);

std::string toJson(const ViewState& state);
/// `path` is where the text comes from, for messages. Throws Error naming it and the field that is missing or
/// out of range, or the variable that the cache lacks.
ViewState viewStateFromJson(const std::string& text, const std::filesystem::path& path,
                            const Manifest& manifest);

/// The shell command that renders this view. `function_file` holds the function's definition where
/// state.function is no preset. Numbers are written so that they are read back the same.
std::string renderCommand(const ViewState& state, const std::filesystem::path& cache, ImageSize size,
                          const std::filesystem::path& function_file);

}  // namespace curvisplat
