// Draws signs over the picture at places of the data: clip planes and slices, which are dragged by a
// handle, the edges of the clip box, and markers, with their list. For the window's thread, within a frame;
// nothing here reads the cache.
#pragma once

#include <glm/vec2.hpp>
#include <glm/vec3.hpp>

#include <array>
#include <cstddef>
#include <functional>
#include <optional>
#include <string>

#include "stream/cache/manifest.h"
#include "stream/cache/probe.h"
#include "stream/model/globe.h"
#include "tools/panels/labels.h"
#include "tools/view/view_state.h"
#include "tools/window/window.h"

namespace curvisplat {

/// The place of a point of the data in the window, in Dear ImGui units; nullopt if it is behind the viewer.
using PlaceInWindow = std::function<std::optional<glm::dvec2>(const glm::dvec3&)>;

/// Clip planes and slices in the picture: a frame in the data with a grip in its middle, which is dragged
/// along the plane's normal, and one at the normal's tip, which turns it. The clip box has its edges there.
class PlaneHandles {
 public:
  /// Draws the planes over the picture; moves or turns the one that is dragged. Returns whether one was.
  bool draw(ViewState& state, const Manifest& manifest, const PlaceInWindow& place, Window& window);
  bool isDragging() const { return dragged_.has_value(); }

 private:
  struct Scene {
    const Manifest& manifest;
    const PlaceInWindow& place;
    Window& window;
    const Camera& camera;
    const glm::dvec3& scale;
  };
  struct Normal {
    glm::dvec3 along;        // of unit length
    double reach;            // half the data's extent along it
    glm::dvec2 handle, end;  // where the plane's middle and the data's end along the normal are seen
  };
  struct Drag {
    size_t number = 0;  // clip planes first, then slices
    bool turns = false;
    glm::dvec2 from{0.0}, tip{0.0};  // the mouse and the normal's tip (turnedTo()) when it was pressed
    bool is_behind = false;          // the tip was farther away than the middle
    glm::dvec3 normal{0.0};          // as it was seen then
  };
  bool drawOne(ClipPlane& plane, size_t number, const Scene& scene);
  bool drawTip(ClipPlane& plane, size_t number, const glm::dvec3& middle, const Scene& scene);
  bool drawHandle(ClipPlane& plane, size_t number, const Normal& normal, const Scene& scene);
  std::optional<Drag> dragged_;
};

/// The direction of unit length whose tip is seen `tip` (to the right and up) from its foot, in units of its length:
/// in front of the foot or behind it, or across the view where the tip lies further away.
glm::dvec3 turnedTo(const glm::dvec2& tip, bool is_behind, const Camera& camera);

/// The axis whose name is pressed in the picture; `places`: where the names stand in the window. The name that the mouse is
/// over gets a ring.
std::optional<size_t> pressedAxis(const std::array<glm::dvec2, 3>& places, Window& window);

/// How far a plane moves along its normal (in lengths of the normal) for a movement of the mouse: to the
/// point of the normal that is seen under the mouse. `from`, `to`: where the plane's point and the point at
/// the normal's end are seen. 0 where the normal points at the viewer.
double shiftAlong(const glm::dvec2& from, const glm::dvec2& to, const glm::dvec2& movement);

/// Draws the list of markers, the places in the data that were clicked: names to edit, values, distances from one to the
/// next, and buttons that remove one. `globe`: of the data's manifest.
void drawMarkers(ViewState& state, const std::optional<Globe>& globe, PanelActions& actions);

/// Draws the markers over the picture.
void drawMarkerSigns(const ViewState& state, const PlaceInWindow& place);

/// A marker named "1", "2", ... that no other has.
Marker markerOf(const ViewState& state, const VariableInfo& variable, const glm::dvec3& point,
                const ProbeResult& found);

/// "density 1.25 kg/m3 at 0.1, 0.2, 0.3; block 2, i 3, j 4, k 5". `blocks`: how many there are.
std::string textOf(const Marker& marker, const Manifest& manifest);

}  // namespace curvisplat
