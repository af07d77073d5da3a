// The specification of the renderer: a ray march in double precision through an analytic scene or a real
// grid, along the rays through the pixels' centres. It shares no code with render/ but the words for a
// camera. Slow, and right.
//
// Front to back, emission and absorption: where colour c and extinction kappa are constant over a length d,
// the picture gains T (1 - exp(-kappa d)) c and the transmittance T shrinks by exp(-kappa d). A step is
// halved until kappa hardly changes over it, so that jumps of the transfer function are found too; the
// field's faces are found by bisection.
#pragma once

#include <functional>
#include <glm/vec3.hpp>
#include <optional>
#include <vector>

#include "preprocess/scenes/scenes.h"
#include "render/camera/camera.h"
#include "render/image/image.h"
#include "tests/reference/reference_field.h"

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

/// How far a march goes at a time, and where it begins.
struct MarchSteps {
  double step = 0.004;  // world units
  double cells = 0.5;   // of a grid's cell, at the point where a step begins
  double near = 0;      // perspective: as ScreenView::near
};

/// Light on the field's level surfaces, by the formulas of render/project/light.h, with the field's own
/// gradient.
struct ReferenceLight {
  double ambient = 0.3, diffuse = 0.7, specular = 0.25;
  double g0 = 1;                      // the scalar's unit per world unit
  std::optional<glm::dvec3> towards;  // the light; none: it is where the viewer is
};

/// Marches every pixel, from the plane of the viewer on. A part of a ray inside or outside of the field that
/// is shorter than a step may be missed. Parallel; the result does not depend on the threads.
ReferenceImage referenceMarch(const ReferenceField& field, const OpticalFunction& function,
                              const Camera& camera, ImageSize size, const MarchSteps& steps,
                              const ReferenceLight* light = nullptr);
ReferenceImage referenceMarch(const Scene& scene, const OpticalFunction& function, const Camera& camera,
                              ImageSize size, double step = 0.004);

/// Halves the steps until two successive pictures agree at `agreement_db` or more, six times at the most, and
/// gives the finer one. `reached_db` gets their agreement.
ReferenceImage convergedMarch(const ReferenceField& field, const OpticalFunction& function,
                              const Camera& camera, ImageSize size, MarchSteps steps = {},
                              double agreement_db = 75, double* reached_db = nullptr);

/// As a picture over white.
Image toImage(const ReferenceImage& reference);

/// Section 9's camera: orthographic, on the half-annulus.
Camera halfAnnulusCamera();

}  // namespace curvisplat
