#include "tools/panels/picture_signs.h"

#include <fmt/format.h>
#include <imgui.h>
#include <imgui_stdlib.h>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/trigonometric.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <span>
#include <utility>

#include "tools/panels/labels.h"
#include "tools/view/picture_layout.h"
#include "tools/window/widgets.h"

namespace curvisplat {
namespace {

constexpr ImU32 kColour = IM_COL32(235, 140, 30, 255), kDragged = IM_COL32(255, 200, 60, 255);
// One of the two stands out from any picture.
constexpr ImU32 kDark = IM_COL32(0, 0, 0, 255), kLight = IM_COL32(255, 255, 255, 255);

ImVec2 toImGui(const glm::dvec2& point) {
  return {static_cast<float>(point.x), static_cast<float>(point.y)};
}

glm::dvec2 mouse() {
  return {static_cast<double>(ImGui::GetIO().MousePos.x), static_cast<double>(ImGui::GetIO().MousePos.y)};
}

/// Half the side of a grip's square.
double gripSize() {
  return 0.45 * static_cast<double>(ImGui::GetFontSize());
}

/// The width of each of the rings around a grip.
float ringWidth() {
  return std::max(1.0f, 0.1f * ImGui::GetFontSize());
}

/// Draws a line through points, with a dark edge on either side.
void drawLine(std::span<const ImVec2> points, ImU32 colour, bool is_closed, float width) {
  const ImDrawFlags flags = is_closed ? ImDrawFlags_Closed : ImDrawFlags_None;
  const int count = static_cast<int>(points.size());
  ImDrawList* const list = ImGui::GetBackgroundDrawList();
  list->AddPolyline(points.data(), count, IM_COL32(0, 0, 0, 150), flags, width + ringWidth());
  list->AddPolyline(points.data(), count, colour, flags, width);
}

/// Names what a grip does with its plane. The one that turns is a ring, so that they can be told apart.
enum class Grip { kMoves, kTurns };

/// Draws a grip over the picture. Returns whether it is pressed now.
bool drawGrip(Grip kind, const glm::dvec2& at, const std::string& name, ImU32 colour, Window& window) {
  const double size = gripSize();
  ImDrawList* const list = ImGui::GetBackgroundDrawList();
  const auto radius = static_cast<float>(size), ring = ringWidth();
  list->AddCircleFilled(toImGui(at), radius + ring, kDark);
  list->AddCircleFilled(toImGui(at), radius, kLight);
  list->AddCircleFilled(toImGui(at), radius - ring, colour);
  if (kind == Grip::kTurns) list->AddCircleFilled(toImGui(at), 0.5f * radius, kDark);
  const Rectangle grip{at.x - size, at.y - size, 2 * size, 2 * size};
  window.cover(grip);
  nameArea(name, grip.x, grip.y, grip.width, grip.height);
  if (!grip.contains(mouse()) || ImGui::GetIO().WantCaptureMouse) return false;
  if (!ImGui::IsMouseDown(ImGuiMouseButton_Left))
    ImGui::SetTooltip("drag to %s the plane", kind == Grip::kTurns ? "turn" : "move");
  return ImGui::IsMouseClicked(ImGuiMouseButton_Left);
}

/// The plane's point nearest to the middle of the data, its normal at unit length, and two directions in it.
struct Frame {
  glm::dvec3 middle, normal, across, up;
};

Frame frameOf(const ClipPlane& plane, const Manifest& manifest) {
  const glm::dvec3 centre = 0.5 * (manifest.lower + manifest.upper);
  const glm::dvec3 normal = glm::normalize(plane.normal);
  const glm::dvec3 middle = centre + glm::dot(normal, plane.point - centre) * normal;
  const glm::dvec3 other = std::abs(normal.z) < 0.9 ? glm::dvec3(0, 0, 1) : glm::dvec3(1, 0, 0);
  const glm::dvec3 across = glm::normalize(glm::cross(other, normal));
  return {middle, normal, across, glm::cross(normal, across)};
}

/// Half the extent of the data along a direction.
double reachAlong(const glm::dvec3& direction, const Manifest& manifest) {
  return glm::dot(0.5 * (manifest.upper - manifest.lower), glm::abs(direction));
}

}  // namespace

double shiftAlong(const glm::dvec2& from, const glm::dvec2& to, const glm::dvec2& movement) {
  const glm::dvec2 along = to - from;
  const double length2 = glm::dot(along, along);
  return length2 < 1 ? 0 : glm::dot(movement, along) / length2;
}

namespace {

/// The edges of the clip box: what is clipped may be clear, so that the picture alone does not show where it
/// ends.
void drawBox(const WorldBox& box, const PlaceInWindow& place) {
  const auto corner = [&](unsigned n) {
    return place({n & 1 ? box.upper.x : box.lower.x, n & 2 ? box.upper.y : box.lower.y,
                  n & 4 ? box.upper.z : box.lower.z});
  };
  for (unsigned from = 0; from < 8; ++from)
    for (const unsigned axis : {1u, 2u, 4u}) {
      if (from & axis) continue;
      const auto begin = corner(from), end = corner(from | axis);
      if (begin && end)
        drawLine(std::array{toImGui(*begin), toImGui(*end)}, kColour, false, 0.11f * ImGui::GetFontSize());
    }
}

}  // namespace

glm::dvec3 turnedTo(const glm::dvec2& tip, bool is_behind, const Camera& camera) {
  const double length = glm::length(tip);
  const glm::dvec2 at = length > 1 ? tip / length : tip;
  const double depth = std::sqrt(std::max(0.0, 1 - glm::dot(at, at)));
  const ViewAxes axes = camera.axes();
  return glm::normalize(at.x * axes.right + at.y * axes.up + (is_behind ? depth : -depth) * axes.forward);
}

bool PlaneHandles::draw(ViewState& state, const Manifest& manifest, const PlaceInWindow& place,
                        Window& window) {
  if (!ImGui::IsMouseDown(ImGuiMouseButton_Left)) dragged_.reset();
  if (state.clip_box) drawBox(*state.clip_box, place);
  const Scene scene{manifest, place, window, state.camera, state.scale};
  bool changed = false;
  size_t number = 0;
  for (auto* planes : {&state.clip_planes, &state.slices})
    for (ListedPlane& plane : *planes) {
      if (plane.visible) changed |= drawOne(plane, number, scene);
      ++number;
    }
  return changed;
}

bool PlaneHandles::drawOne(ClipPlane& plane, size_t number, const Scene& scene) {
  const Frame frame = frameOf(plane, scene.manifest);
  const double reach = reachAlong(frame.normal, scene.manifest);
  const double wide = reachAlong(frame.across, scene.manifest), high = reachAlong(frame.up, scene.manifest);
  const auto handle = scene.place(frame.middle);
  // A plane that faces the viewer is moved by dragging upwards.
  const auto end = scene.place(frame.middle + reach * frame.normal);
  if (!handle || !end) return false;
  const bool is_dragged = dragged_ && dragged_->number == number;
  const ImU32 colour = is_dragged ? kDragged : kColour;
  std::array<ImVec2, 4> corners;
  bool seen = true;
  for (size_t n = 0; n < 4; ++n) {
    const double x = n == 0 || n == 3 ? -wide : wide, y = n < 2 ? -high : high;
    const auto corner = scene.place(frame.middle + x * frame.across + y * frame.up);
    seen &= corner.has_value();
    if (corner) corners[n] = toImGui(*corner);
  }
  if (seen) drawLine(corners, colour, true, 0.11f * ImGui::GetFontSize());
  const bool turns = drawTip(plane, number, frame.middle, scene);
  const bool moves = drawHandle(plane, number, {frame.normal, reach, *handle, *end}, scene);
  return turns || moves;
}

/// Draws the grip at the tip of the normal, which turns the plane about its middle. The line has one length on the screen,
/// whatever the data's.
bool PlaneHandles::drawTip(ClipPlane& plane, size_t number, const glm::dvec3& middle, const Scene& scene) {
  const double lever = 5 * static_cast<double>(ImGui::GetFontSize()), size = gripSize();
  const glm::dvec3 normal = glm::normalize(plane.normal / scene.scale);  // as it is seen
  const ViewAxes axes = scene.camera.axes();
  const glm::dvec2 tip(glm::dot(normal, axes.right), glm::dot(normal, axes.up));
  const glm::dvec2 handle = *scene.place(middle);
  glm::dvec2 along = lever * glm::dvec2(tip.x, -tip.y);
  // Where the normal points at the viewer or away, the grip lies beside the other one.
  const double nearest = std::max(2.5 * size, 0.6 * lever), length = glm::length(along);
  if (length < nearest) along = length > 0.1 ? nearest / length * along : glm::dvec2(0, -nearest);
  const bool is_dragged = dragged_ && dragged_->number == number && dragged_->turns;
  const ImU32 colour = is_dragged ? kDragged : kColour;
  drawLine(std::array{toImGui(handle), toImGui(handle + along)}, colour, false, 0.15f * ImGui::GetFontSize());
  const bool pressed =
      drawGrip(Grip::kTurns, handle + along, fmt::format("tip {}", number + 1), colour, scene.window);
  if (pressed && !dragged_) {
    dragged_ = Drag{number, true, mouse(), tip, glm::dot(normal, axes.forward) > 0, normal};
    plane.point = middle;
  }
  if (!dragged_ || dragged_->number != number || !dragged_->turns) return false;
  const std::string turn =
      fmt::format("turned by {:.0f}°\nnormal {:.2f}, {:.2f}, {:.2f}",
                  glm::degrees(std::acos(std::clamp(glm::dot(normal, dragged_->normal), -1.0, 1.0))),
                  plane.normal.x, plane.normal.y, plane.normal.z);
  ImGui::SetTooltip("%s", turn.c_str());
  nameArea("plane " + turn.substr(0, turn.find('\n')), handle.x, handle.y, 1, 1);
  const glm::dvec2 movement = mouse() - dragged_->from;
  if (glm::length(movement) < 0.5) return false;
  const glm::dvec3 turned =
      glm::normalize(turnedTo(dragged_->tip + glm::dvec2(movement.x, -movement.y) / lever,
                              dragged_->is_behind, scene.camera) *
                     scene.scale);
  if (glm::distance(turned, plane.normal) < 1e-9) return false;
  plane.normal = turned;
  return true;
}

/// Draws the grip in the middle, which moves the plane along its normal.
bool PlaneHandles::drawHandle(ClipPlane& plane, size_t number, const Normal& normal, const Scene& scene) {
  const bool is_dragged = dragged_ && dragged_->number == number && !dragged_->turns;
  const bool pressed = drawGrip(Grip::kMoves, normal.handle, fmt::format("handle {}", number + 1),
                                is_dragged ? kDragged : kColour, scene.window);
  if (pressed && !dragged_) dragged_ = Drag{number};
  if (!dragged_ || dragged_->number != number || dragged_->turns) return false;
  const glm::dvec2 movement = mouse() - normal.handle;
  const bool faces = glm::length(normal.end - normal.handle) < 8;
  const double share = faces ? -static_cast<double>(ImGui::GetIO().MouseDelta.y) / 200
                             : shiftAlong(normal.handle, normal.end, movement);
  const glm::dvec3 centre = 0.5 * (scene.manifest.lower + scene.manifest.upper);
  const double now = glm::dot(normal.along, plane.point - centre);
  const double then = std::clamp(now + share * normal.reach, -normal.reach, normal.reach);
  if (then == now || (!faces && glm::length(movement) < 0.5)) return false;
  plane.point += (then - now) * normal.along;
  return true;
}

std::optional<size_t> pressedAxis(const std::array<glm::dvec2, 3>& places, Window& window) {
  const double radius = 0.8 * static_cast<double>(ImGui::GetFontSize());
  std::optional<size_t> pressed;
  bool has_ring = false;
  for (size_t axis = 0; axis < places.size(); ++axis) {
    const Rectangle area{places[axis].x - radius, places[axis].y - radius, 2 * radius, 2 * radius};
    window.cover(area);
    nameArea(fmt::format("axis {}", "xyz"[axis]), area.x, area.y, area.width, area.height);
    if (has_ring || !area.contains(mouse()) || ImGui::GetIO().WantCaptureMouse) continue;
    has_ring = true;
    const float width = 0.12f * ImGui::GetFontSize();
    for (const auto& [colour, more] : {std::pair(IM_COL32(0, 0, 0, 150), ringWidth()), {kColour, 0.0f}})
      ImGui::GetBackgroundDrawList()->AddCircle(toImGui(places[axis]), static_cast<float>(radius), colour, 0,
                                                width + more);
    if (ImGui::IsMouseClicked(ImGuiMouseButton_Left)) pressed = axis;
  }
  return pressed;
}

namespace {

/// Returns the place without the exaggeration of heights.
glm::dvec3 unstretched(const glm::dvec3& point, const std::optional<Globe>& globe) {
  if (!globe) return point;
  Globe plain = *globe;
  plain.vertical_scale = 1;
  return plain.placeAt(globe->geographic(point));
}

/// Draws the distance between two markers, along a straight line and without --scale.
void drawDistance(const Marker& from, const Marker& to, const std::optional<Globe>& globe) {
  const std::string text = fmt::format(
      "distance {} to {}: {:.5g}{}", from.name, to.name,
      glm::distance(unstretched(from.point, globe), unstretched(to.point, globe)), globe ? " km" : "");
  ImGui::TextUnformatted(text.c_str());
  nameWidget(text);
  hint(!globe            ? "along a straight line, in the units of the coordinates"
       : globe->sphere() ? "along a straight line, through the Earth"
                         : "along a straight line");
}

}  // namespace

void drawMarkers(ViewState& state, const std::optional<Globe>& globe, PanelActions& actions) {
  if (state.markers.empty()) ImGui::TextDisabled("Click into the picture to keep a value.");
  size_t removed = state.markers.size();
  for (size_t n = 0; n < state.markers.size(); ++n) {
    Marker& marker = state.markers[n];
    ImGui::PushID(static_cast<int>(n));
    ImGui::SetNextItemWidth(ImGui::GetContentRegionAvail().x - ImGui::CalcTextSize("Remove").x -
                            2 * ImGui::GetStyle().FramePadding.x - ImGui::GetStyle().ItemSpacing.x);
    actions.changed |= ImGui::InputText("##name", &marker.name);
    nameWidget(fmt::format("marker {}", n + 1));
    if (ImGui::IsItemActive()) nameWidget(fmt::format("editing marker {}", n + 1));
    ImGui::SameLine();
    if (ImGui::Button("Remove")) removed = n;
    nameWidget(fmt::format("remove marker {}", n + 1));
    ImGui::TextWrapped(
        "%s", fmt::format("{} {:.5g}{}{}\n{}", marker.scalar, marker.value, marker.unit.empty() ? "" : " ",
                          marker.unit, placeText(marker.point, globe))
                  .c_str());
    hint(fmt::format("block {}, i {}, j {}, k {}", marker.block + 1, marker.i, marker.j, marker.k).c_str());
    if (n > 0) drawDistance(state.markers[n - 1], marker, globe);
    ImGui::PopID();
  }
  if (removed == state.markers.size()) return;
  state.markers.erase(state.markers.begin() + static_cast<ptrdiff_t>(removed));
  actions.changed = true;
}

void drawMarkerSigns(const ViewState& state, const PlaceInWindow& place) {
  ImDrawList* const list = ImGui::GetBackgroundDrawList();
  const ImU32 line = IM_COL32(255, 255, 255, 255), edge = IM_COL32(0, 0, 0, 255);
  const float radius = 0.3f * ImGui::GetFontSize();
  for (size_t n = 0; n < state.markers.size(); ++n) {
    const Marker& marker = state.markers[n];
    const auto at = place(marker.point);
    if (!at) continue;
    const ImVec2 centre(static_cast<float>(at->x), static_cast<float>(at->y));
    list->AddCircleFilled(centre, radius, edge);
    list->AddCircleFilled(centre, 0.7f * radius, line);
    const std::string text = signOf(marker, state.variable);
    const ImVec2 size = ImGui::CalcTextSize(text.c_str());
    const float away = 1.5f * radius;  // from the dot to its text, at the left if it fits only there
    const bool at_left = centre.x + away + size.x + 3 > list->GetClipRectMax().x &&
                         centre.x - away - size.x - 3 >= list->GetClipRectMin().x;
    const ImVec2 lower(at_left ? centre.x - away - size.x : centre.x + away, centre.y - 0.5f * size.y);
    list->AddRectFilled({lower.x - 3, lower.y - 1}, {lower.x + size.x + 3, lower.y + size.y + 1},
                        IM_COL32(0, 0, 0, 170), 3);
    list->AddText(lower, line, text.c_str());
    nameArea(fmt::format("sign of marker {}", n + 1), at->x - 4, at->y - 4, 8, 8);
  }
}

Marker markerOf(const ViewState& state, const VariableInfo& variable, const glm::dvec3& point,
                const ProbeResult& found) {
  const auto taken = [&](const std::string& name) {
    return std::any_of(state.markers.begin(), state.markers.end(),
                       [&](const Marker& marker) { return marker.name == name; });
  };
  int number = 1;
  while (taken(std::to_string(number))) ++number;
  return {std::to_string(number),
          point,
          variable.name,
          variable.unit,
          static_cast<double>(found.variables.at(0).value),
          found.block,
          found.i,
          found.j,
          found.k};
}

std::string textOf(const Marker& marker, const Manifest& manifest) {
  const std::string unit = marker.unit.empty() ? "" : " " + marker.unit;
  const std::string block = manifest.blocks.size() > 1 ? fmt::format("block {}, ", marker.block + 1) : "";
  return fmt::format("{} {:.5g}{} at {}; {} {}i {}, j {}, k {}", marker.scalar, marker.value, unit,
                     placeText(marker.point, manifest.globe), manifest.cells ? "cell" : "node", block,
                     marker.i, marker.j, marker.k);
}

}  // namespace curvisplat
