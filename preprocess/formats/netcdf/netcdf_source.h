// A NetCDF file of the ocean, the atmosphere or anything else on a curvilinear grid by the CF conventions, as
// a GridSource of one block: a grid of the file's variables at one time step.
//
// Of a file with several grids (a staggered mesh) it is the grid of the first scalar that the user names,
// else the one of most variables; warnings name the others. Nodes where that scalar (else the grid's first)
// has no value are blanked; where another one has none, it is NaN.
//
// NetCDF is not thread-safe: reads by several threads follow one another.
#pragma once

#include <optional>
#include <vector>

#include "preprocess/formats/common/open_grid_options.h"
#include "preprocess/formats/netcdf/cf_grid.h"
#include "preprocess/formats/netcdf/globe.h"
#include "preprocess/formats/netcdf/netcdf_file.h"
#include "preprocess/grid/grid_source.h"

namespace curvisplat {

class NetcdfSource final : public GridSource {
 public:
  /// Throws Error.
  explicit NetcdfSource(const OpenGridOptions& options);

  const GridDescription& description() const override { return description_; }
  void read(uint32_t block, const NodeBox& box, std::span<const uint32_t> scalars,
            NodeArrays& out) const override;

 private:
  static CfGrid chooseGrid(const NetcdfFile& file, const OpenGridOptions& options,
                           GridDescription& description, size_t& mask);
  Globe globeOf(const GlobeOptions& options) const;
  void describe(const OpenGridOptions& options);
  void readPlaces(const NodeBox& box, NodeArrays& out) const;
  void readBlank(const NodeBox& box, std::vector<uint8_t>& blank) const;
  void readScalar(const NodeBox& box, size_t scalar, std::vector<float>& to) const;

  NetcdfFile file_;
  GridDescription description_;
  size_t mask_ = 0;  // the scalar that says which nodes are there
  CfGrid grid_;
  double length_ = 1;  // kilometres of x and y, if they are no degrees
  Globe globe_;
};

}  // namespace curvisplat
