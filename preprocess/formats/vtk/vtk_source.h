// The GridSource of all VTK formats.
#pragma once

#include "preprocess/formats/vtk/vtk_grid.h"
#include "preprocess/grid/grid_source.h"

namespace curvisplat {

/// Scalars are the numeric arrays of points and cells:
///
///   1 component         NAME
///   2 or 3 components   NAME:mag, NAME:x, NAME:y (and NAME:z)
///   more                NAME:0, NAME:1, ...
///
/// If points and cells have arrays of the same name, that of the cells is NAME:cell. A file's active arrays
/// come first. Flat pieces are left out with a warning. An array that is missing in some blocks is NaN there,
/// which blanks their samples.
///
/// A node is blanked if vtkGhostType hides it or all cells around it.
class VtkSource final : public GridSource {
 public:
  /// Throws Error if no block has volume.
  explicit VtkSource(VtkGrid grid);

  const GridDescription& description() const override { return description_; }
  void read(uint32_t block, const NodeBox& box, std::span<const uint32_t> scalars,
            NodeArrays& out) const override;

 private:
  /// An array that occurs in one or more pieces.
  struct Field {
    std::string name;
    Centring centring = Centring::kNode;
    uint32_t components = 1;
    std::vector<int32_t> array_of_piece;  // [piece]: index in the piece's data; -1: missing
  };
  struct Scalar {
    size_t field = 0;
    int component = 0;
  };

  void addBlocks();
  void addFields(Centring centring);
  size_t fieldOf(const VtkArray& array, Centring centring);
  void addScalars(const Field& field, size_t number);
  void warnOfPartialFields();

  void readField(const Field& field, const VtkBlock& block, const NodeBox& box,
                 std::span<const WantedComponent<float>> wanted, size_t nodes) const;

  VtkGrid grid_;
  GridDescription description_;
  std::vector<Field> fields_;
  std::vector<Scalar> scalars_;  // [description_.scalars]
};

}  // namespace curvisplat
