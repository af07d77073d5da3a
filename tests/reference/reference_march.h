// The specification of the renderer: a ray march in double precision through an analytic scene or a real
// grid, along the rays through the pixels' centres. It shares no code with render/ but the words for a
// camera. Slow, and right.
//
// Front to back, emission and absorption: over a step of the optical depth d, the picture gains
// T (1 - exp(-d)) c and the transmittance T shrinks by exp(-d). d and the mean colour c are those of Simpson's
// rule. A step is halved until the midpoint rule agrees, so that jumps of the transfer function are found too.
// The field's ends are where it says that they are (ReferenceField::crossings), else found by bisection.
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

/// The three functions of DESIGN.md, "Fidelity", exact.
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
  // 2: every second pixel along x and along y is marched, and the image has half the width and height.
  int every = 1;
  // A step is halved until its optical depth, and the light from it, are within this of the midpoint rule's.
  // But at jumps, Simpson's rule is far nearer to the truth.
  double tolerance = 1e-5;
};

/// Steps for a field of about unit size and the functions of DESIGN.md, "Fidelity". Where it knows its
/// crossings: so long that pictures are within 100 dB of the truth (reference_march_test); else MarchSteps().
MarchSteps stepsFor(const ReferenceField& field);

/// Light on the field's level surfaces, by the formulas of render/project/light.h, with the field's own
/// gradient.
struct ReferenceLight {
  double ambient = 0.3, diffuse = 0.7, specular = 0.25;
  double g0 = 1;                      // the scalar's unit per world unit
  std::optional<glm::dvec3> towards;  // the light; none: it is where the viewer is
  // The strengths of render/project/shadow_grid.h, by marches from every point in steps of at most `shadow_step`.
  double shadow = 0, ambient_occlusion = 0;
  double occlusion_reach = 0;  // world units
  double shadow_step = 0.01;
};

/// Something in the field that a ray meets: a surface, or a slice.
struct ReferenceLayer {
  double distance = 0;     // along the ray, whose direction has length 1
  glm::dvec3 colour{0.0};  // not premultiplied
  double opacity = 1;
};
/// The layers that a ray meets, in any order.
using ReferenceLayers =
    std::function<std::vector<ReferenceLayer>(const glm::dvec3& origin, const glm::dvec3& direction)>;

/// A plane of one colour, or a sphere, opaque and lit from where the viewer is (ReferenceLight without g0 and highlights).
ReferenceLayers planeLayer(const glm::dvec3& point, const glm::dvec3& normal, const glm::dvec3& colour);
ReferenceLayers sphereLayer(const glm::dvec3& centre, double radius, const glm::dvec3& colour);
/// A slice through the field, in the colours of the function.
ReferenceLayers sliceLayer(const ReferenceField& field, const OpticalFunction& function,
                           const glm::dvec3& point, const glm::dvec3& normal, double opacity = 1);
/// A surface where a scalar crosses a value, lit as a sphere is.
struct ReferenceIsosurface {
  std::function<double(const glm::dvec3& world)> scalar;
  double value = 0;
  glm::dvec3 colour{0.0};
  std::function<double(const glm::dvec3& world)> opacity;
};
/// An isosurface of any scalar, or of the scene's, in a scene whose crossings are known; found by bisection.
ReferenceLayers isoLayer(const Scene& scene, const ReferenceIsosurface& surface);
ReferenceLayers isoLayer(const Scene& scene, double value, const glm::dvec3& colour, double opacity = 1);

/// Extras of a picture besides the field: light on it, layers in it, and a factor of its extinction, by the
/// magnitude of its gradient.
struct ReferenceExtras {
  const ReferenceLight* light = nullptr;
  ReferenceLayers layers = {};
  std::function<double(double magnitude)> gradient_opacity = {};
};

/// Marches every pixel, from the plane of the viewer on. Where the field does not know its crossings, a part
/// of a ray inside or outside of it that is shorter than a step may be missed. Parallel; the result does not
/// depend on the threads.
ReferenceImage referenceMarch(const ReferenceField& field, const OpticalFunction& function,
                              const Camera& camera, ImageSize size, const MarchSteps& steps,
                              const ReferenceExtras& extras = {});
/// Marches in steps of `step`, or as stepsFor().
ReferenceImage referenceMarch(const Scene& scene, const OpticalFunction& function, const Camera& camera,
                              ImageSize size, std::optional<double> step = {});

/// Two scalars: `function` has the opacities, by the field's scalar, and `colour` the colours at a point of the world.
struct TwoScalars {
  OpticalFunction function;
  std::function<glm::dvec3(const glm::dvec3& world)> colour;
};
ReferenceImage referenceMarch(const ReferenceField& field, const TwoScalars& scalars, const Camera& camera,
                              ImageSize size, const MarchSteps& steps, const ReferenceLayers& layers = {});

struct ConvergedImage {
  ReferenceImage image;
  double agreement_db = 0;  // with the one of steps twice as long
};

/// Halves the steps until two successive pictures agree at `agreement_db` or more, six times at the most, and
/// gives the finer one. Where the field knows its crossings, pixels whose
/// neighbourhood has settled are not marched again.
ConvergedImage convergedMarch(const ReferenceField& field, const OpticalFunction& function,
                              const Camera& camera, ImageSize size, MarchSteps steps = {},
                              double agreement_db = 75);

/// The picture over white.
Image toImage(const ReferenceImage& reference);

/// How a picture differs from a reference, which may be of some of its pixels (MarchSteps::every).
ImageDifference compareWithReference(const Image& picture, const Image& reference);

/// The camera of DESIGN.md, "Fidelity": orthographic, on the half-annulus.
Camera halfAnnulusCamera();

}  // namespace curvisplat
