// The numbers of splats that were found by fits: how long, skewed and displaced a splat is where cells change in size, and how
// a cell is drawn that ends at a border. What converts uses some, what draws others, and the two have to agree. Each says its
// unit and its meaning. DESIGN.md, "Fits", has what they were fitted to, what they achieve, and what was rejected.
//
// bench/fits.py reads this file, fits the numbers again, and prints the old ones, the new ones and the errors of both. It leaves
// out those that are marked [no script]: they were found around a pole, by trials on a few lines, or with the help of the grids
// of bench/README.md.
#pragma once

#include <array>

namespace curvisplat {

// Lengths, skews and drifts of cells along a grid line, by the logarithms of five extents (preprocess/splats/stretch.h has the
// formulas, and curve, far_curve, slope, bend and q, all without a unit). The logarithm of a splat's length over its cell's:
inline constexpr float kLengthByCurve = 0.1531f, kLengthByCurve2 = 0.0828f, kLengthByBendSlope = -0.0418f;
inline constexpr float kSteepLength = 0.0948f, kSteepLengthByCurve2 = -0.1096f, kSteepLengthByBend = 0.0727f;
// The growth g of cells, for the kernel's skew: the logarithm of a cell's length over the last one's.
inline constexpr float kGrowthByCurve = 0.2892f, kGrowthByFarCurve = -0.0667f;  // times slope
inline constexpr float kGrowthByBend = 0.0676f, kGrowthByBendCurve = 0.1392f, kSteepGrowth = -0.0654f;
/// How far a splat lies from its cell's middle, towards the larger cells, where cells grow by e^g: in cells, for g = 1.
inline constexpr float kDrift = 0.14f;
// Further terms of the drift, in cells.
inline constexpr float kDriftByCurve = 0.0457f, kDriftByBend = 0.0033f, kSteepDrift = 0.0189f;
/// The slope², from which on cells grow steeply. Chosen, not fitted: e^0.42 from cell to cell.
inline constexpr float kSteepFrom = 0.7f;

/// A kernel's third cumulant along an axis, over σ³, where cells grow by e (g = 1).
inline constexpr float kSkewOfGrowth = 0.9f;

/// [no script] Where cells become wider along an axis by e from one to the next (preprocess/splats/dual_cell.h): the drift in the
/// cell's lengths, for e = 1, and what the length loses, as a share of it.
inline constexpr double kWidthDrift = 0.12, kWidthShare = 0.13;

/// [no script] Splats of a mesh's points where faces of cells do not fit together, since nodes hang (preprocess/moments/mesh_splats.h).
/// The way from the point to the splat's middle is m, and κ = mᵀ S⁻¹ m. Points of one side alone have κ = 1/4 and more: S becomes
/// S e^(scale κ) + 12 blur κ m mᵀ, and m becomes m (1 - shift κ). Points of both sides have less: there blur and shift stand
/// without κ.
struct HangingFit {
  double scale, blur, shift;
};
inline constexpr HangingFit kFitOfOneSide{1.7, 1.53, 2.2}, kFitOfBothSides{-1.25, 0.41, -0.2};
/// The first fit takes over from the second between two κ, and the third is the largest that counts.
inline constexpr double kBothSidesUpTo = 0.18, kOneSideFrom = 0.22, kMostAside = 0.5;

/// [no script] Splats of a mesh's cells beside a cell twice as long, and beside one half as long (preprocess/moments/mesh_splats.h): the
/// logarithm of the factor of the length; drift and growth towards the larger cell.
struct SizeFit {
  double length, shift, growth;
};
inline constexpr SizeFit kBesideLarger{0.19, 0.125, 0.468}, kBesideSmaller{-0.039, 0.019, 0.144};

/// [no script] The share of a whole cell's stretch, s - 1, that a half cell at a border has.
inline constexpr double kStretchAtBorder = 0.62;

/// [no script] Cells at and behind faces where the last cell is short (preprocess/splats/face_layers.h), for an excess x: the
/// logarithm of the factor by which the cell is too long. ln of the length's factor; growth; drift inwards, in cells.
struct ShortLastCell {
  double length, growth, drift;
};
inline constexpr ShortLastCell kShortBehindFace{-0.34, 1.25, 0.13}, kShortAtFace{-0.4, 1, 0};

/// How far the face is from the middle of the splat behind it, in cells: 1 and this times g where cells grow inwards by e^g.
inline constexpr float kLayerDistanceByGrowth = -0.106f;

/// A splat that stands for a cell at a border, in units of the cell's length in the direction from the
/// border inwards: its offset from the cell's middle, its size, and its share of the cell's weight.
struct BorderPart {
  float offset, size, share;
};
/// How the renderer draws a cell at a border: cut, as one wider splat of which the part behind the face is
/// not drawn (render/project/splat_pieces.h), or in two parts, a narrow one at the border and a wide one
/// behind it.
struct BorderStyle {
  BorderPart cut;
  std::array<BorderPart, 2> parts;  // their shares sum to one
};
/// The styles of half cells, of nodes, and of whole cells, of cell-centred data, in even grids.
inline constexpr BorderStyle kHalfCellStyle{{-0.646f, 2.13f, 2.31f},
                                            {{{-0.286f, 0.336f, 0.264f}, {0.3f, 0.998f, 0.736f}}}};
inline constexpr BorderStyle kWholeCellStyle{{-0.243f, 1.264f, 1.507f},
                                             {{{-0.342f, 0.25f, 0.197f}, {0.111f, 0.769f, 0.803f}}}};

/// A polynomial of the third degree.
struct FittedCubic {
  float c0, c1, c2, c3;
  constexpr float operator()(float w) const { return c0 + w * (c1 + w * (c2 + w * c3)); }
};
/// A merged splat at a face, by w: twice the distance of the face from its middle over the length of the splats behind it,
/// 1/2 for half cells and 1 for whole ones. Distance of the drawn splat from the face and its size, in lengths of those
/// splats; its share of the weight, over 1 / w.
inline constexpr FittedCubic kMergedDistance{-0.498f, 0.951f, -0.218f, 0.0226f},
    kMergedSize{1, 0.0203f, 0.2107f, 0.0311f}, kMergedShare{1, 0.0938f, 0.4622f, -0.0497f};

/// Changes of BorderStyle::cut where cells grow from the border inwards by e^g, g from -0.25 to 0.5. A half cell's cut changes
/// by g times first + second min(g, 0.3).
inline constexpr BorderPart kHalfCutByGrowth{0.52f, -0.63f, -0.76f}, kHalfCutByGrowth2{0.4f, -0.45f, -0.9f};
/// A whole cell's cut changes by g times this, where cells grow and where they shrink.
inline constexpr BorderPart kWholeCutByGrowth{0.08f, 0.07f, 0}, kWholeCutByShrinking{0.02f, 0.12f, 0.065f};
/// The share of its skew along the direction inwards that a cell keeps which is cut. Chosen, with the numbers above fitted to it.
inline constexpr float kSkewOfCut = 0.6f;

}  // namespace curvisplat
