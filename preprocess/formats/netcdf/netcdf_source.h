// A curvilinear grid by the CF conventions (ocean, atmosphere, ...) in one or more NetCDF files, as a
// GridSource of one block at one time step.
//
// If a file has several grids (a staggered mesh), the source uses that of the first scalar that the user
// requests, else the grid with the most variables; warnings list the others. Nodes where that scalar (else
// the grid's first) is missing, or that the files' mask hides, are blanked; where another scalar is missing, it is NaN.
//
// NetCDF is not thread-safe: reads by several threads run one after the other.
#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "preprocess/formats/common/open_grid_options.h"
#include "preprocess/formats/netcdf/cf_grid.h"
#include "preprocess/formats/netcdf/closed_grid.h"
#include "preprocess/formats/netcdf/globe.h"
#include "preprocess/formats/netcdf/netcdf_files.h"
#include "preprocess/grid/grid_source.h"

namespace curvisplat {

/// Opens the files, and closes a grid that runs around the Earth (closed_grid.h). Throws Error.
std::unique_ptr<GridSource> openNetcdf(const OpenGridOptions& options);

class NetcdfSource final : public GridSource {
 public:
  /// Throws Error.
  explicit NetcdfSource(const OpenGridOptions& options);

  const GridDescription& description() const override { return description_; }
  void read(uint32_t block, const NodeBox& box, std::span<const uint32_t> scalars,
            NodeArrays& out) const override;

  /// How the grid closes if it runs around the Earth; of grids on a sphere with their levels along k.
  std::optional<GridClosure> closure() const;

 private:
  static CfGrid chooseGrid(const NetcdfFiles& file, const OpenGridOptions& options,
                           GridDescription& description, size_t& mask);
  Globe globeOf(const GlobeOptions& options) const;
  void describe(const OpenGridOptions& options);
  double shareOfZeros() const;
  bool projects() const;
  void readPlaces(const NodeBox& box, NodeArrays& out) const;
  void readColumns(const CfRange& range, std::vector<GlobeColumn>& columns) const;
  void applyMask(const NodeBox& box, std::vector<uint8_t>& blank) const;
  void readBlank(const NodeBox& box, std::vector<uint8_t>& blank) const;
  void readScalar(const NodeBox& box, size_t scalar, std::vector<float>& to) const;

  NetcdfFiles file_;
  GridDescription description_;
  size_t mask_ = 0;  // the scalar whose missing values blank nodes
  CfGrid grid_;
  double length_ = 1;  // unit of x and y in kilometres, unless they are degrees
  Globe globe_;
};

}  // namespace curvisplat
