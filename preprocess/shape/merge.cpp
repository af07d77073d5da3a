#include "preprocess/shape/merge.h"

#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <utility>

#include "stream/base/error.h"
#include "stream/model/border_code.h"

namespace curvisplat {
namespace {

constexpr double kSimilar = 0.7;  // cosine: of one plane
// The cosine of two faces that close one another, or of a layer thinner than a voxel. Beyond the -0.5 of the
// sides of a regular hexagon or a triangle, which rounding would decide.
constexpr double kOpposite = -0.55;
constexpr double kEven = 0.9;  // the length of a mean of unit vectors that are about the same
// How far a splat's middle is from a face that it ends at, in its lengths: a box's is 1/2, a wedge's 0.41 or
// 0.82.
constexpr double kNearest = 0.37, kFarthest = 0.85;
constexpr double kTouching = 0.3;  // what part of its section has to

}  // namespace

bool isClosed(const VoxelPlanes::Plane& plane, std::span<const VoxelPlanes::Plane> all) {
  return !plane.face || std::any_of(all.begin(), all.end(), [&](const VoxelPlanes::Plane& other) {
    return glm::dot(other.inward, plane.inward) < kOpposite;
  });
}

void MergedFaces::clear() {
  std::fill(first_.begin(), first_.end(), kNone);
  sums_.clear();
}

void MergedFaces::add(size_t voxel, const glm::dvec3& position, const Splat& splat, uint32_t border_code) {
  const InwardAxes inward = inwardAxes(border_code);
  const glm::dvec3 first(inward.axis[0]);
  if (inward.plate) {
    for (const double side : {1.0, -1.0}) addFace(voxel, position, splat, {side * first, 0.5, true, true});
    return;
  }
  const uint32_t layers = layersOf(border_code);
  for (int a = 0; a < 3; ++a) {
    const glm::dvec3 q(inward.axis[static_cast<size_t>(a)]);
    if ((layers >> a & 1) != 0)
      addFace(voxel, position, splat, {q, layerDistance(0), true, false});
    else if (a < inward.count)
      addFace(voxel, position, splat, {q, inward.distance, inward.hasFace(a), !inward.behind});
  }
}

void MergedFaces::addFace(size_t voxel, const glm::dvec3& position, const Splat& splat,
                          const SplatFace& face) {
  const glm::dvec3 per_length = gradientOf(splat, face.inward);
  const double thickness = 1 / glm::length(per_length);
  if (!(thickness > 0 && std::isfinite(thickness))) return;
  const glm::dvec3 normal = thickness * per_length;
  const double section = splat.weight / thickness;
  Sums* sums = nullptr;
  size_t count = 0;
  for (uint32_t n = first_[voxel]; n != kNone && !sums; n = sums_[n].next, ++count)
    if (glm::dot(sums_[n].inward, normal) > kSimilar * glm::length(sums_[n].inward)) sums = &sums_[n];
  if (!sums) {
    if (count == VoxelPlanes::kMax) return;
    sums = &sums_.emplace_back();
    sums->next = first_[voxel];
    first_[voxel] = static_cast<uint32_t>(sums_.size() - 1);
  }
  sums->inward += section * normal;
  sums->point += section * (position - face.distance * (splat.factor() * face.inward));
  sums->section += section;
  sums->face &= face.cut;
  if (!face.touched) return;
  sums->area += section;
  sums->thickest = std::max(sums->thickest, thickness);
}

VoxelPlanes MergedFaces::of(size_t voxel) const {
  VoxelPlanes found;
  for (uint32_t n = first_[voxel]; n != kNone; n = sums_[n].next) {
    const Sums& sums = sums_[n];
    const double length = glm::length(sums.inward);
    if (!(length > 0)) continue;
    found.planes[found.count++] = {sums.inward / length, sums.point / sums.section, sums.area, sums.thickest,
                                   sums.face && length > kEven * sums.section};
  }
  return found;
}

namespace {

/// Calls use(direction in the splat's frame, distance) for each two opposite faces that the splat fills the room between, until it
/// returns true.
template <typename Use>
void forOppositeFaces(std::span<const VoxelPlanes::Plane> planes, const glm::dvec3& position,
                      const Splat& splat, const Use& use) {
  constexpr double kParallel = -0.9, kCovered = 0.6, kThinner = 0.75, kThicker = 1.33;
  for (size_t n = 0; n < planes.size(); ++n) {
    const auto& a = planes[n];
    for (size_t m = 0; m < n; ++m) {
      const auto& b = planes[m];
      const double apart = glm::dot(a.inward, position - a.point) + glm::dot(b.inward, position - b.point);
      const double cosine = glm::dot(a.inward, b.inward);
      if (!(a.face && b.face && cosine < kParallel)) continue;
      const glm::dvec3 across = glm::normalize(a.inward - b.inward) * splat.factor();
      const double length = glm::length(across);
      if (!(apart > kThinner * length && apart < kThicker * length)) continue;
      if (!(std::min(a.area, b.area) * length > kCovered * splat.weight)) continue;
      if (use(across / length, apart)) return;
    }
  }
}

}  // namespace

std::optional<glm::dvec3> acrossPlate(std::span<const VoxelPlanes::Plane> planes, const glm::dvec3& position,
                                      const Splat& splat) {
  std::optional<glm::dvec3> found;
  forOppositeFaces(planes, position, splat, [&](const glm::dvec3& across, double) {
    found = across;
    return true;
  });
  return found;
}

std::optional<glm::dvec3> acrossLayer(std::span<const VoxelPlanes::Plane> planes, const glm::dvec3& position,
                                      const Splat& splat) {
  constexpr double kClearly = 1.5;
  glm::dvec3 found(0.0);
  double thickness = INFINITY, next = INFINITY;
  forOppositeFaces(planes, position, splat, [&](const glm::dvec3& across, double apart) {
    next = std::min(next, std::max(apart, thickness));
    if (apart < thickness) found = across;
    thickness = std::min(thickness, apart);
    return false;
  });
  return thickness < INFINITY && next > kClearly * thickness ? std::optional(found) : std::nullopt;
}

uint32_t mergedBorderCode(const VoxelPlanes& planes, const glm::dvec3& position, const Splat& merged,
                          double voxel_size) {
  struct Face {
    glm::dvec3 q;  // in the splat's frame
    double distance, area, ratio;
    bool touched;
  };
  std::array<Face, VoxelPlanes::kMax> faces;
  size_t count = 0;
  for (size_t n = 0; n < planes.count; ++n) {
    const auto& plane = planes.planes[n];
    if (isClosed(plane, std::span(planes.planes).first(planes.count))) continue;
    const glm::dvec3 in_frame = plane.inward * merged.factor();
    const double length = glm::length(in_frame), middle = glm::dot(plane.inward, position - plane.point);
    if (!(middle > kNearest * length)) continue;
    const double behind = std::max(voxel_size, 2 * plane.thickest);
    const bool touched = 2 * middle * plane.area > kTouching * merged.weight && middle < kFarthest * length;
    const Face face{in_frame / length, middle / length, plane.area, behind / (2 * middle), touched};
    size_t at = count++;  // the most important first
    for (; at > 0 && std::pair(touched, face.area) > std::pair(faces[at - 1].touched, faces[at - 1].area);
         --at)
      faces[at] = faces[at - 1];
    faces[at] = face;
  }
  if (count == 0) {
    const std::optional<glm::dvec3> across =
        acrossPlate(std::span(planes.planes).first(planes.count), position, merged);
    return across ? packPlateCode(*across) : kNoBorder;
  }
  std::array<glm::dvec3, 3> axes;
  size_t touched = 0;
  for (size_t n = 0; n < count && touched < 3; ++n) {
    if (!faces[n].touched) break;
    glm::dvec3 axis = faces[n].q;
    for (size_t m = 0; m < touched; ++m) axis -= glm::dot(axis, axes[m]) * axes[m];
    if (glm::length(axis) > kSimilar) axes[touched++] = glm::normalize(axis);
  }
  if (touched > 1) return packBorderCode({axes.data(), touched}, (1u << touched) - 1);
  const Face& face = faces[0];
  if (face.touched) return packMergedCode(face.q, face.distance, face.ratio);
  return packLayerCode(face.q, face.distance);
}

namespace {

/// sum += weight v vᵀ
void addSquare(Symmetric3& sum, double weight, const glm::dvec3& v) {
  const double x = weight * v.x, y = weight * v.y, z = weight * v.z;
  sum.xx += x * v.x;
  sum.xy += x * v.y;
  sum.yy += y * v.y;
  sum.xz += x * v.z;
  sum.yz += y * v.z;
  sum.zz += z * v.z;
}

void addScaled(Symmetric3& sum, double factor, const Symmetric3& s) {
  sum.xx += factor * s.xx;
  sum.xy += factor * s.xy;
  sum.yy += factor * s.yy;
  sum.xz += factor * s.xz;
  sum.yz += factor * s.yz;
  sum.zz += factor * s.zz;
}

glm::dvec3 timesFactor(const Splat& splat, const glm::dvec3& w) {
  const auto& [l10, l20, l21] = splat.shear;
  const double v0 = splat.axis[0] * w.x, v1 = splat.axis[1] * w.y;
  return {v0, l10 * v0 + v1, l20 * v0 + l21 * v1 + splat.axis[2] * w.z};
}

/// A⁻¹ h, by forward substitution.
glm::dvec3 solveFactor(const Splat& splat, const glm::dvec3& h) {
  const auto& [l10, l20, l21] = splat.shear;
  const double v0 = h.x, v1 = h.y - l10 * v0, v2 = h.z - l20 * v0 - l21 * v1;
  return {v0 / splat.axis[0], v1 / splat.axis[1], v2 / splat.axis[2]};
}

/// The largest eigenvalue by the roots of the characteristic polynomial, in closed form: 1e-8 at worst (two
/// equal largest ones). Or a bound of it that is not above `least`.
double largestEigenvalue(const Symmetric3& s, double least) {
  const double third = (s.xx + s.yy + s.zz) / 3;
  const double x = s.xx - third, y = s.yy - third, z = s.zz - third;
  const double off2 = s.xy * s.xy + s.xz * s.xz + s.yz * s.yz;
  const double spread = std::sqrt((x * x + y * y + z * z + 2 * off2) / 6);
  if (!(spread > 0)) return third;
  if (third + 2 * spread <= least) return third + 2 * spread;
  const double determinant =
      x * (y * z - s.yz * s.yz) - s.xy * (s.xy * z - s.yz * s.xz) + s.xz * (s.xy * s.yz - y * s.xz);
  const double cosine = std::clamp(determinant / (2 * spread * spread * spread), -1.0, 1.0);
  return third + 2 * spread * std::cos(std::acos(cosine) / 3);
}

/// Gives the splat of a voxel the blur that all of the lattice's have: of the voxel's size, or of the cells'
/// where they are longer; but across the borders. Gradients and means stay.
void blurEvenly(const Symmetric3& cells, double voxel_size, const VoxelPlanes& planes, Splat& splat,
                std::span<SplatScalar> values) {
  constexpr double kBlur = 0.582;  // of the kernel's variance (stretch.h)
  constexpr double kMaxSteeper = 2;
  const Symmetric3 own = shapeMatrix(splat), even = raisedTo(cells, voxel_size * voxel_size);
  glm::dmat3 more(even.xx - own.xx, even.xy - own.xy, even.xz - own.xz, even.xy - own.xy, even.yy - own.yy,
                  even.yz - own.yz, even.xz - own.xz, even.yz - own.yz, even.zz - own.zz);
  for (size_t n = 0; n < planes.count; ++n) {
    const glm::dvec3& q = planes.planes[n].inward;
    const glm::dmat3 along = glm::dmat3(1.0) - glm::outerProduct(q, q);
    more = along * more * along;
  }
  Symmetric3 shape = own;
  addScaled(shape, kBlur, {more[0][0], more[0][1], more[1][1], more[0][2], more[1][2], more[2][2]});
  const double d1 = shape.xx * shape.yy - shape.xy * shape.xy;
  const double d2 = shape.xx * (shape.yy * shape.zz - shape.yz * shape.yz) -
                    shape.xy * (shape.xy * shape.zz - shape.yz * shape.xz) +
                    shape.xz * (shape.xy * shape.yz - shape.yy * shape.xz);
  if (!(shape.xx > 0 && d1 > 0 && d2 > 0)) return;
  const Splat before = splat;
  setShape(splat, shape, splat.axis[0]);
  for (SplatScalar& value : values) {
    // A sliver's scalar, carried on as steeply over a voxel's length, would leave the data's range.
    const double most = kMaxSteeper * glm::length(value.slope);
    value.slope = gradientOf(before, value.slope) * splat.factor();
    const double length = glm::length(value.slope);
    if (length > most) value.slope *= most / length;
  }
}

}  // namespace

VoxelMerger::VoxelMerger(size_t variables, size_t voxels, double spread)
    : variables_(variables),
      spread_(spread),
      clusters_(voxels),
      first_(voxels),
      first_codes_(voxels),
      first_values_(voxels * variables),
      sums_(voxels),
      variable_sums_(voxels * variables),
      faces_(voxels) {}

void VoxelMerger::clear(double voxel_size) {
  std::fill(clusters_.begin(), clusters_.end(), Cluster{});
  faces_.clear();
  voxel_size_ = voxel_size;
}

void VoxelMerger::add(size_t voxel, const glm::dvec3& position, const Splat& splat,
                      std::span<const SplatScalar> values, const SplatCodes& codes) {
  if (voxel_size_ > 0 && codes.border != kNoBorder) faces_.add(voxel, position, splat, codes.border);
  Cluster& cluster = clusters_[voxel];
  SplatScalar* first_values = first_values_.data() + voxel * variables_;
  if (cluster.count++ == 0) {
    first_[voxel] = splat;
    first_[voxel].position = position;
    first_codes_[voxel] = codes;
    std::copy_n(values.data(), variables_, first_values);
    return;
  }
  if (cluster.count == 2) {
    clearSums(voxel);
    accumulate(voxel, first_[voxel].position, first_[voxel], first_values);
  }
  accumulate(voxel, position, splat, values.data());
}

void VoxelMerger::clearSums(size_t voxel) {
  sums_[voxel] = {};
  std::fill_n(variable_sums_.data() + voxel * variables_, variables_, VariableSums{});
}

void VoxelMerger::accumulate(size_t voxel, const glm::dvec3& position, const Splat& splat,
                             const SplatScalar* values) {
  Cluster& cluster = clusters_[voxel];
  if (!cluster.weighted && splat.weight > 0) {
    clearSums(voxel);
    cluster.weighted = true;
  }
  const double weight = cluster.weighted ? splat.weight : 1.0;
  const glm::dvec3 e = position - first_[voxel].position;

  GeometrySums& sums = sums_[voxel];
  sums.weight += weight;
  sums.centre += weight * e;
  addSquare(sums.centre2, weight, e);
  addScaled(sums.shape, weight, shapeMatrix(splat));

  const SplatScalar* first_values = first_values_.data() + voxel * variables_;
  VariableSums* variable_sums = variable_sums_.data() + voxel * variables_;
  for (size_t v = 0; v < variables_; ++v) {
    const SplatScalar& value = values[v];
    const double d = value.mean - first_values[v].mean;
    variable_sums[v].mean += weight * d;
    variable_sums[v].slope += weight * (timesFactor(splat, value.slope) + (12 * d) * e);
    variable_sums[v].variance += weight * (glm::dot(value.slope, value.slope) / 12 + value.variance + d * d);
  }
}

SplatCodes VoxelMerger::finish(size_t voxel, Splat& splat, std::span<SplatScalar> values) const {
  const Splat& first = first_[voxel];
  const SplatScalar* first_values = first_values_.data() + voxel * variables_;
  CURVISPLAT_CHECK_OP(clusters_[voxel].count, >, 0u);
  if (clusters_[voxel].count == 1) {
    splat = first;
    std::copy_n(first_values, variables_, values.data());
    return first_codes_[voxel];
  }
  finishMoments(voxel, splat, values);
  if (!(voxel_size_ > 0)) return {};
  const VoxelPlanes planes = finishInLattice(voxel, splat, values);
  return {mergedBorderCode(planes, splat.position, splat, voxel_size_), kNoGrowth};
}

void VoxelMerger::finishValues(size_t voxel, std::span<SplatScalar> values) const {
  CURVISPLAT_CHECK_OP(clusters_[voxel].count, >, 0u);
  if (clusters_[voxel].count == 1) {
    std::copy_n(first_values_.data() + voxel * variables_, variables_, values.data());
    return;
  }
  Splat splat;
  finishMoments(voxel, splat, values);
  if (voxel_size_ > 0) finishInLattice(voxel, splat, values);
}

void VoxelMerger::finishMoments(size_t voxel, Splat& splat, std::span<SplatScalar> values) const {
  const Splat& first = first_[voxel];
  const SplatScalar* first_values = first_values_.data() + voxel * variables_;
  const GeometrySums& sums = sums_[voxel];
  const double share = 1 / sums.weight;
  const glm::dvec3 centre = share * sums.centre;
  Symmetric3 shape;
  addScaled(shape, share, sums.shape);
  addScaled(shape, spread_ * share, sums.centre2);
  addSquare(shape, -spread_, centre);
  setShape(splat, shape, first.axis[0]);
  splat.position = first.position + centre;
  splat.weight = clusters_[voxel].weighted ? sums.weight : 0.0;

  const VariableSums* variable_sums = variable_sums_.data() + voxel * variables_;
  for (size_t v = 0; v < variables_; ++v) {
    const double mean = share * variable_sums[v].mean;
    const glm::dvec3 h = share * variable_sums[v].slope - (12 * mean) * centre;
    const double t = std::max(0.0, share * variable_sums[v].variance - mean * mean);
    // A slope never explains more than the variance there is; rounding, or a floored axis, may say so.
    glm::dvec3 slope = solveFactor(splat, h);
    const double explained = glm::dot(slope, slope) / 12;
    if (explained > t) slope *= std::sqrt(t / explained);
    values[v] = {first_values[v].mean + mean, slope, std::max(0.0, t - explained)};
  }
}

VoxelPlanes VoxelMerger::finishInLattice(size_t voxel, Splat& splat, std::span<SplatScalar> values) const {
  const VoxelPlanes planes = faces_.of(voxel);
  Symmetric3 cells;
  addScaled(cells, 1 / sums_[voxel].weight, sums_[voxel].shape);
  blurEvenly(cells, voxel_size_, planes, splat, values);
  return planes;
}

double VoxelMerger::detail(size_t voxel, double least) const {
  CURVISPLAT_CHECK_OP(clusters_[voxel].count, >, 0u);
  if (clusters_[voxel].count == 1) return least;
  const GeometrySums& sums = sums_[voxel];
  Symmetric3 covariance;
  addScaled(covariance, 1 / sums.weight, sums.centre2);
  addSquare(covariance, -1, sums.centre / sums.weight);
  constexpr double kBelowOne = 1 - 1e-12;
  const double largest = largestEigenvalue(covariance, kBelowOne * least * least / 12);
  return std::max(least, std::sqrt(12 * std::max(0.0, largest)));
}

}  // namespace curvisplat
