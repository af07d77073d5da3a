// Writes a grid of any size as PLOT3D: PREFIX.xyz (coordinates), PREFIX.fun (a function file of the scalars)
// and PREFIX.nam (their names, one per line).
//
//   file         header                          per block
//   PREFIX.xyz   [blocks] {ni nj nk}...          x of all nodes, y, z, [iblank]
//   PREFIX.fun   [blocks] {ni nj nk scalars}...  scalar 1 of all nodes, scalar 2, ...
//
// Little-endian, without record markers ("C binary"), 32-bit integers and single precision. The block count
// is present only if there are several blocks, iblank only if a block has blanking. i is fastest, then j.
#pragma once

#include <filesystem>

#include "preprocess/grid/grid_source.h"
#include "stream/base/progress.h"

namespace curvisplat {

struct Plot3dOutputs {
  std::filesystem::path grid;  // empty: coordinates are not written
  std::filesystem::path function, names;
};

/// PREFIX.xyz, PREFIX.fun and PREFIX.nam.
Plot3dOutputs plot3dOutputs(const std::filesystem::path& prefix);

/// Writes all blocks and scalars of `source`. TBB workers read the source, the calling thread writes. Needs about 100 MB of
/// memory and a few rows, whatever the grid's size. Links are followed.
///
/// The files get their names one after the other when all of them are complete; before that, existing files stay
/// unchanged. Throws Error if a dimension exceeds 2^31 - 1, if there is too little space, or if I/O fails.
void writePlot3d(const GridSource& source, const Plot3dOutputs& outputs, Progress& progress);
/// Returns the three outputs.
Plot3dOutputs writePlot3d(const GridSource& source, const std::filesystem::path& prefix, Progress& progress);

}  // namespace curvisplat
