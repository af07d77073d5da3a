// The curvilinear grids in a NetCDF file, by the CF conventions. Variables of the same three dimensions (and
// time) are on one grid; on a staggered mesh a file has several, and a variable's own dimensions say which.
#pragma once

#include <string>
#include <vector>

#include "preprocess/formats/netcdf/cf_term.h"
#include "preprocess/formats/netcdf/cf_vertical.h"
#include "preprocess/formats/netcdf/netcdf_file.h"

namespace curvisplat {

struct CfGrid {
  CfDimensions dims;  // along i the variables' last, and so on
  std::vector<const NetcdfVariable*> variables;
  CfTerm longitude, latitude;  // or x and y
  bool degrees = true;         // else x and y are lengths
  CfVertical vertical;
};

/// What is no grid, and why.
struct CfLeftOut {
  std::string variable, reason;
};

struct CfGrids {
  std::vector<CfGrid> grids;  // in the order of their first variables
  std::vector<CfLeftOut> left_out;
};

/// `time_step`: which values are taken of what depends on time. It is not checked. `file` must outlive what
/// is returned.
CfGrids findCfGrids(const NetcdfFile& file, size_t time_step);

/// The variables of each grid's time dimension: the time of every step, numbers from 0 if the file tells
/// none; empty where there is no time.
std::vector<double> cfTimes(const NetcdfFile& file, const CfGrid& grid);

}  // namespace curvisplat
