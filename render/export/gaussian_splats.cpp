#include "render/export/gaussian_splats.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/gtc/matrix_transform.hpp>
#include <glm/mat3x3.hpp>
#include <numbers>

#include "render/colour/classification.h"
#include "stream/base/error.h"
#include "stream/model/kernel.h"
#include "stream/paging/cut.h"

namespace curvisplat {
namespace {

constexpr float kMinOpacity = 1.0f / 255;
// Viewers store opacities as logits, and few have more than eight bits.
constexpr double kMaxOpacity = 0.999;

/// The eigenvectors (columns of `axes`, a rotation) and eigenvalues of a symmetric matrix, by Jacobi's rotations.
struct Eigen {
  glm::dmat3 axes{1.0};
  glm::dvec3 values{0.0};

  explicit Eigen(glm::dmat3 m) {
    for (int sweep = 0; sweep < 30; ++sweep) {
      const double off = m[0][1] * m[0][1] + m[0][2] * m[0][2] + m[1][2] * m[1][2];
      const double on = m[0][0] * m[0][0] + m[1][1] * m[1][1] + m[2][2] * m[2][2];
      if (off <= 1e-30 * on) break;
      for (const auto& [p, q] : {std::pair(0, 1), std::pair(0, 2), std::pair(1, 2)}) rotate(m, p, q);
    }
    values = {m[0][0], m[1][1], m[2][2]};
    if (glm::determinant(axes) < 0) axes[2] = -axes[2];
  }

 private:
  void rotate(glm::dmat3& m, int p, int q) {
    if (m[p][q] == 0) return;
    const double theta = (m[q][q] - m[p][p]) / (2 * m[p][q]);
    const double t = std::copysign(1 / (std::abs(theta) + std::hypot(1.0, theta)), theta);
    const double c = 1 / std::hypot(1.0, t), s = t * c;
    glm::dmat3 turn(1.0);
    turn[p][p] = turn[q][q] = c;
    turn[q][p] = s;
    turn[p][q] = -s;
    m = glm::transpose(turn) * m * turn;
    axes = axes * turn;
  }
};

/// Surface area of the ellipsoid with the semi-axes `a`, by Thomsen's formula: 1.1 % off at most.
double surfaceOf(const glm::dvec3& a) {
  constexpr double kPower = 1.6075;
  const double ab = std::pow(a.x * a.y, kPower), ac = std::pow(a.x * a.z, kPower),
               bc = std::pow(a.y * a.z, kPower);
  return 4 * std::numbers::pi * std::pow((ab + ac + bc) / 3, 1 / kPower);
}

/// The cut of all of the data whose bricks have the least detail merged away.
Cut cutOf(const CacheReader& cache, size_t variable, uint64_t max_splats) {
  const auto variables = cache.brickVariables(variable);
  const std::vector<ValueBounds> subtrees = subtreeBounds(cache.bricks(), variables);
  CutView view;  // a world unit is a pixel: detail counts by its size
  CutOptions options;
  options.lod_pixels = 0;
  options.max_splats = max_splats;
  Cut cut = chooseCut(
      {cache.manifest().root, cache.bricks(), variables, subtrees}, view,
      [](const ValueBounds&) { return false; }, options);
  if (cut.splats > max_splats)
    throw UsageError(
        "{}: --max-splats {} is less than the coarsest level has ({} splats); give at least that",
        cache.path().string(), max_splats, cut.splats);
  return cut;
}

}  // namespace

GaussianOpacity gaussianOpacity(double t) {
  const double opacity = -std::expm1(-t);
  if (!(t > 1e-6)) return {opacity, 1};
  // Ein(t) = Σ -(-t)^n / (n n!), summed to convergence; for large t it is ln t + γ + E1(t), E1 negligible.
  double ein = 0;
  if (t < 20) {
    double term = 1;
    for (int n = 1; n < 100; ++n) {
      term *= -t / n;
      ein -= term / n;
    }
  } else {
    ein = std::log(t) + std::numbers::egamma;
  }
  return {opacity, ein / opacity};
}

GaussianSplat gaussianOf(const glm::dvec3& position, const glm::dmat3& a, double weight, double extinction) {
  const Eigen eigen(a * glm::transpose(a));
  const glm::dvec3 axes(std::sqrt(std::max(eigen.values.x, 0.0)), std::sqrt(std::max(eigen.values.y, 0.0)),
                        std::sqrt(std::max(eigen.values.z, 0.0)));
  const double projected = surfaceOf(axes) / (4 * std::numbers::pi);
  const double depth =
      projected > 0 ? extinction * weight / (2 * std::numbers::pi * kKernelSigma * kKernelSigma * projected)
                    : 0;
  const GaussianOpacity opaque = gaussianOpacity(depth);
  GaussianSplat splat;
  splat.position = glm::vec3(position);
  splat.deviation = glm::vec3(kKernelSigma * std::sqrt(opaque.area) * axes);
  splat.rotation = glm::quat(glm::quat_cast(eigen.axes));
  splat.opacity = static_cast<float>(std::min(opaque.opacity, kMaxOpacity));
  return splat;
}

std::vector<GaussianSplat> gaussianSplats(const CacheReader& cache, size_t variable,
                                          const TransferFunction& function, uint64_t max_splats,
                                          Progress& progress) {
  const VariableInfo& info = cache.manifest().variables.at(variable);
  const ClassificationTable table = ClassificationTable::of(function, info.min, info.max);
  const Cut cut = cutOf(cache, variable, max_splats);
  progress.begin("exporting", cut.parts.size(), "bricks");
  std::vector<GaussianSplat> out;
  out.reserve(cut.splats);
  SplatGeometry g;
  SplatVariable v;
  for (const BrickPart& part : cut.parts) {
    const Brick& brick = cache.bricks()[part.brick];
    cache.readGeometry(part.brick, g);
    cache.readVariable(part.brick, variable, v);
    const glm::dvec3 corner = cache.manifest().root.cellMin(brick.cell);
    for (const SplatRange& range : SplatRanges(brick, part.octants))
      for (uint32_t n = range.begin; n < range.end; ++n) {
        const double slope2 = double{v.slope0[n]} * v.slope0[n] + double{v.slope1[n]} * v.slope1[n] +
                              double{v.slope2[n]} * v.slope2[n];
        const double half_width =
            std::sqrt(3 * (kKernelSigma * kKernelSigma * slope2 + std::max(0.0f, v.variance[n])));
        const glm::dvec4 mean = table.mean(v.mean[n], half_width);
        if (!(mean.w > 0)) continue;
        const double a0 = g.axis0[n], a1 = g.axis1[n], a2 = g.axis2[n];
        const glm::dmat3 a{a0, a0 * g.shear10[n], a0 * g.shear20[n], 0, a1, a1 * g.shear21[n], 0, 0, a2};
        GaussianSplat splat = gaussianOf(corner + glm::dvec3(g.x[n], g.y[n], g.z[n]), a, g.weight[n], mean.w);
        if (splat.opacity < kMinOpacity) continue;
        splat.colour = glm::vec3(glm::dvec3(mean) / mean.w);
        out.push_back(splat);
      }
    progress.advance(1);
  }
  progress.end();
  return out;
}

}  // namespace curvisplat
