// The reconstruction kernel K(r) and its footprint, in units of the grid spacing. DESIGN.md, "Splats";
// Crawfis and Max, "Texture Splats for 3D Scalar and Vector Field Visualization", 1993.
#pragma once

#include <vector>

#include "stream/model/kernel.h"

namespace curvisplat {

/// K(r), r >= 0; zero from kKernelSupport on, as F is. Its integral over space is 1.
double kernel(double r);

/// F(rho) = ∫ K(√(rho² + t²)) dt, rho >= 0: the integral of a splat's kernel along a ray that passes its
/// centre at the distance rho. Computed by quadrature.
double footprint(double rho);

/// F at equal steps of rho² over [0, kKernelSupport²]: [steps + 1]. F is smooth in rho², and a table over
/// rho² needs no square root when drawing. Linear interpolation is accurate to 1e-5 with 1024 steps or more.
std::vector<double> footprintTable(int steps);

}  // namespace curvisplat
