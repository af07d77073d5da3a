// How many faces a FaceMatcher writes to disk, found by counting a share of them.
#pragma once

#include <cstdint>
#include <unordered_map>
#include <vector>

#include "preprocess/gather/cell_faces.h"

namespace curvisplat {

/// Follows the faces whose lowest corner is one of a share of all points, through a table that is as much smaller as
/// FaceMatcher's. Small meshes are followed whole. One thread. Memory: some 80 bytes for each of 2^19 faces, mostly fewer.
class WaitingFaces {
 public:
  /// Of a mesh with `faces` in all, each of them counted in both of its cells. `range_cells`: that become splats together.
  WaitingFaces(uint64_t faces, uint64_t range_cells);

  /// Whether cells with this corner have faces that are followed.
  bool follows(uint64_t corner) const { return share_ == 0 || (corner * kMix) >> (64 - share_) == 0; }
  /// The faces of cells that have such corners, in the mesh's order. Positions are not needed.
  void add(const GatheredCells& cells);

  struct Counts {
    uint64_t spilled = 0;                      // those that wait at the end, too
    uint64_t outer = 0, corners_of_outer = 0;  // that have planes of them, in points
    struct Pairs {
      uint64_t in_range = 0, across = 0;  // of cells of one range; of two
    };
    Pairs found, found_late;  // while cells come; when all have come
  };
  /// Of the whole mesh, after all cells.
  Counts counts() const;

 private:
  static constexpr uint64_t kMix = 0x9e3779b97f4a7c15;
  static constexpr uint32_t kSpilled = UINT32_MAX;
  struct Seen {
    uint64_t cell;
    uint32_t entry;  // of waiting_; or kSpilled
    uint32_t corners;
  };
  struct Hash {
    size_t operator()(const FaceCorners& corners) const {
      uint64_t hash = 0;
      for (const uint64_t corner : corners) hash = ((hash ^ corner) * kMix) ^ (hash >> 29);
      return hash;
    }
  };
  struct Entry {
    FaceCorners corners;
    bool is_second;  // its first one is on disk; it is counted already
  };
  void add(const FaceCorners& corners, uint64_t cell, uint32_t corners_of_cell);
  uint32_t newEntry(const Entry& entry);

  const uint64_t range_cells_;
  unsigned share_ = 0;  // one point of 2^share_
  uint32_t most_waiting_;
  std::vector<Entry> waiting_;
  std::vector<uint32_t> free_;
  uint32_t next_to_spill_ = 0;
  std::unordered_map<FaceCorners, Seen, Hash> open_;  // without a second cell so far
  Counts counts_;                                     // of those that are followed
  FaceList list_;
};

}  // namespace curvisplat
