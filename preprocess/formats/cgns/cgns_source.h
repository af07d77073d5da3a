// A CGNS file, HDF5 or ADF, as a GridSource: the structured zones of all bases as blocks, and the fields of
// their vertex and cell-centred solutions at one time step as scalars. Nothing holds a zone: what is read is
// what is asked for, wherever it lies in the file.
//
// libcgns is not thread-safe: reads by several threads follow one another.
#pragma once

#include <array>
#include <memory>
#include <optional>
#include <vector>

#include "preprocess/formats/cgns/cgns_file.h"
#include "preprocess/formats/cgns/cgns_tree.h"
#include "preprocess/formats/common/open_grid_options.h"
#include "preprocess/grid/grid_source.h"

namespace curvisplat {

/// A field that some zones lack is NaN in them, which blanks their nodes; a warning says so. A field that is
/// of the nodes of some zones and of the cells of others is two scalars, "Density:node" and "Density:cell".
/// Of VelocityX, VelocityY and VelocityZ there is also their length, "Velocity:mag".
class CgnsSource final : public GridSource {
 public:
  /// Throws Error.
  explicit CgnsSource(const OpenGridOptions& options);

  const GridDescription& description() const override { return description_; }
  void read(uint32_t block, const NodeBox& box, std::span<const uint32_t> scalars,
            NodeArrays& out) const override;

 private:
  /// The arrays of a scalar on a zone: one, or the three of a vector whose length it is. None: NaN.
  using Arrays = std::vector<const CgnsArray*>;

  void addScalars();
  void addVectors();
  void warnOfGaps();
  void readScalar(const CgnsZone& zone, const NodeBox& box, const Arrays& arrays, Centring centring,
                  std::vector<float>& to) const;

  CgnsFile file_;
  CgnsTree tree_;
  GridDescription description_;
  std::vector<std::vector<Arrays>> arrays_;  // [scalar][zone]
};

}  // namespace curvisplat
