#include "render/project/plane_cuts.h"

#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/vector_relational.hpp>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "render/project/footprint.h"
#include "stream/model/border_code.h"

namespace curvisplat {
namespace {

constexpr auto kSupport = static_cast<float>(kKernelSupport);
constexpr auto kSupportAtBorder = static_cast<float>(kKernelSupport + kMergedReach);  // as it is drawn

/// Aᵀ n: its length is how far the unit sphere's image reaches along n.
glm::vec3 inFrame(const Shape& s, const glm::vec3& n) {
  return {s.axis0 * (n.x + s.shear10 * n.y + s.shear20 * n.z), s.axis1 * (n.y + s.shear21 * n.z),
          s.axis2 * n.z};
}

}  // namespace

bool isUsable(const ClipPlane& plane) {
  const double length = glm::length(plane.normal);
  return length > 1e-100 && std::isfinite(length);
}

std::vector<ClipPlane> clipPlanesOf(std::span<const ClipPlane> planes, const std::optional<WorldBox>& box) {
  std::vector<ClipPlane> all(planes.begin(), planes.end());
  if (!box) return all;
  for (int axis = 0; axis < 3; ++axis) {
    glm::dvec3 normal(0.0);
    normal[axis] = 1;
    all.push_back({box->lower, normal});
    all.push_back({box->upper, -normal});
  }
  return all;
}

WorldBox leftBy(const std::optional<WorldBox>& clip_box, const WorldBox& box) {
  if (!clip_box) return box;
  const WorldBox left{glm::max(box.lower, clip_box->lower), glm::min(box.upper, clip_box->upper)};
  return glm::all(glm::lessThanEqual(left.lower, left.upper)) ? left : box;
}

LocalClipPlanes::LocalClipPlanes(std::span<const ClipPlane> planes, const glm::dvec3& origin) {
  for (const ClipPlane& plane : planes) {
    const glm::dvec3 normal = glm::normalize(plane.normal);
    planes_.push_back({glm::vec3(normal), static_cast<float>(glm::dot(normal, origin - plane.point))});
  }
}

void LocalClipPlanes::sidesOf(const GeometryArrays<const float>& geometry, size_t begin, size_t count,
                              std::span<ClipSide> sides) const {
  std::fill_n(sides.begin(), count, ClipSide::kInside);
  for (const Plane& plane : planes_) {
    const glm::vec3 n = plane.normal;
    for (size_t i = 0; i < count; ++i) {
      const Shape shape = shapeOf(geometry, begin + i);
      const glm::vec3 q = inFrame(shape, n);
      const float distance = n.x * geometry.x[begin + i] + n.y * geometry.y[begin + i] +
                             n.z * geometry.z[begin + i] + plane.offset;
      const float support = geometry.border_code[begin + i] == kNoBorder ? kSupport : kSupportAtBorder;
      const float reach = support * std::sqrt(q.x * q.x + q.y * q.y + q.z * q.z);
      const ClipSide side = distance >= reach   ? ClipSide::kInside
                            : distance > -reach ? ClipSide::kAcross
                                                : ClipSide::kOutside;
      sides[i] = std::max(sides[i], side);
    }
  }
}

bool LocalClipPlanes::contains(const glm::vec3& point) const {
  return std::all_of(planes_.begin(), planes_.end(),
                     [&](const Plane& plane) { return glm::dot(plane.normal, point) + plane.offset >= 0; });
}

void LocalClipPlanes::addFaces(SplatPiece& piece) const {
  for (const Plane& plane : planes_) {
    const glm::vec3 q = inFrame(piece.shape, plane.normal);
    const float length = glm::length(q);
    if (!(length > 0)) continue;
    const float distance = (glm::dot(plane.normal, piece.position) + plane.offset) / length;
    if (distance < kSupport) piece.faces.add({q / length, distance});
  }
}

namespace {

constexpr auto kSigma = static_cast<float>(kKernelSigma);

/// B's rows, and what every linear field along the ray needs of them.
struct RayFrame {
  glm::vec3 b0, b1;
  glm::vec3 along;  // the ray, away from the viewer
  float s00, s11, nn, low_pass, determinant;

  RayFrame(const ScreenRows& rows, const Shape& s, float low_pass_px2)
      : b0(s.axis0 * (rows.x0 + rows.y0 * s.shear10 + rows.z0 * s.shear20),
           s.axis1 * (rows.y0 + rows.z0 * s.shear21), s.axis2 * rows.z0),
        b1(s.axis0 * (rows.x1 + rows.y1 * s.shear10 + rows.z1 * s.shear20),
           s.axis1 * (rows.y1 + rows.z1 * s.shear21), s.axis2 * rows.z1),
        along(glm::cross(b0, b1)),
        s00(glm::dot(b0, b0)),
        s11(glm::dot(b1, b1)),
        nn(glm::dot(along, along)),
        low_pass(low_pass_px2),
        determinant(nn + low_pass_px2 * (s00 + s11 + low_pass_px2)) {}

  /// A field that changes by q: its change a pixel, the part of its variance that is along the ray, and q's
  /// part in the ray's direction.
  struct Field {
    float g0, g1, hidden, along;
  };
  Field fieldOf(const glm::vec3& q) const {
    const float h0 = glm::dot(b0, q), h1 = glm::dot(b1, q), nq = glm::dot(along, q);
    const glm::vec3 m = glm::cross(along, q), c0 = glm::cross(b0, q), c1 = glm::cross(b1, q);
    return {(glm::dot(b1, m) + low_pass * h0) / determinant, (low_pass * h1 - glm::dot(b0, m)) / determinant,
            (low_pass * (low_pass * glm::dot(q, q) + glm::dot(c0, c0) + glm::dot(c1, c1)) + nq * nq) /
                determinant,
            nq};
  }

  /// The correlation of the scalar with a field that has `steepness` of its deviation along the ray. Where
  /// the ellipse is a line to float's precision, the ray's direction is noise (ellipseOf() in footprint.h).
  float correlation(const Slope& w, const Ellipse& ellipse, float steepness) const {
    if (!(nn > 1e-8f * s00 * s11 && ellipse.half_width > 0)) return 0;
    const float deviation = kSigma * glm::dot({w.w0, w.w1, w.w2}, along) / std::sqrt(nn);
    return std::clamp(steepness * deviation * std::numbers::sqrt3_v<float> / ellipse.half_width, -1.0f, 1.0f);
  }
};

}  // namespace

Remains cutAtFaces(const ScreenRows& rows, const SplatPiece& piece, const Ellipse& ellipse,
                   float low_pass_px2, ScreenCut& cut) {
  if (piece.faces.count == 0) return Remains::kAll;
  const RayFrame ray(rows, piece.shape, low_pass_px2);

  // A face's distance varies along the ray by this part of its variance in the splat: 1 is seen face-on.
  // What the next layer's splats have behind a face (a hundredth of their weight) shows only beside its
  // edges.
  constexpr float kLowAngle = 0.5f;
  // Those that take most, where there are more than a ScreenCut holds.
  struct NearestFace {
    float nearest;  // deviations from the middle, over the footprint
    std::array<float, 3> at;
    bool far_side;
    float along_ray;  // how much of the face's deviation is along the ray
  };
  std::array<NearestFace, ScreenCut::kFaces> taking;
  size_t count = 0;
  for (const CutFace& face : piece.faces) {
    const RayFrame::Field field = ray.fieldOf(face.inward);
    if (face.edge_on && field.hidden > kLowAngle) continue;
    const float deviation = std::sqrt(field.hidden);
    const float inverse = 1 / (kSigma * deviation);
    const float a = inverse * face.distance;
    const float by0 = inverse * (ellipse.l11 * field.g0 + ellipse.l21 * field.g1);
    const float by1 = inverse * ellipse.l22 * field.g1;
    const float spread = kSupport * std::sqrt(by0 * by0 + by1 * by1);
    if (a + spread <= -ScreenCut::kReach) return Remains::kNothing;
    if (a - spread >= ScreenCut::kReach) continue;
    const NearestFace found{a - spread,
                            {a, by0, by1},
                            field.along > 0,
                            std::abs(field.along) / (std::sqrt(ray.determinant) * deviation)};
    if (count < taking.size()) {
      taking[count++] = found;
      continue;
    }
    NearestFace& least = *std::max_element(
        taking.begin(), taking.end(),
        [](const NearestFace& one, const NearestFace& other) { return one.nearest < other.nearest; });
    if (found.nearest < least.nearest) least = found;
  }
  float steepest = 0;
  for (size_t n = 0; n < count; ++n) {
    cut.faces[n] = taking[n].at;
    if (taking[n].far_side) cut.far_sides |= 1u << n;
    steepest = std::max(steepest, taking[n].along_ray);
  }
  if (count == 0) return Remains::kAll;

  cut.correlation = ray.correlation(piece.slope, ellipse, steepest);
  return Remains::kSome;
}

DepthsLeft DepthsLeft::atCentre(const ScreenCut& cut) {
  float lo = -1, hi = 1;
  for (size_t n = 0; n < ScreenCut::kFaces; ++n) {
    const float at = cut.faces[n][0] / ScreenCut::kReach;
    if (cut.far_sides >> n & 1)
      lo = std::max(lo, -at);
    else
      hi = std::min(hi, at);
  }
  // The biweight's integrals from 0 to x, of 1, of -32/5 x, and of x squared.
  const auto integralsTo = [](float x) {
    const float x2 = x * x, rest = 1 - x2;
    return glm::vec3(x * (0.9375f + x2 * (-0.625f + 0.1875f * x2)), rest * rest * rest,
                     x * x2 * (0.3125f + x2 * (-0.375f + (0.9375f / 7) * x2)));
  };
  const glm::vec3 left = integralsTo(std::min(hi, 1.0f)) - integralsTo(std::min(lo, 1.0f));
  if (!(left.x > 1e-6f)) return {0, 0};
  const float mean = -5.0f / 32 * left.y / left.x, variance = left.z / left.x - mean * mean;
  return {left.x, std::sqrt(std::clamp(7 * variance, 0.0f, 1.0f))};
}

float shareOfAlong(const ScreenRows& rows, const SplatPiece& piece, float low_pass_px2) {
  const float across2 = glm::dot(piece.across, piece.across);
  if (!(across2 > 0)) return 1;
  const RayFrame ray(rows, piece.shape, low_pass_px2);
  const float facing = glm::dot(ray.along, piece.across), facing2 = facing * facing;
  const float tangent2 = (ray.nn * across2 - facing2) / facing2;
  const float tangent = std::sqrt(std::max(0.0f, tangent2) * ray.determinant / ray.nn);
  const float share = 1 - kPlatesBehind * std::max(0.0f, tangent - kPlatesFrom);
  return share > 0 ? share : 0.0f;  // of NaN, too
}

ScreenDepth depthAlongRay(const ScreenRows& rows, const glm::vec3& depth_row, float depth,
                          const SplatPiece& piece, const Ellipse& ellipse, float low_pass_px2) {
  const RayFrame ray(rows, piece.shape, low_pass_px2);
  const Shape& s = piece.shape;
  const RayFrame::Field field =
      ray.fieldOf({s.axis0 * (depth_row.x + depth_row.y * s.shear10 + depth_row.z * s.shear20),
                   s.axis1 * (depth_row.y + depth_row.z * s.shear21), s.axis2 * depth_row.z});
  constexpr float kMaxPerDepth = 1e30f;
  ScreenDepth out;
  out.middle = depth;
  out.by = {ellipse.l11 * field.g0 + ellipse.l21 * field.g1, ellipse.l22 * field.g1};
  out.per_depth = std::min(1 / (kSigma * std::sqrt(field.hidden)), kMaxPerDepth);
  const float deviation = std::sqrt(ray.determinant * field.hidden);
  out.correlation = ray.correlation(piece.slope, ellipse, deviation > 0 ? field.along / deviation : 0);
  return out;
}

}  // namespace curvisplat
