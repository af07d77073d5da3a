// The endings of the names of files that are read, without those of compressed files. A file is detected by its contents: endings
// serve the file dialog, and messages.
#pragma once

#include <string_view>

namespace curvisplat {

/// Endings with spaces between them.
struct GridEndings {
  /// The name that messages give to a file that begins as it should; null where there is no mark, or the ending is several
  /// formats'.
  const char* begin_as;
  std::string_view endings;
};

inline constexpr GridEndings kGridEndings[] = {
    {"a VTK XML file", ".vts .vtr .vti .vtu .pvts .pvtr .pvti .pvtu .vtm .vtmb .vtpd .vth .vthb .pvd"},
    {"a legacy VTK file", ".vtk"},
    {"a CGNS file", ".cgns"},
    {"a NetCDF file", ".nc .nc4 .netcdf"},
    {"an EnSight case", ".case .encas"},
    {"an XDMF file", ".xmf .xdmf"},
    {nullptr,
     ".p3d .xyz .x .g .grd .grid .q .f .fun .fmt .bin .dat .vtkhdf .hdf .hdf5 .h5 .series .adf .cdf .zip "
     ".zarr .tec .tp .plt .foam .msh .e .ex2 .exo .exii .su2 .csv"},
};

}  // namespace curvisplat
