// A film: a camera path whose key frames may also have a transfer function, a clip box, clip planes and slices, which change
// from one to the next. Pure; any thread.
#pragma once

#include <cstdint>
#include <filesystem>
#include <glm/vec3.hpp>
#include <optional>
#include <string>
#include <vector>

#include "render/camera/camera_path.h"
#include "render/colour/function_parts.h"
#include "render/colour/transfer_function.h"
#include "render/project/plane_cuts.h"
#include "stream/base/json_document.h"

namespace curvisplat {

/// The function and the cuts of a key frame, as far as it states them.
struct KeyLook {
  std::optional<TransferFunctionDefinition> function = std::nullopt;  // with its opacity unit
  std::optional<FunctionParts> parts = std::nullopt;  // that `function` is made of, to be written
  std::optional<WorldBox> clip_box = std::nullopt;
  std::optional<std::vector<ClipPlane>> clip_planes = std::nullopt, slices = std::nullopt;

  /// Throws UsageError if there is no such map.
  void setFunction(const FunctionParts& from);
};

class Film {
 public:
  /// The kinds of things that the film states, and so no option may.
  struct Stated {
    bool functions = false, clip_boxes = false, clip_planes = false, slices = false;
    bool any() const { return functions || clip_boxes || clip_planes || slices; }
  };

  /// `looks`: of each key frame. All of them have functions, or none has. A key frame without a box or planes, where another one has them, has
  /// none. `scalar`: that the functions are of; empty: not stated. `scale`: the data's scale (FrameOptions::scale) of the pictures
  /// that the cameras are for; none: of any. Throws Error that names the key frame.
  Film(CameraPath cameras, std::vector<KeyLook> looks, std::string scalar, const std::string& name,
       std::optional<glm::dvec3> scale = std::nullopt);
  /// Reads the JSON file that tools/REFERENCE.md describes. Throws Error with the file, the key frame and the field.
  static Film fromFile(const std::filesystem::path& path);
  std::string toJson() const;

  const CameraPath& cameras() const { return cameras_; }
  const std::vector<KeyLook>& looks() const { return looks_; }
  const std::string& scalar() const { return scalar_; }
  const std::optional<glm::dvec3>& scale() const { return scale_; }
  const Stated& stated() const { return stated_; }
  /// The film for pictures of another scale: each camera keeps the place of the data that it looks at. Itself, if it is for any.
  Film inScale(const glm::dvec3& scale) const;
  /// Whether any key frame has another function than the one before.
  bool functionsChange() const { return functions_change_; }

  /// The time of a frame of `frames`, spread evenly: the last is at the end.
  double timeOf(uint64_t frame, uint64_t frames) const;
  /// The function and the cuts at a time: at a key frame exactly what that states. Functions are blended(); corners of boxes and points of
  /// planes move on lines, normals turn on great circles. If only one of two key frames has a box, or they have not
  /// equally many planes, what the earlier has stays until the later. `time` is clamped to the film.
  KeyLook lookAt(double time) const;

 private:
  CameraPath cameras_;
  std::vector<KeyLook> looks_;
  std::string scalar_;
  std::optional<glm::dvec3> scale_;
  Stated stated_;
  bool functions_change_ = false;
};

}  // namespace curvisplat
