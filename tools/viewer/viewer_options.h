// What `curvisplat view` is asked for.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "render/camera/camera.h"
#include "render/frame/backend.h"
#include "render/surface/surface_scene.h"

namespace curvisplat {

struct ViewerOptions {
  ImageSize size{1200, 800};
  Backend backend = Backend::kAutomatic;
  std::optional<std::filesystem::path> state;  // default: the saved state of this cache
  std::optional<std::string> scalar;
  std::shared_ptr<const SurfaceScene> scene;         // null: that of the state
  std::vector<std::filesystem::path> surface_files;  // of the scene's surfaces
  std::vector<std::string> face_names;               // of its grid surfaces
  std::string faces_by;                              // --surface-by
  std::optional<uint64_t> memory_bytes;
  std::optional<double> target_s;  // per picture while moving; default 0.033 with a graphics card, else 0.1
};

}  // namespace curvisplat
