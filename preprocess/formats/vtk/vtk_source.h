// The GridSource of all VTK formats.
#pragma once

#include "preprocess/formats/vtk/vtk_grid.h"
#include "preprocess/grid/grid_source.h"

namespace curvisplat {

/// Scalars are the numeric arrays of points and cells: those of one component under their name; of vectors
/// NAME:mag, NAME:x, NAME:y (and NAME:z); of more components NAME:0, NAME:1 ... Where points and cells have
/// arrays of one name, the cells' is NAME:cell. Those that a file calls active come first. Flat pieces are
/// left out with a warning; arrays that not all blocks have are NaN, so blank, in those that have them not.
///
/// Blank are nodes that vtkGhostType hides, and those whose cells it hides all.
class VtkSource final : public GridSource {
 public:
  /// Throws Error if no block has volume.
  explicit VtkSource(VtkGrid grid);

  const GridDescription& description() const override { return description_; }
  void read(uint32_t block, const NodeBox& box, std::span<const uint32_t> scalars,
            NodeArrays& out) const override;

 private:
  /// An array that blocks have in common.
  struct Field {
    std::string name;
    Centring centring = Centring::kNode;
    uint32_t components = 1;
    std::vector<int32_t> array_of_piece;  // its position in the piece's data; -1: it has none
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
  std::vector<Scalar> scalars_;  // of each of description_.scalars
};

}  // namespace curvisplat
