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
  std::optional<FunctionParts> parts = std::nullopt;  // what `function` was made from, for Film::toJson()
  std::optional<WorldBox> clip_box = std::nullopt;
  std::optional<std::vector<ClipPlane>> clip_planes = std::nullopt, slices = std::nullopt;

  /// Throws UsageError if there is no such map.
  void setFunction(const FunctionParts& from);
};

class Film {
 public:
  /// The kinds of things that the film states; `render` refuses options for them.
  struct Stated {
    bool functions = false, clip_boxes = false, clip_planes = false, slices = false;
    bool any() const { return functions || clip_boxes || clip_planes || slices; }
  };

  /// `looks`: one for each key frame. All have functions, or none has. Where one has a clip box, clip planes
  /// or slices and another does not state them, that one has none. `scalar`: whose values the functions take;
  /// empty: not stated. `scale`: the scale of the data (FrameOptions::scale) that the cameras are for;
  /// nullopt: any. Throws Error that names the key frame.
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
  /// The film with its cameras moved for data of this scale: each still looks at the same place of the data.
  /// A film that is for any scale is returned as it is.
  Film inScale(const glm::dvec3& scale) const;
  /// Whether any key frame has another function than the one before.
  bool functionsChange() const { return functions_change_; }

  /// The time of frame `frame`, from 0, of `frames` that are spread evenly from the first key frame to the
  /// last.
  double timeOf(uint64_t frame, uint64_t frames) const;
  /// The function and the cuts at a time, which is clamped to the film; at a key frame exactly what that
  /// states. Between two, functions are blended(), corners of boxes and points of planes move on lines, and
  /// normals turn on great circles. If only one of the two has a box, or their numbers of planes differ, the
  /// earlier one's stay until the later.
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
