// UGRID, ICON and MPAS in NetCDF as a MeshSource: prisms of the layers over each face. World units are kilometres, on a
// sphere or on a flat map, as of structured grids in NetCDF.
#pragma once

#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "preprocess/formats/columns/columns_heights.h"
#include "preprocess/formats/columns/columns_layout.h"
#include "preprocess/formats/common/open_grid_options.h"
#include "preprocess/formats/common/spool_file.h"
#include "preprocess/formats/netcdf/map_projection.h"
#include "preprocess/mesh/mesh_source.h"

namespace curvisplat {

/// Whether the files (options.grid and options.solutions) have faces with nodes, by UGRID, ICON or MPAS.
bool isColumnsGrid(const OpenGridOptions& options);

/// Points and cells are numbered as the scalars are stored: layer by layer, or column by column.
class ColumnsSource final : public MeshSource {
 public:
  /// Spools, if heights differ between columns, those of the nodes: the mean of the faces around each. That
  /// takes 24 bytes a face of the map, at most. Throws Error.
  explicit ColumnsSource(const OpenGridOptions& options);

  const GridDescription& description() const override { return description_; }
  void readPoints(uint32_t piece, uint64_t first, uint64_t count, std::span<const uint32_t> scalars,
                  MeshPoints& out) const override;
  void readCells(uint32_t piece, uint64_t first, uint64_t count, std::span<const uint32_t> scalars,
                 MeshCells& out) const override;

 private:
  /// The part of a range of samples that lies on some layers of some columns.
  struct Part {
    uint64_t across = 0, columns = 0, layer = 0, layers = 0;
    uint64_t skipped = 0;  // samples of the part before the range
    uint64_t taken = 0;    // samples of the range
  };
  template <typename Use>
  void forEachPart(uint64_t first, uint64_t count, uint64_t columns, uint64_t layers, const Use& use) const;
  void describe(const OpenGridOptions& options);
  void findTimes(const OpenGridOptions& options);
  /// Corrects map_.first_node, and warns, where the numbers of a UGRID's nodes contradict it.
  void findFirstNode();
  void spoolHeights(const std::filesystem::path& folder);
  template <typename Use>
  void forEachFace(const Use& use) const;
  /// Finds the faces that a flat map is cut through.
  void findCutFaces();
  void requireDegrees() const;
  /// Notes how far flat prisms lie below the sphere, where layers are thinner than that.
  void noteSagitta();
  /// The mean thickness of the thinnest layer over the first nodes, in kilometres; 0 if there is none.
  double thinnestLayer() const;
  /// The heights of some nodes in a level, in kilometres.
  void readHeights(uint64_t level, uint64_t first, std::span<double> out) const;
  void readScalars(uint64_t first, uint64_t count, std::span<const uint32_t> scalars,
                   std::vector<std::vector<float>>& out) const;
  std::vector<double> readAngles(const NetcdfVariable& variable, uint64_t first, uint64_t count) const;
  uint64_t levels() const;
  uint64_t pointOf(uint64_t node, uint64_t level) const;
  /// How many layers from the top have data in some columns: faces, or nodes, by the scalars' centring.
  std::vector<double> layersOf(uint64_t first, uint64_t count) const;
  /// The nodes of some faces, `sides` of each, as they are stored.
  std::vector<double> storedNodesOf(uint64_t first, uint64_t count) const;
  /// The nodes of some faces: `sides` of each, -1 where there are fewer.
  std::vector<int64_t> nodesOf(uint64_t first, uint64_t count) const;

  NetcdfFiles file_;
  ColumnsMap map_;
  GridDescription description_;
  ColumnsScalars scalars_;
  ColumnsHeights heights_;
  double to_degrees_ = 1;  // of longitudes; of lengths, kilometres
  Globe globe_;
  SpooledNumbers node_heights_;  // [level][node], if heights_.levels is empty
  ColumnsBottom bottom_;
  std::vector<uint64_t> cut_faces_;  // ascending
};

}  // namespace curvisplat
