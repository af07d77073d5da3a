// The border code says in 32 bits where a cell ends at a border, or which faces it lies in the layer behind
// of; and so how the renderer draws it: in parts, cut, or as a pair. A node at the end of its block, or
// beside a blank one, owns half a cell along one axis, two or three; its splat remembers in which directions
// the data goes on. So does the splat of a cell of cell-centred data, though that cell is whole. All
// functions are pure: any thread may call them.
#pragma once

#include <glm/vec3.hpp>

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "stream/model/fits.h"
#include "stream/model/kernel.h"

namespace curvisplat {

// A code has one of five forms. In the first, the cell ends at borders. The directions are unit vectors in
// the frame of the splat's A (A q is from the border inwards, as long as the cell is in that direction) and
// at right angles to one another, since J = A Q with Q orthogonal. They are kept as a rotation, good to
// 0.006 (0.02 at the most) in the cell's own measure whatever its aspect ratio, and each has a bit that says
// how the renderer is to draw it: in parts, or cut at the border's face. A bit of 5-7 that is beyond the
// number of directions marks a further column of the rotation: it leads from a face that the cell is in the
// layer behind of.
//
//   bits 0-1   number of directions
//        2     the third is opposite to the rotation's
//        3-4   which of the quaternion's numbers, w x y z, is the largest and left out
//        5-7   direction 0, 1, 2 starts at a face to be cut at
//        8-31  the quaternion's other numbers, 8 bits each
//
// In the second form, a whole cell is in the layer behind one such face: its splat reaches beyond the face
// and is cut there, too.
//
//   bits 0-1   zero
//        2     one
//        3-7   zero
//        8-23  the direction from the face inwards: the octahedron's map, 8 bits each
//        24-31 how far the face is from the cell's middle, in 1/128 of the cell's length in that direction
//
// The third form is of a merged splat that ends at one face. It is as the second, but with a number n from 1
// to 21 in bits 3-7, and a distance of at most 1. The splats behind it are 3/4 2^((n - 1) / 10) times as long
// as twice the distance, or 3 times as long as the splat, if that is less. It is drawn as the first form is,
// fitted for this ratio: the lattice of voxels makes the layer at a face as thick as it happens to be.
//
// In the fourth form, a cell that ends at no border is behind two or three faces:
//
//   bits 0-2   4
//        3-4   which of the quaternion's numbers is left out
//        5     one for three directions, zero for two
//        6-7   3: more than any ratio of a merged splat
//        8-31  the rotation, as in the first form; the directions are its first columns
//
// The fifth form is of a plate: a merged splat that stands for all that lies between two opposite faces. It
// is as the second, but with 22 in bits 3-7 and a distance of zero; the direction leads from one face to the
// other.
//
// The first version of the format has only zeros in bits 5-7 of the first form, and none of the other forms.

/// The code of a cell that ends at no border and is behind no face.
inline constexpr uint32_t kNoBorder = 0;

/// The directions of a code, from the border or face inwards.
struct InwardAxes {
  std::array<glm::vec3, 3> axis;  // unit length, orthogonal
  int count = 0;                  // 0..3
  uint32_t faces = 0;             // bit n: axis[n] starts at a face to be cut at
  float distance = 0.5f;          // of the faces from the cell's middle, in cells
  bool behind = false;            // the cell is in the layer behind the one face
  float ratio = 0;                // > 0: a merged splat's; its one face is to be cut at
  bool plate = false;             // a merged splat between axis[0]'s two faces, which need not be cut at

  bool hasFace(int n) const { return (faces >> n & 1) != 0; }
};

/// A code of the first form. `inward`: up to three unit vectors at right angles. `faces`: as in InwardAxes.
uint32_t packBorderCode(std::span<const glm::dvec3> inward, uint32_t faces = 0);
/// A code of the second form, of a cell in the layer behind a face. `distance`: of the face from the cell's
/// middle, in cells. kNoBorder if the distance is out of the code's range.
uint32_t packLayerCode(const glm::dvec3& inward, double distance);
/// A code of the third form, of a merged splat. `distance`: as for packLayerCode(); the splats behind it are
/// `ratio` times as long as twice the distance. kNoBorder if the distance is out of the code's range.
uint32_t packMergedCode(const glm::dvec3& inward, double distance, double ratio);
/// A code of the fifth form. `across`: the unit vector from one face of the plate to the other.
uint32_t packPlateCode(const glm::dvec3& across);
/// A code for a cell that is behind faces, at least one: of the first form if it also ends at borders,
/// otherwise of the fourth. `inward`: two or three directions at right angles. The first `count` lead from
/// borders that are faces, the others from faces that the cell is behind; three of the latter are in a
/// right-handed order.
uint32_t packLayersCode(std::span<const glm::dvec3> inward, size_t count);

/// Decodes a code.
InwardAxes inwardAxes(uint32_t border_code);
/// The directions of the code that lead from faces which the cell is behind, in the forms of
/// packLayersCode(): bit n stands for axis[n] of the code's InwardAxes, which is not one of its `count`.
/// Zero for codes of the other forms, the second included (InwardAxes::behind).
uint32_t layersOf(uint32_t border_code);
/// How far such a face is from the cell's middle, in cells, where cells grow steadily inwards by e^growth.
/// It is about one length of the cell: a hundredth of the weight is cut there.
inline float layerDistance(float growth) {
  return 1 + kLayerDistanceByGrowth * growth;
}

/// Whether a code is kNoBorder or has one of the five forms. Only such codes may be passed to the other
/// functions.
bool isPossibleBorderCode(uint32_t border_code);

/// The style of whole cells that are drawn as two splats: the cell itself, which is its `cut`, and the one
/// that would be next to it beyond the face, as cells inside of the grid are drawn
/// (render/project/splat_pieces.cpp).
inline constexpr BorderStyle kWholeCellPairs{{0, 1, 1}, kWholeCellStyle.parts};

inline bool isOfPairs(const BorderStyle& style) {
  return style.cut.size == kWholeCellPairs.cut.size;
}

/// How a merged splat with `inward.ratio` is drawn, in units of its length. It generalises `cut` above,
/// which is the result for the ratios 2 (half cells) and 1 (whole cells).
BorderPart mergedPart(const InwardAxes& inward);

/// How thick a plate is drawn, as a part of its thickness. Other splats are drawn wider than their cells, by
/// kKernelSigma √12, since neighbours overlap; a plate has no neighbours across it.
inline constexpr double kPlateThickness = 0.288675 / kKernelSigma;

/// borderReach() is how much farther than the splat itself its drawn parts reach, at most, in units of its
/// largest axis; for a merged splat's code, in units of its length in the code's direction. kPartsReach is
/// the inner parts' offset along three axes; kCutReach is a half cell's wide splat, without what lies behind
/// the face.
inline constexpr double kPartsReach = 0.52, kCutReach = 1.25, kMergedReach = 2.9;
double borderReach(uint32_t border_code);
/// An upper bound of |w| (stream/model/splats.h) of the splat as it is drawn.
double drawnSlope(const glm::dvec3& slope, uint32_t border_code);
/// The same, for the inwardAxes() of the code.
double drawnSlope(const glm::dvec3& slope, const InwardAxes& inward);
/// The most that half cells which shrink inwards add to the size of a cut (kHalfCutByGrowth). Caches without
/// kMergedBorders recorded slopes without it: drawnSlope() is at most kEarlierSlopes times as large.
inline constexpr double kWidening = 0.13;
inline constexpr double kEarlierSlopes = 1 + kWidening / kHalfCellStyle.cut.size;

}  // namespace curvisplat
