// Grids that show another grid differently: some of its boxes, every n-th index plane, its blocks in
// another order, or its cells cut into parts. Each reads from the other grid only what a box needs and
// holds none of it. Any number of threads may read concurrently.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "preprocess/grid/grid_source.h"

namespace curvisplat {

/// A sample of a grid, from which the cost of converting the whole is estimated: boxes of whole rows,
/// spread over the blocks of `source`, with about `nodes` nodes together, each a block of its own. A grid
/// with no more nodes than that is taken as it is, block by block. Boxes do not overlap. Boundaries and
/// flow conditions are left out of the description.
std::unique_ptr<GridSource> sampleOf(std::shared_ptr<const GridSource> source, uint64_t nodes);

/// The smallest n for which every n-th index plane of each direction, and the last ones, have at most
/// `nodes` nodes together; 1 if all of the grid has no more. Blocks keep two planes in each direction, so
/// that many small blocks can have more.
uint64_t strideFor(const GridDescription& grid, uint64_t nodes);

/// A coarse grid of the same shape, for a first picture of a large one: the index planes 0, n, 2n, ... of
/// `source`, and the last ones, so that the outer faces stay where they are. Values at nodes are the grid's
/// own; a cell has the value of the lowest of the cells that it replaces. Rows are read one by one: of a
/// file, about 1/n² of its bytes. Boundaries and flow conditions are left out of the description. `source`
/// must outlive it.
std::unique_ptr<GridSource> thinned(const GridSource& source, uint64_t stride);

/// [n]: which of `blocks` has the name `names[n]`. Empty if the order is the same already, and where names
/// do not decide: they differ, or one occurs twice.
std::vector<uint32_t> orderByName(const std::vector<GridBlock>& blocks,
                                  const std::vector<std::string>& names);

/// Block n of the result is block `order[n]` of `source`, which must outlive it: for a time step whose file
/// lists the zones of the earlier steps in another order.
std::unique_ptr<GridSource> reordered(const GridSource& source, std::vector<uint32_t> order);

/// The same field on smaller cells: each cell of `source` is cut into parts by its own trilinear map (the
/// result is `source` itself if that is one everywhere); a direction with one plane of nodes keeps it. A splat has one place, shape and
/// plane for all of its cell, so a few cells that grow or bend steeply show as bands; small parts of them do not.
///
/// The grid's own nodes keep their coordinates, values and blanking. New nodes are interpolated, also in
/// derived scalars of `source`. Blocks that share the nodes of a face or an edge share the new ones there
/// bit for bit, however their indices run, if their cells have as many parts there; new nodes on a collapsed
/// face coincide as well.
///
/// The parts of a cell are drawn if the cell is: a new node is blanked unless it lies in a cell whose nodes
/// are all there. A node is not there where it is blanked, or where a coordinate or one of the node-centred
/// scalars that are read is not finite or has the value `blank_value`. A new node is fringe if all nodes
/// that it is interpolated from are. The parts of a cell have its value on the mean, and none beyond the cells beside it.
///
/// Reads the nodes around a box alone. Throws Error if there would be too many nodes to count.
std::unique_ptr<GridSource> refined(std::unique_ptr<GridSource> source, const Refinement& refinement,
                                    std::optional<double> blank_value = std::nullopt);
inline std::unique_ptr<GridSource> refined(std::unique_ptr<GridSource> source, uint32_t parts,
                                           std::optional<double> blank_value = std::nullopt) {
  return refined(std::move(source), Refinement(parts), blank_value);
}

}  // namespace curvisplat
