// How much light reaches each place of the data: shadows and ambient occlusion. DESIGN.md, "Light".
//
//     arriving = (1 - shadow (1 - T)) (1 - ambient_occlusion (1 - A))
//
// T is the transmittance of the data towards the light, and A the mean of the transmittances in 14 directions
// (faces and corners of a cube) over an eighth of the data's diagonal. Both come from a lattice over the
// data's box that holds the extinction of a coarse level of the cache, what is clipped left out: 81 nodes
// along the longest axis, so details smaller than 1/80 of the data cast soft shadows. Does not depend on the
// view. Built in tenths of a second; the same bits for any number of threads. Immutable; any thread.
#pragma once

#include <glm/vec3.hpp>

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "render/colour/classification.h"
#include "render/project/light.h"
#include "render/project/plane_cuts.h"
#include "stream/cache/cache_reader.h"

namespace curvisplat {

class GradientOpacity;

/// The volume that casts shadows, and the light.
struct ShadowScene {
  Light light;
  glm::dvec3 scale{1.0};
  std::vector<ClipPlane> clip_planes;         // what is outside of them casts none
  const GradientOpacity* gradient = nullptr;  // null: 1
  bool leave_out_damaged = false;             // false: a damaged brick is an error
};

/// A lattice of nodes over the data's box, those at its ends on the faces. The first axis runs fastest.
struct ShadowLattice {
  std::array<int, 3> nodes{2, 2, 2};  // along each axis, at least 2
  glm::dvec3 lower{0.0}, edge{1.0};   // of a cell, data coordinates, above 0

  size_t size() const {
    return static_cast<size_t>(nodes[0]) * static_cast<size_t>(nodes[1]) * static_cast<size_t>(nodes[2]);
  }
  size_t index(int i, int j, int k) const {
    return (static_cast<size_t>(k) * static_cast<size_t>(nodes[1]) + static_cast<size_t>(j)) *
               static_cast<size_t>(nodes[0]) +
           static_cast<size_t>(i);
  }
};

/// A ShadowGrid in float, relative to a brick's origin. Borrows the grid.
class LocalShadows {
 public:
  LocalShadows(const ShadowLattice& lattice, const float* values, const glm::dvec3& origin)
      : values_(values),
        per_edge_(1.0 / lattice.edge),
        first_((origin - lattice.lower) / lattice.edge),
        last_(lattice.nodes[0] - 1, lattice.nodes[1] - 1, lattice.nodes[2] - 1),
        row_(lattice.index(0, 1, 0)),
        layer_(lattice.index(0, 0, 1)) {}

  /// The share of the light that arrives at (x, y, z), 0 to 1: trilinear; outside, that of the nearest face.
  float at(float x, float y, float z) const {
    const auto [i, u] = placeOf(first_.x + per_edge_.x * x, last_.x);
    const auto [j, v] = placeOf(first_.y + per_edge_.y * y, last_.y);
    const auto [k, w] = placeOf(first_.z + per_edge_.z * z, last_.z);
    const float* const corner = values_ + k * layer_ + j * row_ + i;
    const auto along = [u = u](const float* from) { return from[0] + u * (from[1] - from[0]); };
    const float front = along(corner) + v * (along(corner + row_) - along(corner));
    const float* const behind = corner + layer_;
    const float back = along(behind) + v * (along(behind + row_) - along(behind));
    return front + w * (back - front);
  }

 private:
  struct Place {
    size_t node;
    float part;  // from there to the next one
  };
  static Place placeOf(float at, float last) {
    const float inside = at > 0 ? std::min(at, last) : 0.0f;
    const float node = std::min(static_cast<float>(static_cast<int>(inside)), last - 1);
    return {static_cast<size_t>(node), inside - node};
  }

  const float* values_;
  glm::vec3 per_edge_, first_, last_;
  size_t row_, layer_;
};

/// The share of a light that arrives at each place.
class ShadowGrid {
 public:
  static constexpr int kMaxNodes = 81, kMinNodes = 17;  // along an axis
  /// The memory in bytes of building a grid, while pictures may still have the last one.
  static constexpr uint64_t kBytes =
      uint64_t{kMaxNodes} * kMaxNodes * kMaxNodes * 3 * sizeof(float) +
      uint64_t{kMaxNodes + 2} * (kMaxNodes + 2) * (kMaxNodes + 2) * sizeof(float) +
      uint64_t{kMaxBrickSplats} * 20 * sizeof(float) + (12 << 20);  // what reading keeps on its thread

  /// A key by which a grid is known again: all of the scene but its gradient, which the caller compares, as
  /// the table and the cache.
  static std::vector<double> keyOf(const ShadowScene& scene);

  /// The scene's light has shadows. Throws DamagedBrick unless such bricks are left out, and Error if the disk
  /// fails. Parallel on the caller's TBB arena.
  ShadowGrid(const CacheReader& cache, size_t variable, const ClassificationTable& table,
             const ShadowScene& scene);

  LocalShadows local(const glm::dvec3& origin) const { return {lattice_, arriving_.data(), origin}; }
  float at(const glm::dvec3& data) const { return local(data).at(0, 0, 0); }
  const ShadowLattice& lattice() const { return lattice_; }
  /// [lattice().size()] the share that arrives at each node.
  std::span<const float> arriving() const { return arriving_; }
  /// The damaged bricks, which cast no shadow, with one line each that says why.
  const std::vector<std::pair<uint32_t, std::string>>& damaged() const { return damaged_; }

 private:
  ShadowLattice lattice_;
  std::vector<float> arriving_;
  std::vector<std::pair<uint32_t, std::string>> damaged_;
};

}  // namespace curvisplat
