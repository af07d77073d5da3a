// The curvilinear grids in NetCDF files, by the CF conventions. Variables with the same three dimensions
// (and time) share a grid. A file of a staggered mesh has several grids; a variable's dimensions decide. A fourth
// dimension may number the faces of a grid: of a cubed sphere (GEOS' nf), of the "lat-lon-cap" (MITgcm's face, ECCO's tile).
#pragma once

#include <array>
#include <functional>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "preprocess/formats/netcdf/cf_term.h"
#include "preprocess/formats/netcdf/cf_vertical.h"
#include "preprocess/formats/netcdf/map_projection.h"
#include "preprocess/formats/netcdf/netcdf_files.h"

namespace curvisplat {

/// One grid: its variables, and what its nodes' positions are computed from.
struct CfGrid {
  CfDimensions dims;  // i is the variables' last dimension
  std::vector<const NetcdfVariable*> variables;
  CfTerm longitude, latitude;               // or x and y
  bool degrees = true;                      // false: x and y, which are lengths
  std::optional<MapProjection> projection;  // of longitude and latitude, if these are the map's
  bool indices = false;                     // x, y and perhaps z have no coordinates but the nodes' indices
  std::vector<std::string> unused;          // variables of x and y with three dimensions, which are not read
  std::string implausible;                  // why longitude and latitude are not read, if they are there
  CfVertical vertical;
  std::optional<std::array<double, 2>> nowhere;  // longitude and latitude of nodes that are left out
  size_t levels = 2;                             // the axis along which longitude and latitude do not vary
  std::optional<CfMask> mask;
  bool surface_first = false;  // the first level is the ground's, above others: its nodes are blanked
  std::string steps_of;        // the dimension whose values are the steps, if it is not one of time: "month"

  /// Sets the face (of dims.face, from 0) whose nodes the terms read, in a grid of several faces. At first it
  /// is face 0.
  void setFace(uint64_t number);
  uint64_t face = 0;
};

/// A variable that is on no grid, and the reason.
struct CfLeftOut {
  std::string variable, reason;
};

/// The grids that findCfGrids() finds, and the variables that are on none.
struct CfGrids {
  std::vector<CfGrid> grids;  // in the order of their first variables
  std::vector<CfLeftOut> left_out;
  std::set<std::string, std::less<>> parts;  // variables that others name as measures, terms or ancillaries
};

/// Whether a variable is a field: not a coordinate or a mask, nor what heights, cells or maps are made of.
/// `found`: the grids of the files.
bool isField(const NetcdfFiles& file, const NetcdfVariable& variable, const CfGrids& found);

/// Finds the grids of the files. `time_step`: the step at which time-dependent variables are read; not
/// checked. `file` must outlive the result.
CfGrids findCfGrids(const NetcdfFiles& file, size_t time_step);

/// Whether the grid lies below the surface: halfway between the ends of a column the height is negative.
bool isOcean(const NetcdfFiles& file, const CfGrid& grid);

/// The times of a grid's steps.
struct CfTimes {
  std::vector<double> values;  // empty if the grid has no time dimension
  std::string unit, calendar;  // "days since 1950-01-01"; may be empty
};

/// The times along a dimension of `data`: the values of its coordinate; seconds since the first date of WRF's Times or MPAS' xtime;
/// the values of another variable of times along it alone, if they increase; or 0, 1, ... if there are none.
CfTimes cfTimes(const NetcdfFiles& file, size_t dim, const NetcdfVariable& data);

/// The time of every step of a grid. Empty if the grid has no time dimension.
CfTimes cfTimes(const NetcdfFiles& file, const CfGrid& grid);

}  // namespace curvisplat
