// Every cell of a grid cut into equal parts by its own trilinear map: the same field on smaller cells. A splat has one place,
// shape and plane for all of its cell, so that few cells that grow or bend steeply show as bands; small parts of them do not.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>

#include "preprocess/grid/grid_source.h"

namespace curvisplat {

/// Each cell of `source` as parts x parts x parts cells (`source` itself if that is one); a direction with one plane of nodes keeps it. The grid's own nodes
/// keep their coordinates, values and blanking. New nodes are interpolated, scalars of `source` that are derived as well.
/// Blocks that share the nodes of a face or an edge share the new ones there bit for bit, however their indices run; new
/// nodes on a collapsed face coincide as well.
///
/// The parts of a cell are drawn if the cell is: a new node is blanked unless it lies in a cell whose nodes are all there.
/// A node is not there where it is blanked, or where a coordinate or one of the node-centred scalars that are read is not
/// finite or has the value `blank_value`. A new node is fringe if all nodes that it is interpolated from are. A part has the
/// value of its cell.
///
/// Reads the nodes around a box alone. Any number of threads may read concurrently. Throws Error if there would be too
/// many nodes to count.
std::unique_ptr<GridSource> refined(std::unique_ptr<GridSource> source, uint32_t parts,
                                    std::optional<double> blank_value = std::nullopt);

}  // namespace curvisplat
