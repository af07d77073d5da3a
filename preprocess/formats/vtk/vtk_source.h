// The GridSource of all VTK formats.
#pragma once

#include "preprocess/formats/vtk/vtk_fields.h"
#include "preprocess/formats/vtk/vtk_grid.h"
#include "preprocess/grid/box_source.h"

namespace curvisplat {

/// Scalars: vtk_fields.h. Flat pieces are left out with a warning.
///
/// A node is blanked if vtkGhostType hides it or all cells around it.
class VtkSource final : public BoxSource {
 public:
  /// Throws Error if no block has volume.
  explicit VtkSource(VtkGrid grid);

  const GridDescription& description() const override { return description_; }
  void read(uint32_t block, const NodeBox& box, std::span<const uint32_t> scalars,
            NodeArrays& out) const override;

 private:
  void addBlocks();
  void readField(const VtkFields::Field& field, const VtkBlock& block, const NodeBox& box,
                 std::span<const WantedComponent<float>> wanted, size_t nodes) const;

  VtkGrid grid_;
  GridDescription description_;
  VtkFields fields_;
};

}  // namespace curvisplat
