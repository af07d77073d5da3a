// An XDMF file: grids in XML, whose arrays are in other files. The result of reading it, and the input of xdmf_source.cpp.
//
//   <Xdmf><Domain><Grid GridType="Collection" CollectionType="Temporal">
//     <Grid> <Time Value="0.5"/>
//       <Topology TopologyType="3DSMesh" Dimensions="NK NJ NI"/>
//       <Geometry GeometryType="XYZ"> <DataItem Dimensions="NK NJ NI 3" Format="HDF">grid.h5:/xyz</DataItem> </Geometry>
//       <Attribute Name="p" Center="Node"> <DataItem ...>grid.h5:/p</DataItem> </Attribute>
//
// Parsed as a whole: at most 16 MiB. Elements may refer to others by a simple path (Reference="/Xdmf/Domain/...") or
// include others (xi:include xpointer="xpointer(...)"), all of the same file. Items by Coordinates are refused; attributes
// computed by a Function other than JOIN are left out.
#pragma once

#include <array>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "preprocess/formats/common/open_grid_options.h"
#include "preprocess/formats/common/spool_file.h"
#include "preprocess/formats/xdmf/xdmf_cell_types.h"
#include "preprocess/formats/xdmf/xdmf_values.h"
#include "preprocess/grid/grid_source.h"
#include "preprocess/mesh/mesh_source.h"

namespace curvisplat {

struct XdmfAttribute {
  std::string name;
  Centring centring = Centring::kNode;
  uint64_t components = 1;
  std::shared_ptr<const XdmfValues> values;  // null: not in this grid
};

/// The cells of an unstructured grid: all of one kind, or each with its type before its points (Mixed).
struct XdmfCells {
  uint64_t count = 0;  // 0: the grid is structured
  CellKind shape = CellKind::kNone;
  uint64_t nodes_each = 0;  // 0: Mixed
  bool curved = false;      // some have more nodes than corners
  uint64_t own_points = 0;  // not 0: that many of each cell, one cell after another, are the grid's points
  double first_point = 0;   // number of the first point (BaseOffset)
  std::shared_ptr<const XdmfValues> connectivity;
  SpooledNumbers begins;  // of Mixed: where each cell begins among the numbers, and the end of the last
};

struct XdmfGrid {
  enum class Kind { kPoints, kSeparate, kAxes, kUniform };
  std::string name;
  std::array<uint64_t, 3> nodes{};  // i, j, k
  Kind kind = Kind::kPoints;
  /// kPoints: one array of x, y, z; kSeparate: x, y and z of the nodes; kAxes: along i, j and k.
  std::array<std::shared_ptr<const XdmfValues>, 3> places;
  std::array<double, 3> origin{}, spacing{};  // kUniform: x, y, z
  XdmfCells cells;                            // of an unstructured grid, with nodes[0] points
  std::vector<XdmfAttribute> attributes;
};

struct XdmfFile {
  std::vector<XdmfGrid> grids;  // of the chosen time step, with volume: all structured, or all unstructured
  std::vector<double> times;
  uint32_t time_step = 0;
  std::vector<std::string> files, warnings;
};

/// Whether the file is XML with the element Xdmf.
bool isXdmf(const InputFile& file);

/// Throws Error.
XdmfFile readXdmf(const OpenGridOptions& options);

}  // namespace curvisplat
