#include "render/project/face_cut.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <numbers>

#include "render/project/kernel.h"

namespace curvisplat {

Remains cutAtFaces(const ScreenRows& rows, const SplatPiece& piece, const Ellipse& ellipse,
                   float low_pass_px2, ScreenCut& cut) {
  if (piece.faces.count == 0) return Remains::kAll;
  constexpr auto kSigma = static_cast<float>(kKernelSigma);
  constexpr auto kSupport = static_cast<float>(kKernelSupport);
  const Shape& s = piece.shape;
  const glm::vec3 b0(s.axis0 * (rows.x0 + rows.y0 * s.shear10 + rows.z0 * s.shear20),
                     s.axis1 * (rows.y0 + rows.z0 * s.shear21), s.axis2 * rows.z0);
  const glm::vec3 b1(s.axis0 * (rows.x1 + rows.y1 * s.shear10 + rows.z1 * s.shear20),
                     s.axis1 * (rows.y1 + rows.z1 * s.shear21), s.axis2 * rows.z1);
  const float s00 = glm::dot(b0, b0), s11 = glm::dot(b1, b1);
  const glm::vec3 along = glm::cross(b0, b1);  // the ray, away from the viewer
  const float nn = glm::dot(along, along);
  const float determinant = nn + low_pass_px2 * (s00 + s11 + low_pass_px2);

  // A face's distance varies along the ray by this part of its variance in the splat: 1 is seen face-on. What
  // the next layer's splats have behind a face (a hundredth of their weight) shows only beside its edges.
  constexpr float kLowAngle = 0.5f;
  // Those that take most, where there are more than a ScreenCut holds.
  struct Taking {
    float nearest;  // deviations from the middle, over the footprint
    std::array<float, 3> at;
    bool far_side;
    float along_ray;  // how much of the face's deviation is along the ray
  };
  std::array<Taking, ScreenCut::kFaces> taking;
  size_t count = 0;
  for (const CutFace& face : piece.faces) {
    const glm::vec3& q = face.inward;
    const float h0 = glm::dot(b0, q), h1 = glm::dot(b1, q), nq = glm::dot(along, q);
    const glm::vec3 m = glm::cross(along, q), c0 = glm::cross(b0, q), c1 = glm::cross(b1, q);
    const float g0 = (glm::dot(b1, m) + low_pass_px2 * h0) / determinant;
    const float g1 = (low_pass_px2 * h1 - glm::dot(b0, m)) / determinant;
    const float hidden =
        (low_pass_px2 * (low_pass_px2 + glm::dot(c0, c0) + glm::dot(c1, c1)) + nq * nq) / determinant;
    if (face.edge_on && hidden > kLowAngle) continue;
    const float deviation = std::sqrt(hidden);
    const float inverse = 1 / (kSigma * deviation);
    const float a = inverse * face.distance;
    const float by0 = inverse * (ellipse.l11 * g0 + ellipse.l21 * g1), by1 = inverse * ellipse.l22 * g1;
    const float spread = kSupport * std::sqrt(by0 * by0 + by1 * by1);
    if (a + spread <= -ScreenCut::kReach) return Remains::kNothing;
    if (a - spread >= ScreenCut::kReach) continue;
    const Taking found{
        a - spread, {a, by0, by1}, nq > 0, std::abs(nq) / (std::sqrt(determinant) * deviation)};
    if (count < taking.size()) {
      taking[count++] = found;
      continue;
    }
    Taking& least =
        *std::max_element(taking.begin(), taking.end(),
                          [](const Taking& one, const Taking& other) { return one.nearest < other.nearest; });
    if (found.nearest < least.nearest) least = found;
  }
  float steepest = 0;
  for (size_t n = 0; n < count; ++n) {
    cut.faces[n] = taking[n].at;
    if (taking[n].far_side) cut.far_sides |= 1u << n;
    steepest = std::max(steepest, taking[n].along_ray);
  }
  if (count == 0) return Remains::kAll;

  // Where the ellipse is a line to float's precision, the ray's direction is noise (splat_ellipse.h).
  if (nn > 1e-8f * s00 * s11 && ellipse.half_width > 0) {
    const Slope& w = piece.slope;
    const float deviation = kSigma * glm::dot({w.w0, w.w1, w.w2}, along) / std::sqrt(nn);
    cut.correlation =
        std::clamp(steepest * deviation * std::numbers::sqrt3_v<float> / ellipse.half_width, -1.0f, 1.0f);
  }
  return Remains::kSome;
}

}  // namespace curvisplat
