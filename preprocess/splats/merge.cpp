#include "preprocess/splats/merge.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>

#include "stream/base/check.h"

namespace curvisplat {
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

glm::dvec3 times(const Symmetric3& s, const glm::dvec3& v) {
  return {s.xx * v.x + s.xy * v.y + s.xz * v.z, s.xy * v.x + s.yy * v.y + s.yz * v.z,
          s.xz * v.x + s.yz * v.y + s.zz * v.z};
}

/// A C Aᵀ.
Symmetric3 shapeMatrix(const Splat& splat, const Symmetric3& c) {
  const glm::dvec3 x = timesFactor(splat, {c.xx, c.xy, c.xz});  // the columns of A C
  const glm::dvec3 y = timesFactor(splat, {c.xy, c.yy, c.yz});
  const glm::dvec3 z = timesFactor(splat, {c.xz, c.yz, c.zz});
  const auto [a00, a11, a22] = splat.axis;
  const double a10 = a00 * splat.shear[0], a20 = a00 * splat.shear[1], a21 = a11 * splat.shear[2];
  return {a00 * x.x,
          a00 * x.y,
          a10 * x.y + a11 * y.y,
          a00 * x.z,
          a10 * x.z + a11 * y.z,
          a20 * x.z + a21 * y.z + a22 * z.z};
}

/// By the roots of the characteristic polynomial, in closed form: 1e-8 at worst (two equal largest ones).
double largestEigenvalue(const Symmetric3& s) {
  const double third = (s.xx + s.yy + s.zz) / 3;
  const double x = s.xx - third, y = s.yy - third, z = s.zz - third;
  const double off2 = s.xy * s.xy + s.xz * s.xz + s.yz * s.yz;
  const double spread = std::sqrt((x * x + y * y + z * z + 2 * off2) / 6);
  if (!(spread > 0)) return third;
  const double determinant =
      x * (y * z - s.yz * s.yz) - s.xy * (s.xy * z - s.yz * s.xz) + s.xz * (s.xy * s.yz - y * s.xz);
  const double cosine = std::clamp(determinant / (2 * spread * spread * spread), -1.0, 1.0);
  return third + 2 * spread * std::cos(std::acos(cosine) / 3);
}

}  // namespace

VoxelMerger::VoxelMerger(size_t variables, size_t voxels, double spread)
    : variables_(variables),
      spread_(spread),
      clusters_(voxels),
      first_(voxels),
      first_values_(voxels * variables),
      sums_(voxels),
      variable_sums_(voxels * variables) {}

void VoxelMerger::clear() {
  std::fill(clusters_.begin(), clusters_.end(), Cluster{});
}

void VoxelMerger::add(size_t voxel, const glm::dvec3& position, const Splat& splat,
                      std::span<const SplatScalar> values) {
  Cluster& cluster = clusters_[voxel];
  if (cluster.count++ == 0) {
    first_[voxel] = splat;
    first_[voxel].position = position;
    std::copy_n(values.data(), variables_, first_values_.data() + voxel * variables_);
    cluster.pending = true;
    return;
  }
  accumulatePending(voxel);
  accumulate(voxel, position, splat, values.data());
}

void VoxelMerger::addPieces(size_t voxel, PieceSet pieces, const glm::dvec3& position, const Splat& splat,
                            std::span<const SplatScalar> values) {
  if (pieces == kAllPieces) return add(voxel, position, splat, values);
  const PieceGroup& group = pieceGroup(pieces);
  const Symmetric3 whole_shape = shapeMatrix(splat), shape = shapeMatrix(splat, group.shape);
  const glm::dvec3 centre = position + timesFactor(splat, group.mean);
  Cluster& cluster = clusters_[voxel];
  if (cluster.count++ == 0) {
    first_[voxel].position = centre;
    first_[voxel].axis[0] = splat.axis[0];
    for (size_t v = 0; v < variables_; ++v)
      first_values_[voxel * variables_ + v].mean = values[v].mean + glm::dot(values[v].slope, group.mean);
    clearSums(voxel);
  }
  accumulatePending(voxel);
  accumulateMoments(voxel, centre, group.share * splat.weight, group.share, shape,
                    [&](size_t v) {
                      const auto& [mean, slope, variance] = values[v];
                      const glm::dvec3 in_group = times(group.shape, slope);
                      return SplatScalar{mean + glm::dot(slope, group.mean), timesFactor(splat, in_group),
                                         glm::dot(slope, in_group) / 12 + variance};
                    });
  const double weight = cluster.weighted ? group.share * splat.weight : group.share;
  addScaled(sums_[voxel].beyond, weight, whole_shape);
  addScaled(sums_[voxel].beyond, -weight, shape);
}

void VoxelMerger::clearSums(size_t voxel) {
  sums_[voxel] = {};
  std::fill_n(variable_sums_.data() + voxel * variables_, variables_, VariableSums{});
}

void VoxelMerger::accumulatePending(size_t voxel) {
  if (!clusters_[voxel].pending) return;
  clusters_[voxel].pending = false;
  clearSums(voxel);
  accumulate(voxel, first_[voxel].position, first_[voxel], first_values_.data() + voxel * variables_);
}

void VoxelMerger::accumulate(size_t voxel, const glm::dvec3& position, const Splat& splat,
                             const SplatScalar* values) {
  accumulateMoments(voxel, position, splat.weight, 1, shapeMatrix(splat), [&](size_t v) {
    const auto& [mean, slope, variance] = values[v];
    return SplatScalar{mean, timesFactor(splat, slope), glm::dot(slope, slope) / 12 + variance};
  });
}

template <typename ValueOf>
void VoxelMerger::accumulateMoments(size_t voxel, const glm::dvec3& position, double weight, double share,
                                    const Symmetric3& shape, const ValueOf& value_of) {
  Cluster& cluster = clusters_[voxel];
  if (!cluster.weighted && weight > 0) {
    clearSums(voxel);
    cluster.weighted = true;
  }
  if (!cluster.weighted) weight = share;
  const glm::dvec3 e = position - first_[voxel].position;

  GeometrySums& sums = sums_[voxel];
  sums.weight += weight;
  sums.centre += weight * e;
  addSquare(sums.centre2, weight, e);
  addScaled(sums.shape, weight, shape);

  const SplatScalar* first_values = first_values_.data() + voxel * variables_;
  VariableSums* variable_sums = variable_sums_.data() + voxel * variables_;
  for (size_t v = 0; v < variables_; ++v) {
    const SplatScalar value = value_of(v);
    const double d = value.mean - first_values[v].mean;
    variable_sums[v].mean += weight * d;
    variable_sums[v].slope += weight * (value.slope + (12 * d) * e);
    variable_sums[v].variance += weight * (value.variance + d * d);
  }
}

void VoxelMerger::finish(size_t voxel, Splat& splat, std::span<SplatScalar> values) const {
  const Splat& first = first_[voxel];
  const SplatScalar* first_values = first_values_.data() + voxel * variables_;
  CURVISPLAT_CHECK_OP(clusters_[voxel].count, >, 0u);
  if (clusters_[voxel].pending) {
    splat = first;
    std::copy_n(first_values, variables_, values.data());
    return;
  }

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

double VoxelMerger::detail(size_t voxel) const {
  CURVISPLAT_CHECK_OP(clusters_[voxel].count, >, 0u);
  if (clusters_[voxel].pending) return 0;
  const GeometrySums& sums = sums_[voxel];
  Symmetric3 beyond;  // 12 x the covariance of the centres, less what pieces are smaller than splats
  addScaled(beyond, 12 / sums.weight, sums.centre2);
  addSquare(beyond, -12, sums.centre / sums.weight);
  addScaled(beyond, -1 / sums.weight, sums.beyond);
  return std::sqrt(std::max(0.0, largestEigenvalue(beyond)));
}

}  // namespace curvisplat
