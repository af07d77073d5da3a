// The field of splats along sixteen rays (iso_rays.h), in the widest vectors there are (Highway): one ray a lane.
//
// A ray's sums run in the order of the splats, whatever the width of the vectors. Pure: any thread. Nothing allocates.
#pragma once

#include <array>
#include <cstddef>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <span>

#include "render/surface/iso_splats.h"

namespace curvisplat {

inline constexpr size_t kIsoRays = 16;
using IsoRow = std::array<float, kIsoRays>;

/// Sixteen rays in view axes: where they are; in perspective at the depth 1.
struct IsoFan {
  glm::dvec2 corner{0.0};  // the first ray
  IsoRow x{}, y{};         // from it
  double base_depth = 0;   // that depths of splats are counted from
  bool perspective = false;
};

/// A splat along the rays, with t = z - middle: 1 - (|u| / support)² = from - by t², f = mean + change t.
struct alignas(64) IsoCrossed {
  IsoRow middle, from, by, mean, change;
  glm::vec3 gradient;  // of the scalar, in view axes
  float weight;
  float begin, end;  // what any ray has of its support lies between them
  float step;        // half its length along the rays
  const IsoSplats::Placed* splat;
};

/// A part of half the support of the shortest splat: how far places of a ray may lie apart.
inline constexpr float kIsoStep = 0.4f;

/// K in x = 1 - (r / support)²: x² times this polynomial, fitted by least squares.
inline constexpr float kIsoKernel[] = {0.0451566f, 0.2057787f, -0.2786960f, 0.7582452f, -0.1769623f};

/// False if no ray meets its support.
bool crossSplat(const IsoSplats::Placed& placed, const IsoFan& fan, IsoCrossed& out);

/// The field at the depths z of the rays: Σ w, and F.
struct IsoField {
  IsoRow weight{}, value{};
};
void sumField(std::span<const IsoCrossed* const> splats, const IsoRow& z, IsoField& field);

/// Bits of the rays whose field has a value between two places, as it is on either side of it at them; and of those where it is on
/// one side at three places, and at the second as near as at the others or nearer. Only where the weight is above `least`.
unsigned crossedRays(const IsoField& begin, const IsoField& end, float value, float least);
unsigned turnedRays(const std::array<const IsoField*, 3>& fields, float value, float least);

/// There: Σ w, and the gradient Σ w ∇f / Σ w in view axes.
struct IsoSlopes {
  IsoRow weight{}, x{}, y{}, z{};
};
void sumSlopes(std::span<const IsoCrossed* const> splats, const IsoRow& z, IsoSlopes& slopes);

/// w of one splat for one ray.
float isoWeight(const IsoCrossed& splat, size_t ray, float z);

}  // namespace curvisplat
