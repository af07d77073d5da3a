// Merges the layers of thin cells in a decoded leaf brick (DESIGN.md, "Thin cells"). Splats that lie above one
// another in one voxel, and have about the same colour, become one splat with their moments. It is as long and
// wide as they are; only its thickness grows, to a voxel's length at most.
//
// Merging takes about 60 ns a splat, less than a tenth of what drawing one takes. It happens when a picture
// fetches a brick, since a level of such splats would add half to a cache's bytes. A LayerMerger belongs to
// one thread.
#pragma once

#include <cstddef>
#include <cstdint>
#include <glm/vec3.hpp>
#include <optional>
#include <vector>

#include "stream/model/splats.h"

namespace curvisplat {

/// Divides a scalar's values into bins, within which a transfer function hardly changes.
struct ScalarBins {
  bool log_scale = false;  // position = scale * log(value) + bias, otherwise scale * value + bias
  double scale = 0, bias = 0;
  std::vector<uint16_t> bins;  // one before position 0, one for each whole position, one after the last

  uint16_t of(float value) const;
};

/// How the layers of a brick are merged.
struct LayerMerging {
  uint32_t number = 0;    // > 0; differs between different ones
  glm::dvec3 voxel{0.0};  // its lengths along the axes, world units before any stretching
  ScalarBins bins;
  std::optional<ScalarBins> second_bins = std::nullopt;  // of a second scalar, if there is one
};

class LayerMerger {
 public:
  /// The most bytes that an object takes.
  static constexpr uint64_t kBytes =
      uint64_t{kMaxBrickSplats} * (2 * sizeof(uint64_t) + 4 * sizeof(uint32_t));

  /// Merges in place. Each merged splat takes the place of its first one. `largest_radius`: Brick's, in world
  /// units, within which the supports of merged splats stay. `second`: null unless there is a second scalar.
  /// Cells at borders are not merged.
  void merge(const LayerMerging& merging, double largest_radius, SplatGeometry& geometry,
             SplatVariable& values, SplatVariable* second);

 private:
  void findLayers(const LayerMerging& merging, const SplatGeometry& geometry, const SplatVariable& values,
                  const SplatVariable* second);

  /// Splats are merged if their keys are equal.
  struct Key {
    uint64_t voxel;  // its place
    uint32_t bins;   // of both scalars
    bool operator==(const Key&) const = default;
    size_t hash() const { return (voxel * 0x9e3779b97f4a7c15u + bins) * 0x9e3779b97f4a7c15u >> 32; }
  };

  std::vector<Key> keys_;       // [splat]
  std::vector<uint32_t> next_;  // [splat]: the next one to be merged with it
  std::vector<uint32_t> last_;  // hash table: the last splat so far of each key
};

}  // namespace curvisplat
