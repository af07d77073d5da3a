// Exodus II files (.e, .ex2, .exo; NetCDF classic and NetCDF-4): element blocks of one shape each, with scalars at
// nodes and in elements, of one time step.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "preprocess/formats/common/open_grid_options.h"
#include "preprocess/formats/netcdf/netcdf_file.h"
#include "preprocess/mesh/mesh_source.h"

namespace curvisplat {

/// Whether it is a NetCDF file with the dimensions and attributes of Exodus.
bool isExodus(const InputFile& file);

/// Scalars: the nodal and element variables by their names. An element variable that a block lacks is NaN there.
class ExodusSource final : public MeshSource {
 public:
  /// Throws Error if the file is damaged, or has no block of solid elements.
  explicit ExodusSource(const OpenGridOptions& options);

  const GridDescription& description() const override { return description_; }
  bool hasCurvedCells() const override { return has_curved_cells_; }
  void readPoints(uint32_t piece, uint64_t first, uint64_t count, std::span<const uint32_t> scalars,
                  MeshPoints& out) const override;
  void readCells(uint32_t piece, uint64_t first, uint64_t count, std::span<const uint32_t> scalars,
                 MeshCells& out) const override;

 private:
  struct Block {
    size_t number = 0;  // from 1, in the names of variables
    CellKind kind = CellKind::kNone;
    uint64_t first = 0, elements = 0, nodes_each = 0;
    const NetcdfVariable* connect = nullptr;
  };

  void findBlocks();
  void findScalars(const char* names, const char* values, Centring centring);
  std::vector<std::string> namesIn(const char* variable) const;
  void readValues(const NetcdfVariable* variable, uint64_t first, std::span<float> to,
                  std::optional<size_t> of_all = {}) const;

  std::unique_ptr<NetcdfFile> file_;
  std::vector<Block> blocks_;
  std::vector<size_t> number_of_scalar_;  // [description_.scalars], from 1
  uint64_t nodes_ = 0, elements_ = 0;
  bool has_curved_cells_ = false;
  GridDescription description_;
};

}  // namespace curvisplat
