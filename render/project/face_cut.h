// Computes what a face leaves of a splat along the rays of its pixels: the parameters of its ScreenCut; and where
// the splat lies along them: its ScreenDepth.
//
// With n the face's normal, n · (x - X0) is a linear field like the scalar. At a given pixel it therefore has
// a mean and a deviation, as the scalar has. In the frame of A, with q the normal, B the rows of the map
// times A, and S2' = B Bᵀ + λ (λ is the low-pass, which antialiases a face that is seen edge-on):
//
//     mean at the offset d  =  distance + (S2'⁻¹ B q) · d
//     variance              =  σ² (1 - qᵀ Bᵀ S2'⁻¹ B q)
//                           =  σ² (λ² + λ (|b0 × q|² + |b1 × q|²) + (b0 × b1 · q)²) / det S2'
//
// The second form is not subject to cancellation. The depth is such a field as well.
#pragma once

#include "render/project/screen_splat.h"
#include "render/project/splat_cutter.h"
#include "render/project/splat_ellipse.h"

namespace curvisplat {

enum class Remains { kNothing, kSome, kAll };

/// Sets `cut` if part of the piece remains. `ellipse` is the ellipse of the piece under `rows`.
Remains cutAtFaces(const ScreenRows& rows, const SplatPiece& piece, const Ellipse& ellipse,
                   float low_pass_px2, ScreenCut& cut);

/// `depth_row`: the depth per unit of the data. `depth`: of the piece's centre.
ScreenDepth depthAlongRay(const ScreenRows& rows, const glm::vec3& depth_row, float depth,
                          const SplatPiece& piece, const Ellipse& ellipse, float low_pass_px2);

/// No part of a splat lies farther from its centre along the view than this times the length of `depth_row`'s
/// image in the frame of A: the support across and the distribution along the ray, at right angles.
inline constexpr float kDepthReach = 1.96f;

}  // namespace curvisplat
