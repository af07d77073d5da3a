// Splats in double precision into the arrays that are projected.
#pragma once

#include <glm/vec3.hpp>

#include "stream/model/splats.h"

namespace curvisplat {

struct SplatArrays {
  SplatGeometry& geometry;
  SplatVariable& variable;
};

/// Sets splat `n`; `position` is from the arrays' origin.
inline void setSplat(const SplatArrays& arrays, size_t n, const glm::dvec3& position, const Splat& splat,
                     const SplatScalar& scalar, SplatCodes codes = {}) {
  const auto& [geometry, variable] = arrays;
  geometry.x[n] = static_cast<float>(position.x);
  geometry.y[n] = static_cast<float>(position.y);
  geometry.z[n] = static_cast<float>(position.z);
  geometry.axis0[n] = static_cast<float>(splat.axis[0]);
  geometry.axis1[n] = static_cast<float>(splat.axis[1]);
  geometry.axis2[n] = static_cast<float>(splat.axis[2]);
  geometry.shear10[n] = static_cast<float>(splat.shear[0]);
  geometry.shear20[n] = static_cast<float>(splat.shear[1]);
  geometry.shear21[n] = static_cast<float>(splat.shear[2]);
  geometry.weight[n] = static_cast<float>(splat.weight);
  geometry.border_code[n] = codes.border;
  geometry.growth_code[n] = codes.growth;
  variable.mean[n] = static_cast<float>(scalar.mean);
  variable.slope0[n] = static_cast<float>(scalar.slope.x);
  variable.slope1[n] = static_cast<float>(scalar.slope.y);
  variable.slope2[n] = static_cast<float>(scalar.slope.z);
  variable.variance[n] = static_cast<float>(scalar.variance);
}

}  // namespace curvisplat
