// Grids of prisms in NetCDF: polygons of a map or a globe, each a column of layers. Which variables describe them:
//
//           polygons and their nodes                    heights of the layers
//    UGRID  face_node_connectivity of a mesh_topology   heights of faces or nodes, a formula, or the layers' coordinate
//    ICON   vertex_of_cell, vlon, vlat (grid file)      z_ifc, z_mc, or the coordinate of the layers
//    MPAS   verticesOnCell, nEdgesOnCell, lonVertex     zgrid, zMid, refBottomDepth, or layerThickness
//    FESOM  elements, lon, lat (mesh file, without UGRID's attributes)   nz, nz1, in metres
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "preprocess/formats/netcdf/netcdf_files.h"
#include "preprocess/grid/grid_source.h"

namespace curvisplat {

/// Sizes are indices of dimensions in NetcdfFiles::dimensions().
struct ColumnsMap {
  std::string format;  // "UGRID", "ICON", "MPAS", "FESOM"
  const NetcdfVariable* nodes_of_face = nullptr;
  const NetcdfVariable* sides = nullptr;  // of MPAS: how many nodes each face has
  double first_node = 0;                  // the number of the first node
  size_t face_dim = 0, node_dim = 0;
  const NetcdfVariable *longitude = nullptr, *latitude = nullptr;  // or x and y
  uint64_t faces = 0, nodes = 0, most_sides = 0;
};

/// nullopt if the files are of none of these. Throws Error if they are incomplete.
std::optional<ColumnsMap> findColumnsMap(const NetcdfFiles& file);

/// Files with more levels are not read.
inline constexpr uint64_t kMaxColumnsLevels = 1 << 20;

/// Scalars in the faces, or at the nodes, of one dimension of layers.
struct ColumnsScalars {
  Centring centring = Centring::kCell;
  size_t layer_dim = 0;
  uint64_t layers = 0;
  bool layer_fastest = false;  // as the first of them is stored
  std::vector<const NetcdfVariable*> variables;
  std::optional<size_t> time_dim;
};

bool hasDimension(const NetcdfVariable& variable, size_t dim);

/// How many layers each column has data in, from the top: below it there is ground.
struct ColumnsBottom {
  const NetcdfVariable* layers = nullptr;  // null: all have all
  double surplus = 0;                      // by which its values exceed the number of layers
};

/// MPAS' maxLevelCell, FESOM's nlevels and nlevels_nod2D, which count the levels around the layers.
ColumnsBottom findColumnsBottom(const NetcdfFiles& file, const ColumnsMap& map,
                                const ColumnsScalars& scalars);

/// Two dimensions of a variable, and its time: a box of them as numbers. Others have length 1.
class ColumnsReader {
 public:
  ColumnsReader(const NetcdfFiles& file, const NetcdfVariable& variable, size_t across_dim, size_t layer_dim,
                size_t step);

  /// Values of [across, across + count) on layers [layer, layer + layers), by value(n, layer).
  template <typename Value>
  struct Box {
    std::vector<Value> values;
    size_t across_stride = 1, layer_stride = 1;
    Value value(size_t n, size_t l) const { return values[n * across_stride + l * layer_stride]; }
  };
  template <typename Value>
  Box<Value> read(uint64_t across, uint64_t count, uint64_t layer, uint64_t layers) const;

 private:
  const NetcdfFiles& file_;
  const NetcdfVariable& variable_;
  size_t across_axis_ = 0, layer_axis_ = 0;
  NetcdfBox box_;
};

}  // namespace curvisplat
