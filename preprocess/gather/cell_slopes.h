// Makes a splat of each cell: the mesh's cell-centred splats. Slopes are by least squares over the cells that share
// a face. Nothing grows with the mesh but what is on disk:
//
//    cells --+-- bodies, values ----------------------------> streams by ranges of cells --+
//            +-- faces --> streams by a hash of the corners                                 +--> splats
//                             sorted: two alike are neighbours --> streams by ranges of cells
//
// Faces are alike if their three lowest corners are; a face that more than two cells have joins none of them.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <vector>

#include "preprocess/gather/corner_gather.h"
#include "preprocess/gather/point_sums.h"

namespace curvisplat {

class CellSlopes {
 public:
  /// For cells with numbers below `cells`; `fields`: at least one value each.
  CellSlopes(uint64_t cells, size_t fields, uint64_t memory_bytes, std::filesystem::path folder);
  ~CellSlopes();

  /// Cells in the mesh's order.
  void add(const GatheredCells& cells);

  /// Makes the splats. Once, after all cells.
  PointSums::Counts finish(const TakeSplat& take, const Progress& progress);

 private:
  void matchFaces(size_t stream, class StreamsFile& neighbours);
  void makeSplats(size_t range, const class StreamsFile& neighbours, const TakeSplat& take,
                  PointSums::Counts& counts) const;

  const uint64_t cells_;
  const size_t fields_;
  const uint64_t memory_bytes_;
  const std::filesystem::path folder_;
  uint64_t range_cells_ = 0;
  std::unique_ptr<class StreamsFile> bodies_, faces_;
  std::vector<std::byte> batch_;
};

}  // namespace curvisplat
