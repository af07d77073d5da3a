// An XDMF file as a GridSource or a MeshSource: its structured grids as blocks, or where there are none its unstructured ones as
// pieces, and their attributes as scalars.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "preprocess/formats/common/open_grid_options.h"
#include "preprocess/formats/xdmf/xdmf_file.h"
#include "preprocess/grid/grid_source.h"
#include "preprocess/mesh/mesh_source.h"

namespace curvisplat {

struct XdmfScalar {
  std::string name;  // of its attribute
  Centring centring = Centring::kNode;
  uint64_t components = 1;
  int component = 0;  // -1: the magnitude
};

/// Attributes of one component give a scalar NAME; of two or three NAME:mag, NAME:x, ...; of more NAME:0, NAME:1, ... An
/// attribute that some grids lack is NaN there, which blanks their samples; a warning reports it.
class XdmfSource final : public GridSource {
 public:
  explicit XdmfSource(XdmfFile file);

  const GridDescription& description() const override { return description_; }
  void read(uint32_t block, const NodeBox& box, std::span<const uint32_t> scalars,
            NodeArrays& out) const override;
  void readPartOfRows(uint32_t block, const NodeBox& box, std::span<const uint32_t> scalars,
                      NodeArrays& out) const override {
    read(block, box, scalars, out);
  }
  uint64_t rowsInMemory(std::span<const uint32_t> /*scalars*/) const override { return 0; }

 private:
  void readPlaces(const XdmfGrid& grid, const NodeBox& box, NodeArrays& out) const;

  XdmfFile file_;
  GridDescription description_;
  std::vector<XdmfScalar> scalars_;
};

class XdmfMeshSource final : public MeshSource {
 public:
  explicit XdmfMeshSource(XdmfFile file);

  const GridDescription& description() const override { return description_; }
  bool hasCurvedCells() const override;
  void readPoints(uint32_t piece, uint64_t first, uint64_t count, std::span<const uint32_t> scalars,
                  MeshPoints& out) const override;
  void readCells(uint32_t piece, uint64_t first, uint64_t count, std::span<const uint32_t> scalars,
                 MeshCells& out) const override;

 private:
  void readScalars(const XdmfGrid& grid, uint64_t first, uint64_t count, std::span<const uint32_t> scalars,
                   std::vector<std::vector<float>>& out) const;
  void readMixed(const XdmfGrid& grid, uint64_t first, uint64_t count, MeshCells& out) const;

  XdmfFile file_;
  GridDescription description_;
  std::vector<XdmfScalar> scalars_;
};

/// Throws Error.
std::unique_ptr<DataSource> openXdmf(const OpenGridOptions& options);

}  // namespace curvisplat
