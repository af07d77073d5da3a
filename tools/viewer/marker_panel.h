// Markers: the places in the data that were clicked. Their list, and their signs in the picture.
#pragma once

#include <functional>
#include <glm/vec2.hpp>
#include <optional>
#include <string>

#include "stream/cache/probe.h"
#include "tools/viewer/panel_actions.h"
#include "tools/viewer/view_state.h"

namespace curvisplat {

/// The list: names to edit, values, and buttons that remove one.
void drawMarkers(ViewState& state, PanelActions& actions);

/// Draws the markers over the picture. `place`: from data coordinates to Dear ImGui's; nullopt if it is not seen.
void drawMarkerSigns(const ViewState& state,
                     const std::function<std::optional<glm::dvec2>(const glm::dvec3&)>& place);

/// A marker named "1", "2", ... that no other has.
Marker markerOf(const ViewState& state, const VariableInfo& variable, const glm::dvec3& point,
                const ProbeResult& found);

/// "density 1.25 kg/m3 at 0.1, 0.2, 0.3; block 2, i 3, j 4, k 5". `blocks`: how many there are.
std::string textOf(const Marker& marker, size_t blocks, bool cells);

}  // namespace curvisplat
