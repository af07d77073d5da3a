// Where a cell ends at a border. A node at the end of its block, or beside a blank one, owns half a cell
// along that axis, two axes or three; its splat remembers in which directions the data goes on. So does that
// of a cell of cell-centred data, though the cell is whole.
//
// The directions are unit vectors in the frame of the splat's A (A q is from the border inwards, as long as
// the cell is in that direction) and at right angles to one another, since J = A Q with Q orthogonal. They
// are kept as a rotation in 32 bits, good to 0.01 in the cell's own measure whatever its aspect ratio.
#pragma once

#include <array>
#include <cstdint>
#include <glm/vec3.hpp>
#include <span>

namespace curvisplat {

/// Of a cell that ends at none.
inline constexpr uint32_t kNoBorder = 0;

struct InwardAxes {
  std::array<glm::vec3, 3> axis;  // unit length, orthogonal
  int count = 0;                  // 0..3
};

/// `inward`: none to three such vectors.
uint32_t packBorderCode(std::span<const glm::dvec3> inward);
InwardAxes inwardAxes(uint32_t border_code);

/// False for what packBorderCode() gives to no cell; whatever passes has inward axes.
bool isPossibleBorderCode(uint32_t border_code);

// How the renderer draws a cell at a border: as two parts along each such axis, a narrow one at the border
// and a wide one behind it. In units of that cell's length, from its middle inwards; the shares of its weight
// sum to one.
struct BorderPart {
  float offset, size, share;
};
using BorderParts = std::array<BorderPart, 2>;

// By least squares in one dimension, for the step that a uniform half space is. Half cells of nodes: the
// squared error is 0.40 of that of one splat (0.019 for 0.048), what lies outside of the border 0.42 (0.033
// of a cell for 0.079), and where the density dips behind the border it has 0.87 for 0.83. Whole cells: 0.33
// (0.027 for 0.083) and 0.33 (0.045 for 0.138); a dip to 0.87 is new, one splat rises slowly.
inline constexpr BorderParts kNodeBorderParts{{{-0.286f, 0.336f, 0.264f}, {0.3f, 0.998f, 0.736f}}};
inline constexpr BorderParts kCellBorderParts{{{-0.342f, 0.25f, 0.197f}, {0.111f, 0.769f, 0.803f}}};

/// How much farther than the splat itself its parts reach, at the most, in units of its largest axis: the
/// inner parts' offset along three axes.
inline constexpr double kBorderReach = 0.52;

}  // namespace curvisplat
