// A CGNS file, HDF5 or ADF, as a GridSource of the structured zones of all bases, or as a MeshSource of the
// unstructured ones. Their scalars are the fields of vertex and cell-centred solutions at one time step. A
// field that is missing in some zones is NaN there, which blanks their samples; a warning reports it. A
// field that is node-centred in some zones and cell-centred in others becomes two scalars, "Density:node"
// and "Density:cell". VelocityX, VelocityY and VelocityZ also give their magnitude, "Velocity:mag".
//
// Neither source ever holds a whole zone: each read fetches the requested part from the file. Any number of
// threads may read. Neither HDF5 nor libcgns is thread-safe, so that their reads run one after the other.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "preprocess/formats/cgns/cgns_cells.h"
#include "preprocess/formats/cgns/cgns_file.h"
#include "preprocess/formats/cgns/cgns_tree.h"
#include "preprocess/formats/common/open_grid_options.h"
#include "preprocess/grid/grid_source.h"
#include "preprocess/mesh/mesh_source.h"

namespace curvisplat {

/// The arrays of a scalar on a zone: one, or three for the magnitude of a vector. Empty: the scalar is NaN.
/// The source's CgnsTree owns the arrays.
using CgnsArrays = std::vector<const CgnsArray*>;

/// The unstructured zones, a piece each.
class CgnsMeshSource final : public MeshSource {
 public:
  /// Throws Error if a zone is damaged or if none has a solid element.
  CgnsMeshSource(std::shared_ptr<const CgnsFile> file, CgnsTree tree, uint32_t time_step,
                 const std::filesystem::path& folder);

  const GridDescription& description() const override { return description_; }
  bool hasCurvedCells() const override { return has_curved_cells_; }
  void readPoints(uint32_t piece, uint64_t first, uint64_t count, std::span<const uint32_t> scalars,
                  MeshPoints& out) const override;
  void readCells(uint32_t piece, uint64_t first, uint64_t count, std::span<const uint32_t> scalars,
                 MeshCells& out) const override;

 private:
  void dropFieldsOfCells(size_t zone);
  void warnOfKinds();
  void readScalars(uint32_t piece, uint64_t first, uint64_t count, std::span<const uint32_t> scalars,
                   std::vector<std::vector<float>>& out) const;

  std::shared_ptr<const CgnsFile> file_;
  CgnsTree tree_;
  std::vector<CgnsCells> cells_;  // [zone]
  GridDescription description_;
  bool has_curved_cells_ = false;
  std::vector<std::vector<CgnsArrays>> arrays_;  // [scalar][zone]
};

/// The structured zones, a block each.
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
