// Splats: one by one in double precision, as conversion makes and merges them; a brick of them in double
// precision, on its way into the codec or out of it; and a decoded brick as structures of arrays in float,
// relative to the brick's cell, as rendering reads it. Also how far splats reach. Plain data and pure
// functions: any thread may use them.
//
//   shape    S = A Aᵀ, A lower triangular with positive diagonal:
//
//                | a0                 |      a = axis0..2    (LDLᵀ: D = diag(a²))
//            A = | a0 l10  a1         |      l = shear10, shear20, shear21
//                | a0 l20  a1 l21  a2 |
//
//            The kernel's unit sphere maps to {A u : |u| <= 1}. √det S = a0 a1 a2. S is never inverted: A⁻¹
//            is a forward substitution.
//   weight   V: the volume of the piece of space that the splat stands for. For a regular cell that is
//            a0 a1 a2, but not if the splat was stretched, its cell is bent, an axis was floored or splats
//            were merged.
//   mean     f, the scalar at the centre
//   slope    w = A⁻¹ h, the change of the scalar along A's columns: f(x) = f + w · A⁻¹(x - μ). So the h of
//            DESIGN.md, "Splats", is A w, and hᵀS⁻¹h = |w|². For a node w is the computational gradient
//            ∇_c f in a rotated frame: no division by a small cell.
//   variance r >= 0, the residual in-cell variance: t of DESIGN.md is |w|²/12 + r. Zero for a node's cell.
#pragma once

#include <glm/mat3x3.hpp>
#include <glm/vec3.hpp>

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <type_traits>
#include <vector>

#include "stream/model/border_code.h"
#include "stream/model/growth_code.h"
#include "stream/model/octree.h"

namespace curvisplat {

/// `count` nodes that follow one another along i in one block: nodes (i..i+count-1, j, k).
struct NodeRun {
  uint32_t block = 0;
  uint64_t i = 0, j = 0, k = 0;
  uint64_t count = 0;
  bool operator==(const NodeRun&) const = default;
};

/// One splat in double precision, as conversion computes and merges it. World units.
struct Splat {
  glm::dvec3 position{0.0};
  std::array<double, 3> axis{1, 1, 1};   // a0, a1, a2: > 0
  std::array<double, 3> shear{0, 0, 0};  // l10, l20, l21
  double weight = 0;

  /// A, in GLM's column-major convention: factor()[column][row].
  glm::dmat3 factor() const {
    return {axis[0], axis[0] * shear[0], axis[0] * shear[1], 0, axis[1], axis[1] * shear[2], 0, 0, axis[2]};
  }
};

/// One scalar of one splat, in double precision and the scalar's unit (the variance: squared).
struct SplatScalar {
  double mean = 0;
  glm::dvec3 slope{0.0};
  double variance = 0;
};

/// The codes that describe a splat's surroundings.
struct SplatCodes {
  uint32_t border = kNoBorder, growth = kNoGrowth;  // border_code.h, growth_code.h
};

/// The geometry of a brick's splats, decoded. All arrays have size() elements.
struct SplatGeometry {
  std::vector<float> x, y, z;              // world units from the minimum corner of the brick's cell, >= 0
  std::vector<float> axis0, axis1, axis2;  // world units
  std::vector<float> shear10, shear20, shear21;
  std::vector<float> weight;          // world units cubed
  std::vector<uint32_t> border_code;  // stream/model/border_code.h: kNoBorder except for cells at a border
  std::vector<uint32_t> growth_code;  // stream/model/growth_code.h: kNoGrowth where cells grow little

  size_t size() const { return x.size(); }
  void resize(size_t count);
};

/// Calls visit() with each array of a SplatGeometry or a GeometryArrays; the codes, which are of another
/// type, come last.
template <typename Geometry, typename Visit>
void forEachArrayOfGeometry(Geometry&& g, Visit&& visit) {
  for (auto* array :
       {&g.x, &g.y, &g.z, &g.axis0, &g.axis1, &g.axis2, &g.shear10, &g.shear20, &g.shear21, &g.weight})
    visit(*array);
  visit(g.border_code);
  visit(g.growth_code);
}
/// Calls visit() with each array of a SplatVariable or a VariableArrays.
template <typename Variable, typename Visit>
void forEachArrayOfVariable(Variable&& v, Visit&& visit) {
  for (auto* array : {&v.mean, &v.slope0, &v.slope1, &v.slope2, &v.variance}) visit(*array);
}
/// How many arrays these two functions visit together.
inline constexpr size_t kArraysOfSplats = 17;

/// The geometry's arrays, borrowed: where a decoder writes (T = float) or a projector reads (T = const
/// float). Each has `count` elements.
template <typename T>
struct GeometryArrays {
  T *x, *y, *z;
  T *axis0, *axis1, *axis2;
  T *shear10, *shear20, *shear21;
  T* weight;
  std::conditional_t<std::is_const_v<T>, const uint32_t, uint32_t>*border_code, *growth_code;
  size_t count;

  size_t size() const { return count; }
  operator GeometryArrays<const float>() const requires(!std::is_const_v<T>) {
    return {x, y, z, axis0, axis1, axis2, shear10, shear20, shear21, weight, border_code, growth_code, count};
  }
};

/// One variable of a brick's splats, decoded. The same order as the geometry.
struct SplatVariable {
  std::vector<float> mean;
  std::vector<float> slope0, slope1, slope2;  // the scalar's unit, along the columns of A
  std::vector<float> variance;                // the scalar's unit squared

  size_t size() const { return mean.size(); }
  void resize(size_t count);
};

/// The arrays of a SplatVariable, borrowed as in GeometryArrays.
template <typename T>
struct VariableArrays {
  T* mean;
  T *slope0, *slope1, *slope2;
  T* variance;
  size_t count;

  size_t size() const { return count; }
  operator VariableArrays<const float>() const requires(!std::is_const_v<T>) {
    return {mean, slope0, slope1, slope2, variance, count};
  }
};

/// The arrays, to write into or to read from. They are valid until the next resize().
GeometryArrays<float> arraysOf(SplatGeometry& geometry);
VariableArrays<float> arraysOf(SplatVariable& variable);
GeometryArrays<const float> arraysOf(const SplatGeometry& geometry);
VariableArrays<const float> arraysOf(const SplatVariable& variable);
/// Copy all arrays. Both have the same size.
void copyGeometry(const GeometryArrays<const float>& from, const GeometryArrays<float>& to);
void copyValues(const VariableArrays<const float>& from, const VariableArrays<float>& to);

/// One brick in double precision, in the order in which it will be stored: conversion encodes it, and
/// decodes it for merging.
struct BrickSplats {
  Cell cell;
  std::vector<NodeRun> runs;  // leaves: the nodes behind the splats, counts sum to size(); else empty
  std::vector<RootPosition> positions;              // in `cell`
  std::vector<Splat> splats;                        // .position is ignored in favour of `positions`
  std::vector<uint32_t> border_codes;               // [splat]; stream/model/border_code.h. Empty: no borders
  std::vector<uint32_t> growth_codes;               // [splat]; stream/model/growth_code.h. Empty: no growth
  std::vector<std::vector<SplatScalar>> variables;  // [variable][splat]

  size_t size() const { return splats.size(); }
};

/// The largest singular value of A over `splats`: the longest half axis of the kernel's unit sphere. At most
/// 1e-6 too large, never too small. World units.
double largestSingularValue(std::span<const Splat> splats);

/// The smallest singular value of A over `splats`: at most 1e-6 too small, and too large by a ratio of at
/// most 1 + `slack`. A little slack saves much time. The precision of positions depends on it. World units.
double smallestSingularValue(std::span<const Splat> splats, double slack = 0);

/// The farthest that any splat's support reaches from its centre, including the supports of the parts that a
/// cell at a border is drawn as. At most 1e-6 too large, except for half cells. `border_codes`: as in
/// BrickSplats. World units.
double largestReach(std::span<const Splat> splats, std::span<const uint32_t> border_codes);

}  // namespace curvisplat
