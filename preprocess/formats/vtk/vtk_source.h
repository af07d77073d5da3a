// The GridSource of all VTK formats.
#pragma once

#include "preprocess/formats/vtk/vtk_fields.h"
#include "preprocess/formats/vtk/vtk_grid.h"
#include "preprocess/grid/grid_source.h"

namespace curvisplat {

/// Scalars: vtk_fields.h. Flat pieces are left out with a warning.
///
/// A node is blanked if vtkGhostType hides it or all cells around it.
class VtkSource final : public GridSource {
 public:
  /// Throws Error if no block has volume.
  explicit VtkSource(VtkGrid grid);

  const GridDescription& description() const override { return description_; }
  void read(uint32_t block, const NodeBox& box, std::span<const uint32_t> scalars,
            NodeArrays& out) const override;
  void readPartOfRows(uint32_t block, const NodeBox& box, std::span<const uint32_t> scalars,
                      NodeArrays& out) const override {
    read(block, box, scalars, out);
  }
  uint64_t rowsInMemory(std::span<const uint32_t> /*scalars*/) const override { return 0; }

 private:
  void addBlocks();
  void readField(const VtkFields::Field& field, const VtkBlock& block, const NodeBox& box,
                 std::span<const WantedComponent<float>> wanted, size_t nodes) const;

  VtkGrid grid_;
  GridDescription description_;
  VtkFields fields_;
};

}  // namespace curvisplat
