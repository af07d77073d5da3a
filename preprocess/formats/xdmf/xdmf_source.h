// An XDMF file as a GridSource: its structured grids as blocks, and their attributes as scalars.
#pragma once

#include <vector>

#include "preprocess/formats/common/open_grid_options.h"
#include "preprocess/formats/xdmf/xdmf_file.h"
#include "preprocess/grid/grid_source.h"

namespace curvisplat {

/// Attributes of one component give a scalar NAME; of two or three NAME:mag, NAME:x, ...; of more NAME:0, NAME:1, ... An
/// attribute that some grids lack is NaN there, which blanks their samples; a warning reports it.
class XdmfSource final : public GridSource {
 public:
  /// Throws Error.
  explicit XdmfSource(const OpenGridOptions& options);

  const GridDescription& description() const override { return description_; }
  void read(uint32_t block, const NodeBox& box, std::span<const uint32_t> scalars,
            NodeArrays& out) const override;
  void readPartOfRows(uint32_t block, const NodeBox& box, std::span<const uint32_t> scalars,
                      NodeArrays& out) const override {
    read(block, box, scalars, out);
  }
  uint64_t rowsInMemory(std::span<const uint32_t> /*scalars*/) const override { return 0; }

 private:
  struct Scalar {
    std::string name;  // of its attribute
    Centring centring = Centring::kNode;
    uint64_t components = 1;
    int component = 0;  // -1: the magnitude
  };

  void addScalars();
  void readPlaces(const XdmfGrid& grid, const NodeBox& box, NodeArrays& out) const;

  XdmfFile file_;
  GridDescription description_;
  std::vector<Scalar> scalars_;
};

}  // namespace curvisplat
