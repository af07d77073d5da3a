// A cache's scalar on a regular lattice: means over boxes as large as the lattice is wide, for programs that draw or
// compute on regular grids.
//
// With S' = S + diag(h²) / (12 σ_K²), the splat's shape blurred by the box of sides h, S' = A' A'ᵀ, and the weight
// w = V K(|A'⁻¹(p - μ)|) / √det S',
//
//     density(p) = Σ w      the part of w on the inner side of borders' faces; 1 inside the data to within a tenth, 0 outside
//     value(p)   = Σ w (f + slope' · A'⁻¹(p - μ)) / Σ w        slope' = A'⁻¹ A slope, the regression on what is left
//
// so that splats thinner than the lattice count by their volume, wherever its points happen to lie. Each point's sum runs in
// the order of the bricks: the result depends neither on threads nor on how the lattice is cut into slabs.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <glm/vec3.hpp>
#include <limits>
#include <span>
#include <vector>

#include "stream/base/progress.h"
#include "stream/cache/cache_reader.h"

namespace curvisplat {

/// The points origin + (i, j, k) * spacing, i fastest.
struct SampleLattice {
  glm::dvec3 origin{0.0}, spacing{1.0};
  std::array<uint32_t, 3> size{};

  uint64_t planePoints() const { return uint64_t{size[0]} * size[1]; }
};

/// Planes of a lattice. A value is NaN where the density is at most kMinDensity.
struct FieldSamples {
  std::vector<float> value, density;
};
inline constexpr float kMinDensity = 1.0f / 256;
inline constexpr uint64_t kSampleBytes = 32;  // of a point, while it is sampled

/// The bricks that together hold all of the data, each with at most `detail` (world units) merged away.
std::vector<uint32_t> bricksOfDetail(const CacheReader& cache, double detail);
/// The bricks of a level of the octree, and the leaves above it. UsageError if the cache has no such level.
std::vector<uint32_t> bricksOfLevel(const CacheReader& cache, uint32_t level);
/// The bricks of `bricks` whose splats reach the box.
std::vector<uint32_t> bricksInBox(const CacheReader& cache, std::span<const uint32_t> bricks,
                                  const glm::dvec3& lower, const glm::dvec3& upper);

/// Samples bricks on a regular lattice, slab by slab.
class FieldSampler {
 public:
  /// `cache` must outlive it. The lattice must have a spacing above zero.
  FieldSampler(const CacheReader& cache, size_t variable, std::vector<uint32_t> bricks,
               const SampleLattice& lattice);

  const SampleLattice& lattice() const { return lattice_; }
  /// The planes k_begin .. k_end - 1. Any thread; takes kSampleBytes a point and a decoded brick. Throws as CacheReader does, and
  /// Interrupted after the progress was stopped.
  FieldSamples planes(uint32_t k_begin, uint32_t k_end, const Progress& progress) const;
  /// How many threads (of `threads`; 0: one per core) may sample `slab` planes at a time in this memory; 0: none.
  static unsigned threadsWithin(uint64_t bytes, const SampleLattice& lattice, uint32_t slab,
                                unsigned threads);
  /// All planes, `slab` at a time, on `threads` threads (0: one per core); take() gets them in order, one call at a time.
  void sweep(uint32_t slab, unsigned threads, Progress& progress,
             const std::function<void(uint32_t k_begin, uint32_t k_end, const FieldSamples&)>& take) const;

 private:
  const CacheReader& cache_;
  const size_t variable_;
  const std::vector<uint32_t> bricks_;
  const SampleLattice lattice_;
};

}  // namespace curvisplat
