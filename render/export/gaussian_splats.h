// A classified cut of a cache as 3D Gaussian splats, which web viewers and game engines draw (Kerbl et al.,
// "3D Gaussian Splatting for Real-Time Radiance Field Rendering", 2023).
//
// Those splats have one colour and one opacity, the same from all sides, while ours have an optical depth
// that depends on how thick they are along the ray. A splat of weight V, shape S and extinction κ becomes a
// Gaussian of covariance σ_K² S whose peak optical depth is the mean over all directions,
//
//     T = κ V / (2π σ_K² p)      p: mean of √det S₂, a quarter of the surface of the ellipsoid of S, over π
//
// and whose opacity is o = 1 - exp(-T). Its footprint o exp(-q/2) would absorb less than ours, 1 - exp(-T
// exp(-q/2)), so its area is enlarged by Ein(T)/(1 - exp(-T)), where Ein(T) = ∫ (1 - exp(-t))/t dt from 0 to
// T.
//
// drawGaussians() draws them as their viewers do, so that their pictures can be compared with ours. Any
// thread; the same cache gives the same splats.
#pragma once

#include <glm/gtc/quaternion.hpp>
#include <glm/vec3.hpp>

#include <cstdint>
#include <span>
#include <vector>

#include "render/camera/camera.h"
#include "render/colour/transfer_function.h"
#include "render/image/image.h"
#include "stream/base/progress.h"
#include "stream/cache/cache_reader.h"

namespace curvisplat {

/// A 3D Gaussian with one colour and one opacity.
struct GaussianSplat {
  glm::vec3 position{0.0f};   // world units
  glm::vec3 deviation{0.0f};  // standard deviations along its axes, world units
  glm::quat rotation{1, 0, 0, 0};
  glm::vec3 colour{0.0f};  // 0..1
  float opacity = 0;       // at its centre, 0..1
};

/// The look of a Gaussian, from the peak optical depth: the opacity of the centre, and the factor of the
/// footprint's area.
struct GaussianOpacity {
  double opacity, area;
};
GaussianOpacity gaussianOpacity(double optical_depth);

/// The Gaussian for a splat of the shape A (GLM's columns), of weight `weight` and extinction `extinction`;
/// without a colour.
GaussianSplat gaussianOf(const glm::dvec3& position, const glm::dmat3& a, double weight, double extinction);

/// The splats of the finest levels that have at most `max_splats` splats, the largest detail first, as far
/// as they do not become faint: viewers blend in eight bits, which round much of a faint splat away. Those
/// that are nearly transparent (opacity under 1/255, which viewers leave out) are left out, and the others
/// get what viewers leave out of their footprints. Takes 64 bytes a splat. Throws UsageError if the coarsest
/// level has more splats, and as CacheReader does.
std::vector<GaussianSplat> gaussianSplats(const CacheReader& cache, size_t variable,
                                          const TransferFunction& function, uint64_t max_splats,
                                          Progress& progress);

/// Draws splats as their viewers do: sorted by their centres, each o exp(-q/2) over those behind it, its
/// ellipse widened by 0.3 pixels² against aliasing. Over white, orthographic cameras only (UsageError for
/// others). Works on the calling thread: about 0.3 us a splat and 4 ns a pixel that it covers.
Image drawGaussians(std::span<const GaussianSplat> splats, const Camera& camera, ImageSize size);

}  // namespace curvisplat
