// How many bytes CornerGather, and PointSums or CellSlopes behind it, will write to temporary files, known
// before anything is written: found from the cells' corners alone, by the same decisions about pages and
// streams. boundOfGather() reads a few chunks of cells, forecastOfGather() all of them. WaitingFaces follows
// only a share of the faces that wait for their second cell. One thread calls.
#pragma once

#include <cstdint>
#include <unordered_map>
#include <vector>

#include "preprocess/gather/cell_slopes.h"
#include "preprocess/gather/face_matcher.h"
#include "preprocess/gather/point_pages.h"
#include "preprocess/gather/point_sums.h"

namespace curvisplat {

/// How many faces a FaceMatcher will write to disk: follows the faces whose lowest corner is one of a share
/// of all points, through a table that is smaller than FaceMatcher's by that share. Small meshes are
/// followed whole. Memory: some 80 bytes for each of 2^19 faces, mostly fewer.
class WaitingFaces {
 public:
  /// `faces`: the faces of all cells, so that inner ones count twice. `range_cells`: cells that become
  /// splats together.
  WaitingFaces(uint64_t faces, uint64_t range_cells);

  /// Whether cells with this corner have faces that are followed.
  bool follows(uint64_t corner) const { return isAmong(corner, share_); }
  /// The faces of cells that have such corners, in the mesh's order. Positions are not needed.
  void add(const GatheredCells& cells);

  struct Counts {
    uint64_t spilled = 0;                      // those that wait at the end, too
    uint64_t outer = 0, corners_of_outer = 0;  // that have planes of them, in points
    uint64_t hanging = 0;                      // corners of quads at which others may lie against them
    uint64_t sides = 0;                        // CellSides there
    struct Pairs {
      uint64_t in_range = 0, across = 0;  // of cells of one range; of two
    };
    Pairs found, found_late;  // while cells come; when all have come
  };
  /// The counts of the whole mesh, after all cells.
  Counts counts() const;

 private:
  static constexpr uint64_t kMix = 0x9e3779b97f4a7c15;
  static constexpr unsigned kShareOfQuads =
      2;  // beside share_: a quad may be followed for each of its corners
  static bool isAmong(uint64_t corner, unsigned share) {
    return share == 0 || (corner * kMix) >> (64 - share) == 0;
  }
  bool followsQuads(uint64_t corner) const { return isAmong(corner, share_ + kShareOfQuads); }
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
  void addQuad(const FaceCorners& corners, uint64_t last_corner);
  void countHanging(Counts& counts) const;
  uint32_t newEntry(const Entry& entry);

  const uint64_t range_cells_;
  unsigned share_ = 0;  // one point of 2^share_
  uint32_t most_waiting_;
  std::vector<Entry> waiting_;
  std::vector<uint32_t> free_;
  uint32_t next_to_spill_ = 0;
  std::unordered_map<FaceCorners, Seen, Hash> open_;  // without a second cell so far
  std::unordered_map<FaceCorners, uint64_t, Hash>
      open_quads_;  // at some corners, and the last corner of each
  Counts counts_;   // of those that are followed
  FaceList list_;
};

/// Splats of a mesh's points or cells, made within some memory.
struct GatherJob {
  Centring centring = Centring::kNode;
  size_t fields = 0;
  uint64_t memory_bytes = 0;
};

/// Bytes of temporary files.
struct GatherNeeds {
  uint64_t before_splats = 0;  // while cells are gathered
  uint64_t beside_splats = 0;  // from the first splat on
  uint64_t splats = 0;         // one a point or cell; two a cell that may have two outer faces (halveSlab())
};

/// The most that may be needed, whatever the order of the cells. Reads a few chunks of them; `reader` needs
/// no scalars.
GatherNeeds boundOfGather(const MeshReader& reader, const GatherJob& job);
/// Forecasts what will be needed. Reads all cells. Points that several pieces share count as different ones,
/// so that this is too much for many small pieces.
GatherNeeds forecastOfGather(const MeshReader& reader, const GatherJob& job, const Progress& progress);

/// The counts that both functions make, and the bytes that follow from them.
class GatherCounts {
 public:
  /// `chunk_bytes`: of the largest chunk of cells.
  GatherCounts(const MeshReader& reader, const GatherJob& job, uint64_t chunk_bytes);

  uint64_t cells = 0, corners = 0, face_words = 0;  // of cells that are drawn
  uint64_t streamed_corners = 0;                    // of cells that are not gathered by pages
  uint64_t waiting_bytes = 0;                       // of cells that wait for sums, in all their ranges
  uint64_t sum_file_bytes = 0;
  WaitingFaces::Counts faces;

  /// Joins faces that were counted piece by piece.
  void joinPieces();
  GatherNeeds needs() const;
  const GatherJob& job() const { return job_; }
  uint64_t half() const { return half_; }
  const PointSums::Shares& sums() const { return sums_; }
  const CellSlopes::Shares& slopes() const { return slopes_; }
  bool mergesPoints() const { return merges_points_; }
  size_t cornerFields() const { return job_.centring == Centring::kNode ? job_.fields : 0; }

 private:
  uint64_t ofCorners() const;
  uint64_t takenForHanging() const;
  GatherNeeds needsOfPoints() const;
  GatherNeeds needsOfCells() const;

  GatherJob job_;
  uint64_t points_, all_cells_, half_;
  size_t pieces_;
  bool merges_points_;
  PointSums::Shares sums_;
  CellSlopes::Shares slopes_;
};

}  // namespace curvisplat
