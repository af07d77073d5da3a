// Cameras that move: around a point, or along key frames. Pure; any thread.
#pragma once

#include <glm/vec3.hpp>

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "render/camera/camera.h"
#include "stream/base/json_document.h"

namespace curvisplat {

/// `camera` rotated by `degrees` about the axis through its focal point along view_up, as by VTK's Azimuth():
/// counter-clockwise, seen from the tip of view_up. A multiple of 360 degrees gives the same camera, bit for
/// bit. A view_up parallel to the view is replaced first, as for drawing.
Camera orbited(const Camera& camera, double degrees);

/// `camera` raised by `degrees` towards view_up, about the axis to its right through the focal point, as by
/// VTK's Elevation(). view_up stays, unless the camera comes within a degree of looking along it or passes
/// over it: then it is turned as well, so that the picture does not turn over.
Camera elevated(const Camera& camera, double degrees);

/// `camera` rolled by `degrees` about its line of sight, as by VTK's Roll(): the picture turns anticlockwise.
Camera rolled(const Camera& camera, double degrees);

/// `camera` with everything `factor` times as large in the picture, as by VTK's Zoom(): the parallel scale,
/// or the view angle, is divided by it.
Camera magnified(const Camera& camera, double factor);

/// `camera` moved as the data's scale changes: the same place of the data stays in focus, seen from as far.
Camera rescaled(const Camera& camera, const glm::dvec3& from, const glm::dvec3& to);

/// A direction on the great circle between two, as a unit vector; `from` itself if they are the same. `around`: the axis that
/// opposite ones turn about, as far as it is across them.
glm::dvec3 directionBetween(const glm::dvec3& from, const glm::dvec3& to, const glm::dvec3& around,
                            double part);

/// A camera at one time.
struct KeyFrame {
  double time = 0;
  Camera camera;
  std::optional<double> series_time = std::nullopt;  // of the time steps that are drawn
};

/// A smooth path that passes through each key frame exactly.
///
/// Position, focal point, the logarithm of the parallel scale and that of the view angle's half tangent are
/// cubic Hermite curves with the slopes of a Catmull-Rom spline over unequal times. The slope at an inner key
/// frame is that of the parabola through it and its neighbours, at an end that of the line to its neighbour;
/// two key frames are joined by a line. View-up turns on a great circle from one key frame to the next at
/// constant speed, so that it keeps its length; between opposite directions it rolls about the line of sight.
class CameraPath {
 public:
  /// `key_frames`: one or more, with times that increase by 1e-6 or more, all with the same projection.
  /// `name` is used in messages. Throws Error.
  CameraPath(std::vector<KeyFrame> key_frames, std::string name);

  /// Reads the JSON file that tools/REFERENCE.md describes. Throws Error with the file, the key frame and the
  /// field.
  static CameraPath fromFile(const std::filesystem::path& path);
  /// Reads a file that is parsed already, as fromFile().
  static CameraPath fromJson(const JsonField& root, std::string name);

  double begin() const { return key_frames_.front().time; }
  double end() const { return key_frames_.back().time; }
  const std::vector<KeyFrame>& keyFrames() const { return key_frames_; }
  const std::string& name() const { return name_; }
  /// `time` is clamped to [begin(), end()]. Throws Error if the camera coincides with its focal point then.
  Camera at(double time) const;

  /// Whether the key frames have times of the series: all do, or none.
  bool hasSeriesTimes() const { return key_frames_.front().series_time.has_value(); }
  /// Linear between the key frames. Call it only if they have such times.
  double seriesTimeAt(double time) const;

 private:
  std::vector<KeyFrame> key_frames_;
  std::string name_;
};

}  // namespace curvisplat
