// The numbers of points through all pieces of a mesh. Points of different pieces at the same position, bit by bit,
// are one point, which has the lowest of their numbers: a mesh in pieces has the splats of the whole one. Points of
// the same piece stay apart, as on the two sides of a thin wall.
#pragma once

#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "preprocess/gather/mesh_reader.h"
#include "stream/base/nameless_file.h"

namespace curvisplat {

class PointNumbers {
 public:
  /// One piece has no such points and takes no time. Otherwise reads all points; external, except for 16 bytes a
  /// point that has become another one. Throws Error if these are more than `memory_bytes`.
  PointNumbers(const MeshReader& reader, uint64_t memory_bytes, const ScratchFiles& scratch,
               const Progress& progress);

  /// Of a point by its number, piece after piece. Any thread.
  uint64_t operator()(uint64_t number) const;
  /// Points that have become another one.
  uint64_t merged() const { return merged_.size(); }
  /// Them, rising, and what each has become.
  std::span<const std::pair<uint64_t, uint64_t>> mergedPoints() const { return merged_; }

 private:
  std::vector<std::pair<uint64_t, uint64_t>> merged_;  // by number
};

}  // namespace curvisplat
