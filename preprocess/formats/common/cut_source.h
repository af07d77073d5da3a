// A mesh whose curved cells (of higher order) are cut into linear ones: by their own polynomials, into as many along an edge as
// their order (preprocess/mesh/curved_cells.h). Corners of the parts are nodes of the cells; the value of a cell is that of all
// its parts. Parts have the volumes that the polynomial gives them (MeshCells::volumes). Points are added for Bezier's cells alone,
// behind those of the file: each cell's own ones, where its polynomial is at its nodes (preprocess/mesh/bezier_cells.h).
//
// Opening reads all cells once, with the positions of their nodes, and keeps 8 bytes for each cell and each part in temporary files:
// where a cell's parts, and its own points, begin, and the volumes of parts. Any number of threads may read.
#pragma once

#include <filesystem>
#include <memory>

#include "preprocess/grid/grid_source.h"

namespace curvisplat {

/// `source` itself if it is no mesh with curved cells. `cut`: false draws them by their corners.
std::unique_ptr<DataSource> cutCurved(std::unique_ptr<DataSource> source, bool cut,
                                      const std::filesystem::path& temporary_folder);

}  // namespace curvisplat
