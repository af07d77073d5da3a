// The mouse and the keys over the picture, as in ParaView:
//
//   left drag    rotate            wheel, right drag   zoom          middle drag, shift + left   pan
//   r  all of the data   x y z (shift: from behind)  along an axis   o  orthographic, perspective
//   f  fly: w s forwards and back, a d sideways, q e up and down, left drag looks around
#pragma once

#include <glm/vec3.hpp>

#include "render/camera/camera.h"
#include "tools/viewer/window.h"

namespace curvisplat {

class Navigation {
 public:
  /// The box of the data after --scale, which `r` and the axes fit into the window.
  void setBounds(const glm::dvec3& lower, const glm::dvec3& upper) { lower_ = lower, upper_ = upper; }

  /// What was done since the last frame of Dear ImGui, which must have begun; true if it moved the camera.
  bool update(Window& window, Camera& camera, ImageSize size);
  /// True if the key is one of navigation's and moved the camera or changed its mode.
  bool press(const Window::Key& key, Camera& camera, ImageSize size);

  /// Whether the camera is being moved, or was a moment ago: a coarse picture will do.
  bool isMoving() const;
  bool flies() const { return flies_; }

 private:
  bool drag(Window& window, Camera& camera, ImageSize size);
  bool fly(const Window& window, Camera& camera);

  glm::dvec3 lower_{0.0}, upper_{1.0};
  bool flies_ = false;
  bool holds_ = false;      // a button
  double moved_at_s_ = -1;  // Dear ImGui's clock
};

}  // namespace curvisplat
