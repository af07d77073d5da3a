// Finds the files and time steps that make a series. These are several steps:
//
//   q.0000 q.0100 ...     files whose names differ in numbers only, in natural order (q.9 before q.10): PLOT3D
//                         solutions of one grid, or grids with their own scalars; several kinds go side by side
//   'q.*' 'q.%04d'        patterns of such names, quoted from the shell: all files that match
//   one file              .pvd, .vtk.series and the like, .p3d, CGNS, NetCDF: its time steps
//   several such files    the steps of one after those of the other
//
// Files of VTK or CGNS whose names have the number of a processor or a block as well (t0_p0.vtu t0_p1.vtu
// t1_p0.vtu ...) are pieces of steps, and so are those that SEACAS writes for processors (mesh.e.2.0
// mesh.e.2.1); mesh.e-s002 goes on from mesh.e. A hyphen before a number is a minus sign if some of the names
// have none there (r-5 r0 r5).
//
// As many restart files as a SU2 mesh has zones are one step, and so are the tiles of a cubed sphere (a.tile1.nc to
// a.tile6.nc): of two such sets, those of the same number are the steps. Files that Gmsh saved for the partitions of a mesh are one step.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "preprocess/formats/common/open_grid_options.h"
#include "preprocess/grid/grid_source.h"

namespace curvisplat {

/// A step: what openGrid() takes to open it.
struct StepFiles {
  OpenGridOptions options;
  std::string name;  // "q.0100" or "run.nc, time step 3"
};

/// Steps [first, last] of a series, every `stride`-th.
struct StepSelection {
  uint64_t first = 0;
  std::optional<uint64_t> last;
  uint64_t stride = 1;
};

/// Parses "all", "FIRST", "FIRST:LAST" or "FIRST:LAST:STRIDE"; both ends are included, and may be left out.
/// Throws UsageError that names `option`.
StepSelection parseSteps(const std::string& option, const std::string& text);
/// The selected numbers below `count`. Throws UsageError that names `option` if there are none.
std::vector<uint64_t> selectedSteps(const std::string& option, const StepSelection& selection,
                                    uint64_t count);

/// Replaces patterns among the grid and the solutions by the files that match, in natural order. Caches
/// (folders with .splats in their names) never match. Throws Error if a pattern matches none. Where the grid
/// is a pattern, the first file becomes the grid, and the others come before the solutions.
void expandPatterns(OpenGridOptions& options);

/// Whether the names of the files make them several steps. Opens nothing but a mesh of SU2 or Gmsh.
bool hasSeveralStepFiles(const OpenGridOptions& options);

/// The steps that the names of the files tell; a file with several steps counts as one. Opens nothing but a
/// mesh of SU2 or Gmsh.
std::vector<StepFiles> stepsByName(const OpenGridOptions& options);

/// The steps within one of these. Files that cannot be opened count as one step.
std::vector<StepFiles> stepsIn(const StepFiles& files);

/// A sentence on the scalars of a later step that the first one lacks, and that the series therefore does not
/// have. Opens the later step, but not of OpenFOAM and PLOT3D. Empty if there are none, or if the step cannot
/// be opened.
std::string noteOnLaterScalars(const GridDescription& first, const OpenGridOptions& later);

/// All steps of the files, whose patterns have been expanded. One at least. Opens files that may hold several
/// steps. Throws Error if the first cannot be opened.
std::vector<StepFiles> stepsOf(const OpenGridOptions& options);

}  // namespace curvisplat
