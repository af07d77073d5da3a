// Border codes of cells in the layers behind several faces, or behind other faces than those that they end at; border_code.h has the
// other forms. A cell that ends at faces has the first form. Its bits 5-7 also mark directions beyond their number: they lead from
// faces that the cell is in the layer behind of. A cell that ends nowhere, and is behind two or three faces:
//
//   bits 0-2   4
//        3-4   which of the quaternion's numbers is left out
//        5     one for three directions, zero for two
//        6-7   3: more than any ratio of a merged splat
//        8-31  the rotation, as in the first form; the directions are its first columns
//
// The face is about one length of the cell from its middle (layerDistance()): what is cut there is a hundredth of the weight.
#pragma once

#include <cstddef>
#include <cstdint>
#include <glm/vec3.hpp>
#include <span>

namespace curvisplat {

/// `inward`: directions at right angles, two or three. The first `count` lead from borders that are faces, the others, at
/// least one, from faces that the cell is behind. Three of the latter are in a right-handed order.
uint32_t packLayersCode(std::span<const glm::dvec3> inward, size_t count);

/// Bit n: axis[n] of the code's InwardAxes, which is not one of its `count`, leads from a face that the cell is behind. Any code of
/// another form has none, that for one face (InwardAxes::behind) included.
uint32_t layersOf(uint32_t border_code);

/// How far such a face is from the cell's middle, in cells, where cells grow inwards by e^growth: of cells that grow steadily.
inline float layerDistance(float growth) {
  return 1 - 0.106f * growth;
}

}  // namespace curvisplat
