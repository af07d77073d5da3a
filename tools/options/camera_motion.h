// The cameras of `render`: one, or one a frame, from --view or --position, --orbit and --path.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <glm/vec3.hpp>
#include <optional>
#include <string>

#include "render/camera/camera.h"

namespace curvisplat {

inline constexpr unsigned kMaxFrames = 100'000;  // of --frames

/// The command line's words, as given.
struct CameraWords {
  std::optional<std::string> view, position, focal_point, view_up, parallel_scale, view_angle, orbit;
  std::optional<uint64_t> frames;
  std::filesystem::path path;

  bool moves() const { return orbit || !path.empty(); }
};

/// Throws UsageError where words contradict each other, whatever the cache holds.
void checkCameraWords(const CameraWords& words);

/// The camera of each frame.
struct CameraMotion {
  uint64_t frames = 1;
  std::function<Camera(uint64_t frame)> camera;
};

/// For words that checkCameraWords() lets pass; [lower, upper] is the data's box after --scale. An orbit of
/// 360 degrees is a loop: its last frame is one step before the first. A path's last frame is at its last key
/// frame. Throws UsageError, and Error for a path file that is none.
CameraMotion chooseCameraMotion(const CameraWords& words, const glm::dvec3& lower, const glm::dvec3& upper,
                                ImageSize size);

}  // namespace curvisplat
