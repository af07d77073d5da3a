// Parses points at which a grid is to be probed.
//
//    x,y,z                heading, optional
//    0.5,0.25,1e-3        x, y and z, between commas, semicolons, tabs or spaces; the rest of the line is ignored
#pragma once

#include <glm/vec3.hpp>

#include <string>
#include <string_view>
#include <vector>

namespace curvisplat {

/// Returns the points, all finite, one at least. `name`: of the file, for messages. Throws Error if a line below the first has no point,
/// or if there is none at all. Any thread.
std::vector<glm::dvec3> parsePointList(std::string_view text, const std::string& name);

}  // namespace curvisplat
