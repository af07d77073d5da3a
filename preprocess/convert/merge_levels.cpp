#include "preprocess/convert/merge_levels.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "stream/base/check.h"

namespace curvisplat {
namespace {

constexpr int kOctantBits = kLatticeBits - 1;  // voxels along an edge of a child's cell
constexpr size_t kOctantVoxels = size_t{1} << (3 * kOctantBits);
constexpr uint64_t kOctantMask = (uint64_t{1} << kOctantBits) - 1;

}  // namespace

OctantMerger::OctantMerger(const RootCube& root, size_t variables, bool even)
    : root_(root),
      variables_(variables),
      even_(even),
      unit_(std::ldexp(root.size, -kPositionBits)),
      voxels_(variables, kOctantVoxels),
      values_(variables) {}

void OctantMerger::begin(const Cell& child) {
  CURVISPLAT_CHECK_OP(child.level, >, 0u);
  child_ = child;
  shift_ = kPositionBits - static_cast<int>(child.level) - kOctantBits;
  voxels_.clear(even_ ? std::ldexp(unit_, shift_) : 0);
}

size_t OctantMerger::voxelOf(const RootPosition& position) const {
  size_t voxel = 0;
  for (int axis = 2; axis >= 0; --axis)
    voxel = voxel << kOctantBits | (position.at[axis] >> shift_ & kOctantMask);
  return voxel;
}

RootPosition OctantMerger::voxelCorner(size_t voxel) const {
  RootPosition corner;
  for (int axis = 0; axis < 3; ++axis) {
    const uint64_t in_octant = voxel >> (axis * kOctantBits) & kOctantMask;
    corner.at[axis] = (uint64_t{child_.at[axis]} << kOctantBits | in_octant) << shift_;
  }
  return corner;
}

void OctantMerger::add(const BrickSplats& brick) {
  const uint64_t in_voxel = (uint64_t{1} << shift_) - 1;
  for (size_t n = 0; n < brick.size(); ++n) {
    const RootPosition& position = brick.positions[n];
    glm::dvec3 from_corner;
    for (int axis = 0; axis < 3; ++axis)
      from_corner[axis] = unit_ * (static_cast<double>(position.at[axis] & in_voxel) + 0.5);
    for (size_t variable = 0; variable < variables_; ++variable)
      values_[variable] = brick.variables[variable][n];
    SplatCodes codes;
    if (!brick.border_codes.empty()) codes.border = brick.border_codes[n];
    if (!brick.growth_codes.empty()) codes.growth = brick.growth_codes[n];
    voxels_.add(voxelOf(position), from_corner, brick.splats[n], values_, codes);
  }
}

MergedOctant OctantMerger::finish() {
  MergedOctant merged;
  merged.splats.cell = child_;
  merged.splats.variables.resize(variables_);
  const auto last_in_voxel = static_cast<double>((uint64_t{1} << shift_) - 1);
  for (size_t voxel = 0; voxel < kOctantVoxels; ++voxel) {
    if (voxels_.count(voxel) == 0) continue;
    Splat splat;
    const SplatCodes codes = voxels_.finish(voxel, splat, values_);
    merged.detail = voxels_.detail(voxel, merged.detail);
    // The centre of a cluster lies among its members, thus in the voxel; rounding must not take it out.
    RootPosition position = voxelCorner(voxel);
    for (int axis = 0; axis < 3; ++axis)
      position.at[axis] +=
          static_cast<uint64_t>(std::clamp(splat.position[axis] / unit_, 0.0, last_in_voxel));
    merged.splats.positions.push_back(position);
    merged.splats.splats.push_back(splat);
    merged.splats.border_codes.push_back(codes.border);
    merged.splats.growth_codes.push_back(codes.growth);
    for (size_t variable = 0; variable < variables_; ++variable)
      merged.splats.variables[variable].push_back(values_[variable]);
  }
  return merged;
}

std::vector<std::vector<SplatScalar>> OctantMerger::finishValues() {
  std::vector<std::vector<SplatScalar>> merged(variables_);
  for (size_t voxel = 0; voxel < kOctantVoxels; ++voxel) {
    if (voxels_.count(voxel) == 0) continue;
    voxels_.finishValues(voxel, values_);
    for (size_t variable = 0; variable < variables_; ++variable)
      merged[variable].push_back(values_[variable]);
  }
  return merged;
}

BrickSplats joinOctants(const Cell& cell, size_t variables, std::array<MergedOctant, 8>&& octants) {
  BrickSplats brick;
  brick.cell = cell;
  brick.variables.resize(variables);
  size_t size = 0;
  for (const MergedOctant& octant : octants) size += octant.splats.size();
  brick.positions.reserve(size);
  brick.splats.reserve(size);
  brick.border_codes.reserve(size);
  brick.growth_codes.reserve(size);
  for (auto& values : brick.variables) values.reserve(size);
  for (MergedOctant& octant : octants) {
    const BrickSplats from = std::exchange(octant.splats, {});
    brick.positions.insert(brick.positions.end(), from.positions.begin(), from.positions.end());
    brick.splats.insert(brick.splats.end(), from.splats.begin(), from.splats.end());
    brick.border_codes.insert(brick.border_codes.end(), from.border_codes.begin(), from.border_codes.end());
    brick.growth_codes.insert(brick.growth_codes.end(), from.growth_codes.begin(), from.growth_codes.end());
    for (size_t variable = 0; variable < from.variables.size(); ++variable)
      brick.variables[variable].insert(brick.variables[variable].end(), from.variables[variable].begin(),
                                       from.variables[variable].end());
  }
  return brick;
}

}  // namespace curvisplat
