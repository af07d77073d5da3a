// Coincident face nodes of abutting blocks, or of a periodic axis, become one splat: two halves give back the
// whole cell. Design section 3.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <span>

#include "preprocess/node_splats.h"

namespace curvisplat {

/// Takes the splats of block-face nodes in any order, and gives them back merged, in an order that depends on
/// the splats alone. Bounded memory: an external sort by the position along one generic direction, in sorted
/// runs on disk once `memory_bytes` are full, and a sweep over them.
class SeamMerger {
 public:
  SeamMerger(size_t variables, uint64_t memory_bytes, std::filesystem::path temporary_folder);
  ~SeamMerger();

  /// One thread at a time. Every splat is one with on_block_face set.
  void add(const NodeSplat& splat, std::span<const SplatScalar> values);

  /// Calls `sink` for each merged splat; its node is the lowest of those merged. Returns how many nodes were
  /// merged into another one. Nodes merge if they lie within 1e-3 of the smaller of their spacings, or within
  /// the rounding of their coordinates (4 units in the last place of a coordinate of `coordinate_bytes`
  /// bytes).
  uint64_t finish(int coordinate_bytes,
                  const std::function<void(const NodeSplat&, std::span<const SplatScalar>)>& sink);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace curvisplat
