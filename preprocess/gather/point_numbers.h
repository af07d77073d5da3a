// PointNumbers finds which points of a mesh are one: those that partitions repeat, and those of elements that have
// points of their own. Numbers of points are in a temporary file, and read by ranges.
#pragma once

#include <cstdint>
#include <memory>
#include <span>

#include "preprocess/gather/mesh_reader.h"
#include "stream/base/progress.h"
#include "stream/base/temporary_files.h"

namespace curvisplat {

/// Whether elements, of one or some cells each, have points of their own at the places where they meet, as
/// discontinuous finite elements are written: cells that follow one another are in many parts without a common
/// point, and many points have the positions of others. A thin wall parts a mesh in two at most. Reads some
/// chunks. Throws Error if the file is damaged.
bool hasElementsApart(const MeshReader& reader);

/// The numbers of points through all pieces of a mesh. Points of different pieces at the same position, bit by
/// bit, are one point, which has the lowest of their numbers: a mesh in pieces has the splats of the whole one.
/// If the mesh hasElementsApart(), so are all points at the same position, to 2^-40 of the coordinates. In
/// other meshes points of the same piece stay apart, as on the two sides of a thin wall.
class PointNumbers {
 public:
  /// Whether points of the mesh may be one. Otherwise PointNumbers takes no time.
  static bool mayMerge(const MeshReader& reader) {
    return reader.pieces().size() > 1 || hasElementsApart(reader);
  }
  /// Bytes of its temporary files in all, and of those that it keeps, for each point of a mesh that mayMerge().
  static constexpr uint64_t kMaxBytes = 3 * sizeof(double) + 4 * sizeof(uint64_t),
                            kKeptBytes = sizeof(uint64_t);

  /// Reads all points if the mesh mayMerge(); within `memory_bytes`. Throws Error if the disk fails.
  PointNumbers(const MeshReader& reader, uint64_t memory_bytes, const ScratchFiles& scratch,
               const Progress& progress);

  /// The number of points that have become another one.
  uint64_t merged() const { return merged_; }
  /// Overwrites `out` with the numbers of the points `first` and following, piece after piece. Any thread.
  void read(uint64_t first, std::span<uint64_t> out) const;

 private:
  uint64_t merged_ = 0;
  std::unique_ptr<NamelessFile> file_;  // the number of each point; null: no point has become another one
};

}  // namespace curvisplat
