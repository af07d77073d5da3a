// Camera movements of mouse and keys, as in ParaView. Pure: each function returns the moved camera.
//
// `movement` is in pixels of a window of `size`, x to the right, y down.
#pragma once

#include <glm/vec2.hpp>
#include <glm/vec3.hpp>

#include "render/camera/camera.h"

namespace curvisplat {

/// Rotates around the focal point: moving across the window's width turns by 200 degrees about the image's up
/// direction, across its height by 200 degrees about the image's right.
Camera rotated(const Camera& camera, const glm::dvec2& movement, ImageSize size);
/// Moves parallel to the image; points at the focal point's depth follow the mouse.
Camera panned(const Camera& camera, const glm::dvec2& movement, ImageSize size);
/// Magnifies objects at the focal point's depth by `factor` > 0; a perspective camera moves towards the
/// point.
Camera zoomed(const Camera& camera, double factor);
/// The same; what is seen at `pixel` at the focal point's depth stays there.
Camera zoomedAt(const Camera& camera, double factor, const glm::dvec2& pixel, ImageSize size);
/// Turns the camera in place; moving across the window's height turns by the view angle.
Camera looking(const Camera& camera, const glm::dvec2& movement, ImageSize size);
/// Moves camera and focal point by `step` in world units: x to the right, y up, z forward.
Camera flown(const Camera& camera, const glm::dvec3& step);

/// Switches the projection and keeps the size of objects at the focal point's depth.
Camera withOtherProjection(const Camera& camera);
/// The camera at which a picture of the size `to` shows all that one of the size `from` shows.
Camera holding(const Camera& camera, ImageSize from, ImageSize to);
/// Keeps the view direction and fits the box [lower, upper] into the image.
Camera refitted(const Camera& camera, const glm::dvec3& lower, const glm::dvec3& upper, ImageSize size);

/// World units per pixel at the focal point's depth.
double unitsPerPixel(const Camera& camera, ImageSize size);

}  // namespace curvisplat
