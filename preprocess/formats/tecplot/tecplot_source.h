// A Tecplot file, text or binary, as a GridSource: its ORDERED zones as blocks, or where there are none as a MeshSource: its zones of
// tetrahedra and bricks as pieces; and its variables besides the coordinates as scalars.
#pragma once

#include <array>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "preprocess/formats/common/open_grid_options.h"
#include "preprocess/formats/tecplot/tecplot_data.h"
#include "preprocess/grid/grid_source.h"
#include "preprocess/mesh/mesh_source.h"

namespace curvisplat {

bool isTecplot(const InputFile& file);

/// Coordinates: the variables named x, y and z (also "X [m]", CoordinateX), else the first three. A variable iblank hides
/// nodes where it is 0, and marks those of the fringe where it is negative. Zones with times are the steps of a series;
/// zones without belong to all steps. A variable of nodes in some zones and of cells in others becomes two scalars,
/// "p:node" and "p:cell". Zones without volume are left out with a warning.
struct TecplotGrid {
  /// Throws Error.
  explicit TecplotGrid(const OpenGridOptions& options);

  TecplotData data;  // the zones that are drawn: all ordered, or all of finite elements
  GridDescription description;
  std::array<size_t, 3> axes{};
  std::optional<size_t> iblank;
  std::vector<size_t> variables;  // [description.scalars]

 private:
  void chooseStep(const OpenGridOptions& options);
  void leaveOutZones();
  void findCoordinates();
  void addScalars();
  std::optional<size_t> variableNamed(std::span<const char* const> names) const;
};

class TecplotSource final : public GridSource {
 public:
  explicit TecplotSource(TecplotGrid grid);

  const GridDescription& description() const override { return grid_.description; }
  void read(uint32_t block, const NodeBox& box, std::span<const uint32_t> scalars,
            NodeArrays& out) const override;
  void readPartOfRows(uint32_t block, const NodeBox& box, std::span<const uint32_t> scalars,
                      NodeArrays& out) const override {
    read(block, box, scalars, out);
  }
  uint64_t rowsInMemory(std::span<const uint32_t> /*scalars*/) const override { return 0; }
  bool readFringe(uint32_t block, const NodeBox& box, std::vector<uint8_t>& out) const override;

 private:
  template <typename Value>
  void readBox(const TecplotZone& zone, size_t variable, const NodeBox& box, std::vector<Value>& to) const;

  TecplotGrid grid_;
};

class TecplotMeshSource final : public MeshSource {
 public:
  explicit TecplotMeshSource(TecplotGrid grid);

  const GridDescription& description() const override { return grid_.description; }
  void readPoints(uint32_t piece, uint64_t first, uint64_t count, std::span<const uint32_t> scalars,
                  MeshPoints& out) const override;
  void readCells(uint32_t piece, uint64_t first, uint64_t count, std::span<const uint32_t> scalars,
                 MeshCells& out) const override;

 private:
  void readScalars(const TecplotZone& zone, uint64_t first, uint64_t count, std::span<const uint32_t> scalars,
                   std::vector<std::vector<float>>& out) const;

  TecplotGrid grid_;
};

/// Throws Error.
std::unique_ptr<DataSource> openTecplot(const OpenGridOptions& options);

}  // namespace curvisplat
