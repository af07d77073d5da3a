// Cameras that move: around a point, or along key frames. Pure; any thread.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "render/camera/camera.h"

namespace curvisplat {

/// `camera` moved by `degrees` around the axis through its focal point along view_up, as VTK's azimuth: seen
/// from the tip of view_up counter-clockwise. A multiple of 360 degrees gives the same camera, bit for bit. A
/// view_up along the view is replaced first, as for drawing.
Camera orbited(const Camera& camera, double degrees);

/// Where a camera is at one time.
struct KeyFrame {
  double time = 0;
  Camera camera;
};

/// A smooth way through key frames, which it meets exactly.
///
/// Position, focal point, the logarithm of the parallel scale and that of the view angle's half tangent are
/// cubic Hermite curves with the slopes of a Catmull-Rom spline over unequal times: at an inner key frame the
/// one of the parabola through it and its neighbours, at the ends that of the line to the neighbour. Two key
/// frames are joined by a line. View-up turns on a great circle from one key frame to the next at constant
/// speed, so that it never loses its length; between opposite ones it rolls about the line of sight.
class CameraPath {
 public:
  /// At least one key frame; times increase by a microsecond or more; all of one projection. `name` is for
  /// messages. Throws Error.
  CameraPath(std::vector<KeyFrame> key_frames, std::string name);

  /// Reads the JSON that render/README.md describes. Throws Error naming the file, the key frame and the
  /// field.
  static CameraPath fromFile(const std::filesystem::path& path);

  double begin() const { return key_frames_.front().time; }
  double end() const { return key_frames_.back().time; }
  /// Before begin() as at begin(), and after end() as at end(). Throws Error where the way leads the camera
  /// into its focal point.
  Camera at(double time) const;

 private:
  std::vector<KeyFrame> key_frames_;
  std::string name_;
};

}  // namespace curvisplat
