// Turns the camera options of `render` into the camera of each frame: --view or --position, --orbit, --path.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <glm/vec3.hpp>
#include <optional>
#include <string>
#include <vector>

#include "render/camera/camera.h"

namespace curvisplat {

inline constexpr unsigned kMaxFrames = 100'000;  // limit of --frames
inline constexpr unsigned kDefaultFrames = 90;   // of an orbit or a path

/// Command-line arguments as given; checked and parsed later.
struct CameraArguments {
  std::optional<std::string> view, position, focal_point, view_up, parallel_scale, view_angle, orbit;
  std::optional<uint64_t> frames;
  std::filesystem::path path;

  bool moves() const { return orbit || !path.empty(); }
  uint64_t frameCount() const { return frames.value_or(moves() ? kDefaultFrames : 1); }
};

/// Throws UsageError if options contradict each other; needs no cache.
void checkCameraArguments(const CameraArguments& arguments);

/// One camera per frame.
struct CameraMotion {
  uint64_t frames = 1;
  std::function<Camera(uint64_t frame)> camera;
  /// The series' time of a frame, of a path whose key frames have times; empty otherwise.
  std::function<double(uint64_t frame)> series_time;
};

/// Requires that checkCameraArguments() accepted the arguments. [lower, upper] is the data's bounding box
/// after --scale. An orbit of 360 degrees is a loop: its last frame is one step before the first. A path's
/// last frame is at its last key frame. Throws UsageError, or Error if the path file is invalid.
CameraMotion chooseCameraMotion(const CameraArguments& arguments, const glm::dvec3& lower,
                                const glm::dvec3& upper, ImageSize size);

}  // namespace curvisplat
