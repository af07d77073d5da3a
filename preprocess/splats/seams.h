// Coincident face nodes of abutting blocks, or of a periodic axis, become one splat: two halves give back the
// whole cell. DESIGN.md, "Splats".
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <span>

#include "preprocess/splats/node_splats.h"

namespace curvisplat {

/// What rounding may have done to a coordinate, in world units: 4 units in the last place of the largest, as
/// stored in `coordinate_bytes`.
double coordinateRounding(const glm::dvec3& position, int coordinate_bytes);

/// Takes the splats of block-face nodes, and those of the layers behind the faces, in any order, and gives
/// them back, the former merged, in an order and with sums that depend on the splats alone. The latter lose
/// their border codes where the face before them is a seam. Bounded memory: an external sort by the position
/// along one generic direction, in sorted runs on disk once `memory_bytes` are full, and a sweep over them.
class SeamMerger {
 public:
  /// The temporary file, if one is needed, has no name in `temporary_folder` once it is open: it vanishes
  /// with the process, however that ends.
  SeamMerger(size_t variables, uint64_t memory_bytes, std::filesystem::path temporary_folder);
  ~SeamMerger();
  SeamMerger(SeamMerger&&) noexcept;
  SeamMerger& operator=(SeamMerger&&) noexcept;

  /// One thread at a time. Every splat is one that isForSeams(). Throws Error if the disk fails.
  void add(const NodeSplat& splat, std::span<const SplatScalar> values);

  /// Calls `sink` for each merged splat: its node (and node_position) is the lowest of those merged, regular
  /// is false. A node that has no other to merge with comes out as it went in. Returns how many nodes were
  /// merged into another one. To be called once. Throws Error if the disk fails, and what `sink` throws.
  ///
  /// Two nodes merge if they lie within the tolerance of both: 1e-3 of the node's spacing, or the rounding of
  /// its coordinates (4 units in the last place, for coordinates of `coordinate_bytes` bytes) but then at
  /// most 0.4 of its spacing, so that neighbours along a grid line never merge, however thin the boundary
  /// layer, unless they coincide.
  uint64_t finish(int coordinate_bytes,
                  const std::function<void(const NodeSplat&, std::span<const SplatScalar>)>& sink);

  /// In place of finish(): calls `visit` for each set of nodes that it would merge, in rising order.
  void forEachSet(int coordinate_bytes, const std::function<void(std::span<const uint64_t>)>& visit);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace curvisplat
