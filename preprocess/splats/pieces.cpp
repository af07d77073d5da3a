#include "preprocess/splats/pieces.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <glm/common.hpp>

namespace curvisplat {
namespace {

glm::dvec3 offsetOf(unsigned piece) {
  return {piece & 1 ? 0.25 : -0.25, piece & 2 ? 0.25 : -0.25, piece & 4 ? 0.25 : -0.25};
}

std::array<PieceGroup, 256> allGroups() {
  std::array<PieceGroup, 256> groups;
  for (unsigned set = 1; set < groups.size(); ++set) {
    const double share = 1.0 / std::popcount(set);
    glm::dvec3 mean(0.0);
    Symmetric3 second;
    for (unsigned piece = 0; piece < kPieces; ++piece) {
      if ((set >> piece & 1) == 0) continue;
      const glm::dvec3 u = offsetOf(piece);
      mean += share * u;
      second.xy += share * u.x * u.y;
      second.xz += share * u.x * u.z;
      second.yz += share * u.y * u.z;
    }
    // A piece's own extents are half the cell's: a quarter of its shape.
    const auto square = [](double m) { return 0.25 + 12 * (0.0625 - m * m); };
    groups[set] = {std::popcount(set) / double{kPieces},
                   mean,
                   {square(mean.x), 12 * (second.xy - mean.x * mean.y), square(mean.y),
                    12 * (second.xz - mean.x * mean.z), 12 * (second.yz - mean.y * mean.z), square(mean.z)}};
  }
  return groups;
}

}  // namespace

const PieceGroup& pieceGroup(PieceSet pieces) {
  static const std::array<PieceGroup, 256> groups = allGroups();
  return groups[pieces];
}

PieceVoxels voxelsOfPieces(const glm::dvec3& middle, std::array<glm::dvec3, 3> columns, int edge) {
  PieceVoxels found;
  const auto reach = [&](int axis) {
    return 0.25 * (std::abs(columns[0][axis]) + std::abs(columns[1][axis]) + std::abs(columns[2][axis]));
  };
  const glm::dvec3 lower = glm::floor(middle);
  bool in_one = true;
  for (int axis = 0; axis < 3; ++axis) {
    const double r = reach(axis);
    in_one &= middle[axis] - r >= lower[axis] && middle[axis] + r < lower[axis] + 1;
  }
  if (in_one) {
    found.voxel[0] = glm::ivec3(lower);
    found.pieces[0] = kAllPieces;
    found.count = 1;
    return found;
  }
  for (int axis = 0; axis < 3; ++axis) {
    while (!(middle[axis] - reach(axis) >= 0 && middle[axis] + reach(axis) < edge)) {
      const auto shorter = [axis](const glm::dvec3& a, const glm::dvec3& b) {
        return std::abs(a[axis]) < std::abs(b[axis]);
      };
      *std::max_element(columns.begin(), columns.end(), shorter) = glm::dvec3(0.0);
    }
  }
  for (unsigned piece = 0; piece < kPieces; ++piece) {
    const glm::dvec3 u = offsetOf(piece);
    const glm::dvec3 at = middle + (u.x * columns[0] + u.y * columns[1] + u.z * columns[2]);
    const glm::ivec3 voxel = glm::clamp(glm::ivec3(glm::floor(at)), 0, edge - 1);
    const auto end = found.voxel.begin() + static_cast<ptrdiff_t>(found.count);
    const auto group = static_cast<size_t>(std::find(found.voxel.begin(), end, voxel) - found.voxel.begin());
    if (group == found.count) found.voxel[found.count++] = voxel;
    found.pieces[group] = static_cast<PieceSet>(found.pieces[group] | 1u << piece);
  }
  return found;
}

}  // namespace curvisplat
