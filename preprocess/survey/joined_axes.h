// The axes of blocks that go on into one another: blocks that share the nodes of a face or an edge have the same
// cells along it, so what is done to the rows of one must be done to those of the other.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "preprocess/grid/grid_source.h"

namespace curvisplat {

/// [block]: how far a uniform medium's optical depth is expected to deviate, in %, since rows of cells turn where they lead to
/// another block, or round a closed row. A splat at a joint has one shape for both sides: with n cells along such rows that turn by an
/// angle a, it is about 45 (tan(a/2) / n)², measured on herringbones of 7 to 25 nodes and tangents of 1 to 3. Reads two planes of nodes at
/// each outer face. Throws Error if the grid cannot be read.
std::vector<double> deviationAtKinks(const GridSource& source);

/// [block][axis]: the class of the axis. Two axes are of the same class if edges of cells on the blocks' outer
/// faces lie on each other, to a millionth of the grid's size, directly or by way of other blocks. Takes at most
/// 64 MB, and reads the outer faces of all blocks. Throws Error if the grid cannot be read.
std::vector<std::array<uint32_t, 3>> joinedAxes(const GridSource& source);

}  // namespace curvisplat
