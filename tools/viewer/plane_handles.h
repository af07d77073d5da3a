// Clip planes and slices in the picture: a frame in the data with a handle in its middle, which is dragged along the
// plane's normal. The clip box has its edges there.
#pragma once

#include <functional>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <optional>

#include "stream/cache/manifest.h"
#include "tools/viewer/view_state.h"
#include "tools/viewer/window.h"

namespace curvisplat {

/// Where a point of the data is in the window, in Dear ImGui units; nullopt if it is behind the viewer.
using PlaceInWindow = std::function<std::optional<glm::dvec2>(const glm::dvec3&)>;

class PlaneHandles {
 public:
  /// Draws them over the picture and moves those that are dragged. Returns whether one was moved.
  bool draw(ViewState& state, const Manifest& manifest, const PlaceInWindow& place, Window& window);
  bool isDragging() const { return dragged_.has_value(); }

 private:
  bool drawOne(ClipPlane& plane, size_t number, const Manifest& manifest, const PlaceInWindow& place,
               Window& window);
  std::optional<size_t> dragged_;  // clip planes first, then slices
};

/// How far a plane moves along its normal (times its length) for a movement of the mouse: the point of its normal that
/// is seen under the mouse. `from`, `to`: where the plane's point and the point at the normal's end are seen. 0 where
/// the normal points at the viewer.
double shiftAlong(const glm::dvec2& from, const glm::dvec2& to, const glm::dvec2& movement);

}  // namespace curvisplat
