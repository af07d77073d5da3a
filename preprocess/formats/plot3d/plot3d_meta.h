// A .p3d file: JSON with ParaView's keys that says which PLOT3D files belong together, at which times, and
// how they are written. What it does not say is detected as ever.
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

/// Whether the file is a text that begins as JSON does.
bool isPlot3dMeta(const InputFile& file);

/// Opens the files of the chosen time step. options.force comes before what the file says. A Q or function
/// file that is not there is left out, with a warning. Throws Error naming the file and the key.
std::unique_ptr<GridSource> openPlot3dMeta(const OpenGridOptions& options);

}  // namespace curvisplat
