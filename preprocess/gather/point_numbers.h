// PointNumbers finds the coincident points of a mesh, which count as one: those that partitions repeat, and
// those of elements that have points of their own. It keeps the number of each point in a temporary file,
// which is read by ranges.
#pragma once

#include <cstdint>
#include <memory>
#include <span>

#include "preprocess/gather/mesh_reader.h"
#include "stream/base/progress.h"
#include "stream/base/temporary_files.h"

namespace curvisplat {

/// Whether each element (one or a few cells) has points of its own where elements meet, as discontinuous
/// finite elements are written. Then consecutive cells fall into many parts without a common point, and many
/// points have the position of another one. (A thin wall divides a mesh into two parts at most.) Reads a few
/// chunks of cells and their points. Throws Error if the file is damaged.
bool hasElementsApart(const MeshReader& reader);

/// Numbers the points of a mesh through all its pieces. Points of different pieces at exactly the same
/// position are one point, with the lowest of their numbers, so that a mesh in pieces has the splats of the
/// whole one. If the mesh hasElementsApart(), this holds for all points, with positions rounded to multiples
/// of about 2^-40 of the largest coordinate. In other meshes points of one piece stay apart, as on the two
/// sides of a thin wall.
class PointNumbers {
 public:
  /// Whether some points of the mesh may count as one. If not, making a PointNumbers costs next to nothing.
  static bool mayMerge(const MeshReader& reader) {
    return reader.pieces().size() > 1 || hasElementsApart(reader);
  }
  /// Bytes of temporary files for each point of a mesh that mayMerge(): of all that it writes, and of what it
  /// keeps.
  static constexpr uint64_t kMaxBytes = 3 * sizeof(double) + 4 * sizeof(uint64_t),
                            kKeptBytes = sizeof(uint64_t);

  /// Reads all points if the mesh mayMerge(), within `memory_bytes`. Throws Error if the disk fails or a file
  /// is damaged, Interrupted once `progress` is stopped.
  PointNumbers(const MeshReader& reader, uint64_t memory_bytes, const ScratchFiles& scratch,
               const Progress& progress);

  /// The number of points that have become another one.
  uint64_t merged() const { return merged_; }
  /// Overwrites `out` with the numbers of points [first, first + out.size()), counted through all pieces. Any
  /// thread may call it. Throws Error if the disk fails.
  void read(uint64_t first, std::span<uint64_t> out) const;

 private:
  uint64_t merged_ = 0;
  std::unique_ptr<NamelessFile> file_;  // the number of each point; null: no point has become another one
};

}  // namespace curvisplat
