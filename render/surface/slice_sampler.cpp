#include "render/surface/slice_sampler.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>

#include "render/project/footprint.h"
#include "render/project/splat_pieces.h"
#include "stream/model/corrections.h"

namespace curvisplat {
namespace {

constexpr double kFixed = 4294967296.0;  // of the sums
// How much of a splat's own gradient counts. Among 1, 0.9 and 0.5 this is best on merged levels, whose means
// are over their cells.
constexpr double kOwn = 0.9;
constexpr double kMax = 1e5;           // pixels, or ranges of the scalar a pixel
constexpr double kMaxRatio = 1000;     // of V to √det S: beyond it a splat is degenerate
constexpr double kSeenAtLeast = 1e-6;  // of the plane's normal along a ray
// Sums of weights: inside the data they add up to 1, to within a tenth; at an end without a face to half of
// that.
constexpr double kOutside = 0.25, kInside = 0.5;

void addTo(int64_t& sum, double value) {
  std::atomic_ref<int64_t>(sum).fetch_add(static_cast<int64_t>(std::llrint(kFixed * value)),
                                          std::memory_order_relaxed);
}

/// A⁻¹ x.
glm::dvec3 inFrame(const Shape& s, const glm::dvec3& x) {
  const double a0 = s.axis0, a1 = s.axis1;
  const double u0 = x.x / a0;
  const double u1 = (x.y - a0 * s.shear10 * u0) / a1;
  return {u0, u1, (x.z - a0 * s.shear20 * u0 - a1 * s.shear21 * u1) / s.axis2};
}

/// A x.
glm::dvec3 inSpace(const Shape& s, const glm::dvec3& u) {
  const double a0 = s.axis0 * u.x, a1 = s.axis1 * u.y;
  return {a0, a0 * s.shear10 + a1, a0 * s.shear20 + a1 * s.shear21 + s.axis2 * u.z};
}

/// A⁻ᵀ w.
glm::dvec3 gradientOf(const Shape& s, const Slope& w) {
  const double z = double{w.w2} / s.axis2, y = double{w.w1} / s.axis1 - s.shear21 * z;
  return {double{w.w0} / s.axis0 - s.shear10 * y - s.shear20 * z, y, z};
}

double perLengthOf(const ScreenView& view, const glm::dvec3& point) {
  const double largest = std::max({view.scale.x, view.scale.y, view.scale.z});
  if (view.projection != Projection::kPerspective) return view.focal_px * largest;
  return view.focal_px * largest / std::max(glm::length(view.viewFromData(point)), view.near);
}

/// c0 + c1 x + c2 y.
struct Affine {
  double c0, c1, c2;
};

/// How far a plane reaches, in the frame of a splat: |Aᵀ n|.
float reachAlong(const Shape& s, const glm::vec3& n) {
  return glm::length(glm::vec3(s.axis0 * (n.x + s.shear10 * n.y + s.shear20 * n.z),
                               s.axis1 * (n.y + s.shear21 * n.z), s.axis2 * n.z));
}

/// The pixels of a line between the roots of a x² + 2 b x + c <= 0; all from first to last where a <= 0.
bool between(double a, double b, double c, int& first, int& last) {
  if (!(a > 0)) return first <= last;
  const double discriminant = b * b - a * c;
  if (!(discriminant >= 0)) return false;
  const double root = std::sqrt(discriminant);
  const double from = std::ceil((-b - root) / a), to = std::floor((-b + root) / a);
  if (!(from <= last && to >= first)) return false;
  first = static_cast<int>(std::max<double>(from, first));
  last = static_cast<int>(std::min<double>(to, last));
  return first <= last;
}

/// How much of a splat's own gradient counts, and how much of the common one.
double ownShare(const SliceCorrections& corrections) {
  if (!corrections.slopes) return 0;
  return corrections.common_gradient ? kOwn : 1;
}
double commonShare(const SliceCorrections& corrections) {
  return corrections.slopes && corrections.common_gradient ? 1 - kOwn : 0;
}

}  // namespace

SliceSampler::SliceSampler(const ScreenView& view, const ClipPlane& plane, double low, double high,
                           const BorderStyle& borders)
    : view_(view),
      plane_{plane.point, glm::normalize(plane.normal)},
      low_(low),
      per_range_(high > low ? 1 / (high - low) : 0),
      per_length_(perLengthOf(view, plane.point)),
      borders_(borders),
      own_(ownShare(correctionsToMake().slices)),
      common_(commonShare(correctionsToMake().slices)),
      sums_(view.size.pixels()) {
  const Hit middle = hitOf(0.5 * view.size.width, 0.5 * view.size.height);
  // In perspective some pixels may see a plane that the middle sees edge-on.
  seen_ = view.projection == Projection::kPerspective || std::abs(middle.inverse) > 0;
}

void SliceSampler::addOthers(Ranks& ranks) {
  constexpr size_t kNumbers = 9;
  static_assert(sizeof(Sums) == kNumbers * sizeof(int64_t));
  ranks.sum(std::span(&sums_.data()->weight, kNumbers * sums_.size()));
  int64_t touched = touched_;
  ranks.sum(std::span(&touched, 1));
  touched_ = touched > 0;
}

/// Orthographic: `direction` is where the ray meets the plane, `inverse` 1, or 0 where it does not.
SliceSampler::Hit SliceSampler::hitOf(double x, double y) const {
  const double a = (x - 0.5 * view_.size.width) / view_.focal_px,
               b = (y - 0.5 * view_.size.height) / view_.focal_px;
  const glm::dvec3 eye = view_.eye / view_.scale;
  const double distance = glm::dot(plane_.normal, plane_.point - eye);
  if (view_.projection == Projection::kPerspective) {
    const glm::dvec3 direction = (view_.forward + a * view_.right + b * view_.down) / view_.scale;
    return {direction, distance != 0 ? glm::dot(plane_.normal, direction) / distance : 0};
  }
  const glm::dvec3 forward = view_.forward / view_.scale;
  const double along = glm::dot(plane_.normal, forward);
  if (!(std::abs(along) > kSeenAtLeast * glm::length(forward))) return {glm::dvec3(0.0), 0};
  const glm::dvec3 from = (a * view_.right + b * view_.down) / view_.scale;
  return {eye + from + (distance - glm::dot(plane_.normal, from)) / along * forward, 1};
}

void SliceSampler::add(const glm::dvec3& cell_min, const GeometryArrays<const float>& geometry,
                       const VariableArrays<const float>& variable, std::span<const SplatRange> ranges) {
  const glm::vec3 n(plane_.normal);
  const auto offset = static_cast<float>(glm::dot(plane_.normal, cell_min - plane_.point));
  for (const SplatRange& range : ranges)
    for (size_t i = range.begin; i < range.end; ++i) {
      const Shape shape = shapeOf(geometry, i);
      const float distance = n.x * geometry.x[i] + n.y * geometry.y[i] + n.z * geometry.z[i] + offset;
      const uint32_t border_code = geometry.border_code[i];
      const auto support = static_cast<float>(kKernelSupport + (border_code == kNoBorder ? 0 : kMergedReach));
      if (!(std::abs(distance) < support * reachAlong(shape, n))) continue;
      const SplatPiece whole{{geometry.x[i], geometry.y[i], geometry.z[i]},
                             shape,
                             slopeOf(variable, i),
                             variable.mean[i],
                             geometry.weight[i]};
      if (border_code == kNoBorder) {
        addPiece(cell_min, whole);
        continue;
      }
      BorderPieces parts;
      const size_t count = partsAtBorder(whole, border_code, borders_, parts);
      for (size_t part = 0; part < count; ++part) addPiece(cell_min, parts[part]);
    }
}

void SliceSampler::addPiece(const glm::dvec3& cell_min, const SplatPiece& piece) {
  const Shape& s = piece.shape;
  const double ratio =
      static_cast<double>(piece.weight) / (double{s.axis0} * double{s.axis1} * double{s.axis2});
  if (!(ratio > 0 && std::isfinite(ratio))) return;
  const glm::dvec3 centre = cell_min + glm::dvec3(piece.position);
  const bool perspective = view_.projection == Projection::kPerspective;
  const glm::dvec3 in_view = view_.viewFromData(centre);
  const int width = view_.size.width, height = view_.size.height;
  // Pixels are counted from the splat's own, which keeps the digits of thin splats.
  glm::dvec2 own(0.5 * width, 0.5 * height);
  if (!perspective || in_view.z > view_.near) own = view_.pixelFromView(in_view);
  const double middle_x = std::floor(std::clamp<double>(own.x, -1e6, 1e6));
  const double middle_y = std::floor(std::clamp<double>(own.y, -1e6, 1e6));

  // u = v / w, both affine in the pixel.
  const Hit hits[3] = {hitOf(middle_x + 0.5, middle_y + 0.5), hitOf(middle_x + 1.5, middle_y + 0.5),
                       hitOf(middle_x + 0.5, middle_y + 1.5)};
  const glm::dvec3 from_eye = perspective ? view_.eye / view_.scale - centre : -centre;
  glm::dvec3 v[3];
  for (int n = 0; n < 3; ++n) v[n] = inFrame(s, hits[n].direction + hits[n].inverse * from_eye);
  const glm::dvec3 vx = v[1] - v[0], vy = v[2] - v[0];
  const Affine w{hits[0].inverse, hits[1].inverse - hits[0].inverse, hits[2].inverse - hits[0].inverse};
  constexpr double kSupport2 = kKernelSupport * kKernelSupport;
  // |v|² - support² w² <= 0
  const double xx = glm::dot(vx, vx) - kSupport2 * w.c1 * w.c1,
               xy = glm::dot(vx, vy) - kSupport2 * w.c1 * w.c2;
  const double yy = glm::dot(vy, vy) - kSupport2 * w.c2 * w.c2,
               x1 = glm::dot(vx, v[0]) - kSupport2 * w.c1 * w.c0;
  const double y1 = glm::dot(vy, v[0]) - kSupport2 * w.c2 * w.c0,
               one = glm::dot(v[0], v[0]) - kSupport2 * w.c0 * w.c0;
  const auto dx = static_cast<int>(middle_x), dy = static_cast<int>(middle_y);
  int first_row = -dy, last_row = height - 1 - dy;
  // Rows for which the quadratic in x has roots.
  if (xx > 0 && xx * yy - xy * xy > 0 &&
      !between(yy - xy * xy / xx, y1 - x1 * xy / xx, one - x1 * x1 / xx, first_row, last_row))
    return;
  const glm::dvec3 gradient = gradientOf(s, piece.slope) * (per_range_ / per_length_);
  bool touched = false;
  for (int row = first_row; row <= last_row; ++row) {
    int first = -dx, last = width - 1 - dx;
    if (!between(xx, x1 + xy * row, one + (2 * y1 + yy * row) * row, first, last)) continue;
    Sums* sums =
        &sums_[static_cast<size_t>(row + dy) * static_cast<size_t>(width) + static_cast<size_t>(first + dx)];
    for (int x = first; x <= last; ++x, ++sums) {
      const double inverse = w.c0 + w.c1 * x + w.c2 * row;
      if (!(inverse > 0)) continue;
      const glm::dvec3 u = (v[0] + static_cast<double>(x) * vx + static_cast<double>(row) * vy) / inverse;
      const double r2 = glm::dot(u, u);
      if (!(r2 < kSupport2)) continue;
      const double weight = std::min(ratio, kMaxRatio) * kernel(std::sqrt(r2));
      const double change =
          double{piece.slope.w0} * u.x + double{piece.slope.w1} * u.y + double{piece.slope.w2} * u.z;
      const glm::dvec3 moved = per_length_ * inSpace(s, u);
      double inside = 1;
      for (const CutFace& face : piece.faces) {
        const glm::dvec3 q(face.inward);
        const double a_pixel = std::hypot(glm::dot(q, vx - w.c1 * u), glm::dot(q, vy - w.c2 * u)) / inverse;
        const double distance = glm::dot(q, u) + double{face.distance};
        inside *= std::clamp(0.5 + distance / std::max(a_pixel, 1e-30), 0.0, 1.0);
      }
      addTo(sums->weight, weight);
      addTo(sums->scalar,
            weight * std::clamp((double{piece.mean} + own_ * change - low_) * per_range_, -1.0, 2.0));
      for (int axis = 0; axis < 3; ++axis) {
        const auto n = static_cast<size_t>(axis);
        addTo(sums->moved[n], weight * std::clamp(moved[axis], -kMax, kMax));
        addTo(sums->gradient[n], weight * std::clamp(gradient[axis], -kMax, kMax));
      }
      if (inside < 1) addTo(sums->outside, weight * (1 - inside));
      touched = true;
    }
  }
  if (touched) touched_.store(true, std::memory_order_relaxed);
}

std::optional<SliceSampler::Sample> SliceSampler::at(int x, int y, double depth_origin) const {
  const Sums& sums =
      sums_[static_cast<size_t>(y) * static_cast<size_t>(view_.size.width) + static_cast<size_t>(x)];
  const double weight = static_cast<double>(sums.weight) / kFixed;
  if (!(weight > kOutside)) return std::nullopt;
  const double kept = 1 - static_cast<double>(sums.outside) / static_cast<double>(sums.weight);
  const double coverage = kept * std::min(1.0, (weight - kOutside) / (kInside - kOutside));
  if (!(coverage > 1e-3)) return std::nullopt;
  const Hit hit = hitOf(x + 0.5, y + 0.5);
  const bool perspective = view_.projection == Projection::kPerspective;
  const glm::dvec3 at = perspective ? view_.eye / view_.scale + hit.direction / hit.inverse : hit.direction;
  const glm::dvec3 in_view = view_.viewFromData(at);
  if (perspective && in_view.z < view_.near) return std::nullopt;
  const double depth = perspective ? glm::length(in_view) : in_view.z - depth_origin;
  const auto meanOf = [&](int64_t sum) {
    return static_cast<double>(sum) / static_cast<double>(sums.weight);
  };
  double scalar = meanOf(sums.scalar);
  for (size_t axis = 0; axis < 3; ++axis)
    scalar += common_ * meanOf(sums.gradient[axis]) * meanOf(sums.moved[axis]);
  return Sample{low_ + (per_range_ > 0 ? scalar / per_range_ : 0), static_cast<float>(coverage),
                static_cast<float>(depth), at};
}

}  // namespace curvisplat
