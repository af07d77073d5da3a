// Makes a splat of each cell: the mesh's cell-centred splats. Slopes are by least squares over the cells that share
// a face. Nothing grows with the mesh but what is on disk:
//
//    cells --+-- bodies, values -----------------------------------> streams by ranges of cells --+
//            +-- faces --> face_matcher --+-- pairs of a range --------> the same                 +--> splats
//                                         +-- of others: neighbours ---> the same                 |
//                                         +-- single ones -------------> the same                 |
//                                                  +-- hanging_faces --> neighbours of other sizes --+
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "preprocess/gather/corner_gather.h"
#include "preprocess/gather/face_matcher.h"
#include "preprocess/gather/hanging_faces.h"
#include "preprocess/gather/outer_planes.h"
#include "preprocess/gather/point_sums.h"
#include "stream/base/temporary_files.h"

namespace curvisplat {

/// Whether cells that end at two opposite faces, as those of two-dimensional cases, are one splat or two: then the second has the
/// cell's number plus the number of cells.
enum class SlabCells { kWhole, kHalved };

class CellSlopes {
 public:
  /// Takes cells with numbers below `cells`; `fields`: at least one value each.
  CellSlopes(uint64_t cells, size_t fields, uint64_t memory_bytes, const ScratchFiles& scratch);
  ~CellSlopes();

  /// How a pass shares its memory.
  struct Shares {
    uint64_t body_bytes, pair_bytes, neighbour_bytes, plane_bytes, face_bytes, side_bytes;
    uint64_t direction_bytes, corner_bytes;  // of HangingFaces
    uint64_t range_cells;                    // that become splats together
  };
  static Shares sharesOf(uint64_t cells, size_t fields, uint64_t memory_bytes);
  /// Records, in temporary files.
  struct RecordBytes {
    uint64_t body, face, pair, neighbour;
    uint64_t corner;  // of a face, in HangingFaces
    uint64_t side;
  };
  static RecordBytes recordBytes(size_t fields);

  /// Cells in the mesh's order.
  void add(const GatheredCells& cells);

  /// Makes the splats. Once, after all cells.
  PointSums::Counts finish(const TakeSplat& take, SlabCells slabs, HangingNodes hanging,
                           const Progress& progress);

 private:
  std::span<const float> valuesOf(const GatheredCells& cells, size_t n) const;
  void addBodies(const GatheredCells& cells);
  void addFaces(const GatheredCells& cells);
  /// Whether both cells are of one range, and know one another now.
  bool joinInRange(uint64_t a, uint64_t b);
  void addNeighbour(uint64_t cell, uint64_t neighbour, const glm::dvec3& centre,
                    std::span<const std::byte> values);
  void makeSplats(size_t range, const TakeSplat& take, SlabCells slabs, PointSums::Counts& counts);

  const uint64_t cells_;
  const size_t fields_;
  const uint64_t range_cells_;
  std::unique_ptr<class StreamsFile> bodies_, pairs_, neighbours_, sides_;
  std::unique_ptr<FaceMatcher> faces_;
  std::unique_ptr<HangingFaces> hanging_;
  std::unique_ptr<OuterPlanes> planes_;
  FaceList list_;
  std::vector<CellBody> of_cells_;  // that are added
  std::vector<std::byte> neighbour_;
};

}  // namespace curvisplat
