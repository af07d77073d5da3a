// The curvilinear grids in a NetCDF file, by the CF conventions. Variables with the same three dimensions
// (and time) share a grid. A file of a staggered mesh has several grids; a variable's dimensions decide.
#pragma once

#include <string>
#include <vector>

#include "preprocess/formats/netcdf/cf_term.h"
#include "preprocess/formats/netcdf/cf_vertical.h"
#include "preprocess/formats/netcdf/netcdf_file.h"

namespace curvisplat {

struct CfGrid {
  CfDimensions dims;  // i is the variables' last dimension
  std::vector<const NetcdfVariable*> variables;
  CfTerm longitude, latitude;  // or x and y
  bool degrees = true;         // false: x and y, which are lengths
  CfVertical vertical;
};

/// A variable that is on no grid, and the reason.
struct CfLeftOut {
  std::string variable, reason;
};

struct CfGrids {
  std::vector<CfGrid> grids;  // in the order of their first variables
  std::vector<CfLeftOut> left_out;
};

/// `time_step`: the step at which time-dependent variables are read; not checked. `file` must outlive the
/// result.
CfGrids findCfGrids(const NetcdfFile& file, size_t time_step);

/// The time of every step of a grid: values of the time coordinate, or 0, 1, ... if there is none. Empty if
/// the grid has no time dimension.
std::vector<double> cfTimes(const NetcdfFile& file, const CfGrid& grid);

}  // namespace curvisplat
