// A Tecplot file, text or binary, as a GridSource: its ORDERED zones as blocks, and its variables besides the coordinates
// as scalars.
#pragma once

#include <array>
#include <memory>
#include <optional>
#include <vector>

#include "preprocess/formats/common/open_grid_options.h"
#include "preprocess/formats/tecplot/tecplot_data.h"
#include "preprocess/grid/grid_source.h"

namespace curvisplat {

bool isTecplot(const InputFile& file);

/// Coordinates: the variables named x, y and z (also "X [m]", CoordinateX), else the first three. A variable iblank hides
/// nodes where it is 0, and marks those of the fringe where it is negative. Zones with times are the steps of a series;
/// zones without belong to all steps. A variable of nodes in some zones and of cells in others becomes two scalars,
/// "p:node" and "p:cell". Zones without volume are left out with a warning.
class TecplotSource final : public GridSource {
 public:
  /// Throws Error.
  explicit TecplotSource(const OpenGridOptions& options);

  const GridDescription& description() const override { return description_; }
  void read(uint32_t block, const NodeBox& box, std::span<const uint32_t> scalars,
            NodeArrays& out) const override;
  void readPartOfRows(uint32_t block, const NodeBox& box, std::span<const uint32_t> scalars,
                      NodeArrays& out) const override {
    read(block, box, scalars, out);
  }
  uint64_t rowsInMemory(std::span<const uint32_t> /*scalars*/) const override { return 0; }
  bool readFringe(uint32_t block, const NodeBox& box, std::vector<uint8_t>& out) const override;

 private:
  void chooseStep(const OpenGridOptions& options);
  void leaveOutFlatZones();
  void findCoordinates();
  void addScalars();
  std::optional<size_t> variableNamed(std::span<const char* const> names) const;
  template <typename Value>
  void readBox(const TecplotZone& zone, size_t variable, const NodeBox& box, std::vector<Value>& to) const;

  TecplotData data_;
  GridDescription description_;
  std::array<size_t, 3> axes_{};
  std::optional<size_t> iblank_;
  std::vector<size_t> variables_;  // [description_.scalars]
};

}  // namespace curvisplat
