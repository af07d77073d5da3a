// A CGNS file, HDF5 or ADF, as a GridSource: the structured zones of all bases as blocks, and the fields of
// their vertex and cell-centred solutions at one time step as scalars. Never holds a whole zone: each read
// fetches the requested box from the file.
//
// Neither HDF5 nor libcgns is thread-safe: reads by several threads run one after the other.
#pragma once

#include <array>
#include <memory>
#include <optional>
#include <vector>

#include "preprocess/formats/cgns/cgns_description.h"
#include "preprocess/formats/cgns/cgns_file.h"
#include "preprocess/formats/cgns/cgns_tree.h"
#include "preprocess/formats/common/open_grid_options.h"
#include "preprocess/grid/grid_source.h"

namespace curvisplat {

/// A field that is missing in some zones is NaN there, which blanks their samples; a warning reports it. A
/// field that is node-centred in some zones and cell-centred in others becomes two scalars, "Density:node"
/// and "Density:cell". VelocityX, VelocityY and VelocityZ also give their magnitude, "Velocity:mag".
class CgnsSource final : public GridSource {
 public:
  CgnsSource(std::shared_ptr<const CgnsFile> file, CgnsTree tree, uint32_t time_step);

  const GridDescription& description() const override { return description_; }
  void read(uint32_t block, const NodeBox& box, std::span<const uint32_t> scalars,
            NodeArrays& out) const override;
  void readPartOfRows(uint32_t block, const NodeBox& box, std::span<const uint32_t> scalars,
                      NodeArrays& out) const override {
    read(block, box, scalars, out);
  }
  uint64_t rowsInMemory(std::span<const uint32_t> /*scalars*/) const override { return 0; }

 private:
  void readScalar(const CgnsZone& zone, const NodeBox& box, const CgnsArrays& arrays, Centring centring,
                  std::vector<float>& to) const;

  std::shared_ptr<const CgnsFile> file_;
  CgnsTree tree_;
  GridDescription description_;
  std::vector<std::vector<CgnsArrays>> arrays_;  // [scalar][zone]
};

/// Structured zones as a CgnsSource, or unstructured ones as a CgnsMeshSource. Throws Error.
std::unique_ptr<DataSource> openCgns(const OpenGridOptions& options);

}  // namespace curvisplat
