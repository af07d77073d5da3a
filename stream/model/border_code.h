// Where a cell ends at a border. A node at the end of its block, or beside a blank one, owns half a cell
// along that axis, two axes or three; its splat remembers in which directions the data goes on. So does that
// of a cell of cell-centred data, though the cell is whole.
//
// The directions are unit vectors in the frame of the splat's A (A q is from the border inwards, as long as
// the cell is in that direction) and at right angles to one another, since J = A Q with Q orthogonal. They
// are kept as a rotation, good to 0.006 (0.02 at the most) in the cell's own measure whatever its aspect ratio, and each has a
// bit that says how the renderer is to draw it: in parts, or cut at the border's face.
//
//   bits 0-1   number of directions
//        2     the third is opposite to the rotation's
//        3-4   which of the quaternion's numbers, w x y z, is the largest and left out
//        5-7   direction 0, 1, 2 ends at a face to be cut at
//        8-31  the quaternion's other numbers, 8 bits each
//
// A node's cell in the layer behind such a face is whole, but its splat reaches beyond the face and is cut
// there, too. It has a code of another form:
//
//   bits 0-1   zero
//        2     one
//        3-7   zero
//        8-23  the direction from the face inwards: the octahedron's map, 8 bits each
//        24-31 how far the face is from the cell's middle, in 1/128 of the cell's length in that direction
//
// A merged splat that ends at one face has this form with a number n from 1 to 21 in bits 3-7, and a distance of 1 at
// the most: the splats behind it are 3/4 2^((n - 1) / 10) times as long as twice the distance, or 3 times as long as the
// splat, if that is less. It is drawn as the first form is, fitted for this ratio: the lattice of voxels makes
// the layer at a face as thick as it happens to be.
//
// The first version of the format has only zeros in bits 5-7 of the first form, and has not the others.
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
  uint32_t faces = 0;             // bit n: axis[n] starts at a face to be cut at
  float distance = 0.5f;          // of the faces from the cell's middle, in cells
  bool behind = false;            // the cell is in the layer behind the one face
  float ratio = 0;                // > 0: a merged splat's; its one face is to be cut at

  bool hasFace(int n) const { return (faces >> n & 1) != 0; }
};

/// `inward`: none to three such vectors. `faces`: InwardAxes'.
uint32_t packBorderCode(std::span<const glm::dvec3> inward, uint32_t faces = 0);
/// Of a cell in the layer behind a face; kNoBorder where the distance, of the face from the cell's middle in
/// cells, is not in the code's range.
uint32_t packLayerCode(const glm::dvec3& inward, double distance);
/// Of a merged splat; distance as above, the splats behind it are `ratio` times as long as twice that. kNoBorder as above.
uint32_t packMergedCode(const glm::dvec3& inward, double distance, double ratio);
InwardAxes inwardAxes(uint32_t border_code);

/// False for what packBorderCode() gives to no cell; whatever passes has inward axes.
bool isPossibleBorderCode(uint32_t border_code);

// How the renderer draws a cell at a border: cut, as one wider splat of which the part behind the face is not
// drawn (render/project/border_parts.h), or in two parts, a narrow one at the border and a wide one behind
// it. In units of the cell's length in that direction, from its middle inwards; the shares are of its weight.
struct BorderPart {
  float offset, size, share;
};
struct BorderStyle {
  BorderPart cut;
  std::array<BorderPart, 2> parts;  // their shares sum to one
};

// By least squares in one dimension, for the step that a uniform half space is. `kHalf`: half cells, of
// nodes; `kWhole`: cells of cell-centred data.
//
//                   squared error   outside of the border   density behind it
//   kHalf   one splat       0.048        0.079                 0.83 and more
//           in parts        0.019        0.033                 0.87 to 1.07
//           cut            0.0004        0.010, of the next layer's splats    0.989 to 1.004
//   kWhole  one splat       0.083        0.138
//           in parts        0.027        0.045                 0.87 and more
//           cut            0.0008        0                     0.932 to 1.030
inline constexpr BorderStyle kHalfCellStyle{{-0.646f, 2.13f, 2.31f},
                                            {{{-0.286f, 0.336f, 0.264f}, {0.3f, 0.998f, 0.736f}}}};
inline constexpr BorderStyle kWholeCellStyle{{-0.243f, 1.264f, 1.507f},
                                             {{{-0.342f, 0.25f, 0.197f}, {0.111f, 0.769f, 0.803f}}}};

/// How a merged splat with `inward.ratio` is drawn, in units of its length: as `cut` above, which is this for the ratios 2
/// (kHalf) and 1 (kWhole). The same least squares for any ratio, as polynomials of its inverse; squared errors are
/// 0.004 at the smallest ratio, 0.001 and less from 1 on.
BorderPart mergedPart(const InwardAxes& inward);

/// How much farther than the splat itself it reaches as it is drawn, at the most, in units of its largest
/// axis: the inner parts' offset along three axes; and a half cell's wide splat, but for what lies behind the
/// face. Of a merged splat's code: in units of its length in the code's direction.
inline constexpr double kPartsReach = 0.52, kCutReach = 1.25, kMergedReach = 2.9;
double borderReach(uint32_t border_code);
/// |w|, as stream/model/splats.h has it, of the splat as it is drawn, at the most.
double drawnSlope(const glm::dvec3& slope, uint32_t border_code);
/// By inwardAxes() of its code.
double drawnSlope(const glm::dvec3& slope, const InwardAxes& inward);
/// What half cells that shrink inwards add to the size of a cut (render/project/border_parts.cpp). Caches without
/// kMergedBorders recorded slopes without it: drawnSlope() is at most kEarlierSlopes times as large.
inline constexpr double kWidening = 0.13;
inline constexpr double kEarlierSlopes = 1 + kWidening / kHalfCellStyle.cut.size;

}  // namespace curvisplat
