// The specification of the renderer: a ray march in double precision through an analytic scene, along the
// rays through the pixels' centres. It shares no code with render/ but the words for a camera. Slow, and
// right.
//
// Front to back, emission and absorption: where colour c and extinction kappa are constant over a length d,
// the picture gains T (1 - exp(-kappa d)) c and the transmittance T shrinks by exp(-kappa d). A step is
// halved until kappa hardly changes over it, so that jumps of the transfer function are found too; the
// scene's faces are found by bisection.
#pragma once

#include <functional>
#include <glm/vec3.hpp>
#include <vector>

#include "preprocess/scenes.h"
#include "render/camera.h"

namespace curvisplat {

struct OpticalProperties {
  glm::dvec3 colour{0.0};
  double extinction = 0;  // per world unit
};
using OpticalFunction = std::function<OpticalProperties(double scalar)>;

/// The three functions of design section 9, exact.
OpticalProperties smoothFunction(double scalar);
OpticalProperties bandFunction(double scalar);
OpticalProperties stepFunction(double scalar);

struct ReferencePixel {
  glm::dvec3 colour{0.0};  // over white
  double transmittance = 1;
};

struct ReferenceImage {
  ImageSize size;
  std::vector<ReferencePixel> pixels;  // rows from the top

  const ReferencePixel& at(int x, int y) const {
    return pixels[static_cast<size_t>(y) * static_cast<size_t>(size.width) + static_cast<size_t>(x)];
  }
};

/// Marches every pixel with steps of at most `step` world units, from the plane of the viewer on. A part of a
/// ray inside or outside of the scene that is shorter than `step` may be missed. Parallel; the result does
/// not depend on the threads.
ReferenceImage referenceMarch(const Scene& scene, const OpticalFunction& function, const Camera& camera,
                              ImageSize size, double step = 0.004);

/// Section 9's camera: orthographic, on the half-annulus.
Camera halfAnnulusCamera();

}  // namespace curvisplat
