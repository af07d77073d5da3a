// What CornerGather, and PointSums or CellSlopes behind it, will write to temporary files: found from the cells' corners alone,
// by the same decisions about pages and streams.
#pragma once

#include <cstdint>

#include "preprocess/gather/cell_slopes.h"
#include "preprocess/gather/page_slots.h"
#include "preprocess/gather/point_sums.h"
#include "preprocess/gather/waiting_faces.h"

namespace curvisplat {

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
  uint64_t samples = 0;        // points, or cells that are drawn
};

/// At the most, whatever the order of the cells. Reads a few chunks of them; `reader` needs no scalars.
GatherNeeds boundOfGather(const MeshReader& reader, const GatherJob& job);
/// Reads all cells. Points that several pieces share count as different ones, so that this is too much for many small pieces.
GatherNeeds forecastOfGather(const MeshReader& reader, const GatherJob& job, const Progress& progress);

/// What both count.
class GatherCounts {
 public:
  /// `chunk_bytes`: of the largest chunk of cells.
  GatherCounts(const MeshReader& reader, const GatherJob& job, uint64_t chunk_bytes);

  uint64_t cells = 0, corners = 0, face_words = 0;  // of cells that are drawn
  uint64_t streamed_corners = 0;                    // of cells that are not gathered by pages
  uint64_t waiting_bytes = 0;                       // of cells that wait for sums, in all their ranges
  uint64_t sum_file_bytes = 0;
  WaitingFaces::Counts faces;

  /// Of faces that were counted piece by piece.
  void joinPieces();
  GatherNeeds needs() const;
  const GatherJob& job() const { return job_; }
  uint64_t half() const { return half_; }
  const PointSums::Shares& sums() const { return sums_; }
  const CellSlopes::Shares& slopes() const { return slopes_; }
  size_t cornerFields() const { return job_.centring == Centring::kNode ? job_.fields : 0; }

 private:
  uint64_t ofCorners() const;
  GatherNeeds needsOfPoints() const;
  GatherNeeds needsOfCells() const;

  GatherJob job_;
  uint64_t points_, all_cells_, half_;
  size_t pieces_;
  PointSums::Shares sums_;
  CellSlopes::Shares slopes_;
};

}  // namespace curvisplat
