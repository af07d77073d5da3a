// Coincident face nodes of abutting blocks, or of a periodic axis, become one splat if their halves are
// alike (joint_nodes.h). DESIGN.md, "Splats".
//
//   splats of face nodes ---> seam_sorter ---> coincidence_sweep ---> joint_nodes ---> merged splats
//                             external sort    which of them meet     which become one
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <span>
#include <vector>

#include "preprocess/seams/joint_nodes.h"
#include "preprocess/seams/thin_walls.h"
#include "preprocess/splats/node_splats.h"
#include "stream/base/ranks.h"

namespace curvisplat {

/// Takes the splats of block-face nodes, and those of the layers behind the faces, in any order, and gives
/// them back, the former merged, in an order and with sums that depend on the splats alone. The latter lose
/// their border codes where the face before them is a seam. Bounded memory: an external sort by the position
/// along one generic direction, in sorted runs on disk once `memory_bytes` are full, and a sweep over them.
///
/// Splats with layers (face_layers.h) lose those whose face is a seam: they wait, in a second external sort
/// by number, for what becomes of their probes at the faces' nodes. Without probes all faces count as
/// borders.
class SeamMerger {
 public:
  /// The temporary file, if one is needed, has no name in `temporary_folder` once it is open: it vanishes
  /// with the process, however that ends.
  SeamMerger(size_t variables, uint64_t memory_bytes, std::filesystem::path temporary_folder,
             UnlikeHalves unlike = UnlikeHalves::kApart);
  ~SeamMerger();
  SeamMerger(SeamMerger&&) noexcept;
  SeamMerger& operator=(SeamMerger&&) noexcept;

  /// Appends all splats that isForSeams(), and the probes, to `records`. Any thread.
  void pack(const NodeSplats& splats, std::vector<double>& records) const;
  /// Adds packed splats. Any thread; one that has gathered many seldom waits for others. Throws Error if the
  /// disk fails.
  void add(std::span<const double> records);

  // The functions below are called by one thread, when all splats are added.

  /// Brings what the mergers of all ranks were given to rank 0's, a bounded amount at a time. All have to
  /// call it.
  void sendToFirst(Ranks& ranks);

  /// Calls `visit` for each set of nodes of which halves would become one splat. Several threads call it at the same time,
  /// in any order. Call it before finishInParallel(), at most once. Throws Error if the disk fails, and what `visit`
  /// throws.
  void forEachJoint(int coordinate_bytes, const std::function<void(std::span<const uint64_t>)>& visit);

  /// Keeps nodes on different sides of thin walls apart, each with a splat that ends there. Call it before finish(),
  /// finishInParallel() or forEachSet().
  void keepApart(ThinWalls walls);

  /// Calls `sink` for each splat that is left: its node (and node_position) is the lowest of those merged,
  /// and regular is false. A node that has no other to merge with comes out as it went in. Returns how many
  /// nodes were merged into another one. Nodes coincide as CoincidenceSweep says, for coordinates of
  /// `coordinate_bytes` bytes. Call it once. Throws Error if the disk fails, and what `sink` throws.
  uint64_t finish(int coordinate_bytes,
                  const std::function<void(const NodeSplat&, std::span<const SplatScalar>)>& sink);

  /// The same by several threads, which call `sink` at the same time and in any order.
  uint64_t finishInParallel(int coordinate_bytes,
                            const std::function<void(const NodeSplat&, std::span<const SplatScalar>)>& sink);

  /// Calls `visit`, in place of finish(), for each set of nodes that would be merged, in rising order.
  void forEachSet(int coordinate_bytes, const std::function<void(std::span<const uint64_t>)>& visit);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace curvisplat
