// A .p3d file: JSON with ParaView's keys that lists the PLOT3D files of each time step and their layout.
// Properties that it does not set are detected as usual.
//
//   {"filenames": [{"time": 0.5, "xyz": "a.xyz", "q": "a.q", "function": "a.f"}, ...],
//    "function-names": ["u", ...], "gamma": 1.4, "R": 1, "auto-detect-format": true,
//    "format": "binary", "language": "fortran", "byte-order": "big", "precision": 32, "multi-grid": true,
//    "blanking": false, "2D": false, "functions": [110]}
#pragma once

#include <memory>

#include "preprocess/formats/common/open_grid_options.h"
#include "preprocess/grid/grid_source.h"
#include "stream/base/file.h"

namespace curvisplat {

/// Whether the file is text that begins with '{'.
bool isPlot3dMeta(const InputFile& file);

/// Opens the files of the chosen time step. options.force overrides the file. A Q or function file that does
/// not exist is left out with a warning. Throws Error with the file and the key.
std::unique_ptr<GridSource> openPlot3dMeta(const OpenGridOptions& options);

}  // namespace curvisplat
