// What the mouse and the keys do to the camera, as in ParaView. Pure: a camera in, a camera out.
//
// Movements are in pixels of a window of `size`, x to the right, y down.
#pragma once

#include <glm/vec2.hpp>
#include <glm/vec3.hpp>

#include "render/camera/camera.h"

namespace curvisplat {

/// Around the focal point: a window's width turns by 200 degrees about the image's up, its height about the
/// image's right.
Camera rotated(const Camera& camera, const glm::dvec2& movement, ImageSize size);
/// Across the view: what is at the focal point's depth follows the mouse.
Camera panned(const Camera& camera, const glm::dvec2& movement, ImageSize size);
/// What is at the focal point's depth becomes `factor` times as large; a perspective camera moves there.
/// `factor` > 0.
Camera zoomed(const Camera& camera, double factor);
/// Turns on the spot: a window's height turns by the camera's view angle.
Camera looking(const Camera& camera, const glm::dvec2& movement, ImageSize size);
/// Moves by `step` world units: x to the right, y up, z forward. The focal point moves along.
Camera flown(const Camera& camera, const glm::dvec3& step);

/// The other projection, with what is at the focal point's depth as large as it was.
Camera withOtherProjection(const Camera& camera);
/// From the same direction, all of the box [lower, upper] in the image.
Camera refitted(const Camera& camera, const glm::dvec3& lower, const glm::dvec3& upper, ImageSize size);

/// World units to a pixel at the focal point's depth.
double unitsPerPixel(const Camera& camera, ImageSize size);

}  // namespace curvisplat
