#include "render/export/gaussian_splats.h"

#include <glm/geometric.hpp>
#include <glm/gtc/matrix_transform.hpp>
#include <glm/mat3x3.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <map>
#include <numbers>
#include <queue>
#include <utility>
#include <vector>

#include "render/colour/classification.h"
#include "stream/base/error.h"
#include "stream/model/kernel.h"

namespace curvisplat {
namespace {

constexpr float kMinOpacity = 1.0f / 255;
// Viewers blend in eight bits: much of what splats fainter than this absorb is rounded away. Finer levels, whose splats are
// fainter, are left out where they would have more than a share of it in such splats.
constexpr float kFaintOpacity = 0.015f;
constexpr double kMaxFaint = 0.3;
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

/// Classifies the splats of bricks.
struct Classifier {
  const CacheReader& cache;
  size_t variable;
  ClassificationTable table;
};

/// The Gaussians of a brick, and how much of what they absorb is absorbed by faint ones, 0 to 1.
struct BrickGaussians {
  std::vector<GaussianSplat> splats;
  double faint = 0, all = 0;  // opacity times area
};

BrickGaussians gaussiansOf(const Classifier& classifier, uint32_t brick) {
  const CacheReader& cache = classifier.cache;
  SplatGeometry g;
  SplatVariable v;
  cache.readGeometry(brick, g);
  cache.readVariable(brick, classifier.variable, v);
  const glm::dvec3 corner = cache.manifest().root.cellMin(cache.bricks()[brick].cell);
  BrickGaussians out;
  for (size_t n = 0; n < g.size(); ++n) {
    const double slope2 = double{v.slope0[n]} * v.slope0[n] + double{v.slope1[n]} * v.slope1[n] +
                          double{v.slope2[n]} * v.slope2[n];
    const double half_width =
        std::sqrt(3 * (kKernelSigma * kKernelSigma * slope2 + std::max(0.0f, v.variance[n])));
    const glm::dvec4 mean = classifier.table.mean(v.mean[n], half_width);
    if (!(mean.w > 0)) continue;
    const double a0 = g.axis0[n], a1 = g.axis1[n], a2 = g.axis2[n];
    const glm::dmat3 a{a0, a0 * g.shear10[n], a0 * g.shear20[n], 0, a1, a1 * g.shear21[n], 0, 0, a2};
    GaussianSplat splat = gaussianOf(corner + glm::dvec3(g.x[n], g.y[n], g.z[n]), a, g.weight[n], mean.w);
    const glm::vec3& d = splat.deviation;
    const double absorbed = splat.opacity * surfaceOf(glm::dvec3(d));
    out.all += absorbed;
    if (splat.opacity < kFaintOpacity) out.faint += absorbed;
    if (splat.opacity < kMinOpacity) continue;
    // Viewers leave out where a footprint is under 1/255: 1/(255 o) of it.
    splat.opacity = std::min(splat.opacity + kMinOpacity, static_cast<float>(kMaxOpacity));
    splat.colour = glm::vec3(glm::dvec3(mean) / mean.w);
    out.splats.push_back(splat);
  }
  return out;
}

/// A brick that may be replaced by its children.
struct Candidate {
  uint32_t brick;
  float error;
  bool operator<(const Candidate& other) const {
    return error != other.error ? error < other.error : brick > other.brick;
  }
};

/// Goes down the octree, the largest detail first, as far as the limit allows and the splats do not become faint.
class FinestChoice {
 public:
  FinestChoice(const CacheReader& cache, const Classifier& classifier, uint64_t max_splats)
      : cache_(cache), classifier_(classifier), max_splats_(max_splats) {
    for (uint32_t n = 0; n < cache.bricks().size() && cache.bricks()[n].parent == kNoBrick; ++n) take(n);
    if (splats_ > max_splats)
      throw UsageError(
          "{}: --max-splats {} is less than the coarsest level has ({} splats); give at least that",
          cache.path().string(), max_splats, splats_);
  }

  std::vector<GaussianSplat> run(Progress& progress) {
    progress.begin("exporting", cache_.bricks().size(), "bricks");
    while (!candidates_.empty()) {
      const Candidate next = candidates_.top();
      candidates_.pop();
      refine(next.brick);
      progress.advance(1);
    }
    progress.end();
    std::vector<GaussianSplat> out;
    for (const auto& [brick, gaussians] : taken_) {
      (void)brick;
      out.insert(out.end(), gaussians.splats.begin(), gaussians.splats.end());
    }
    return out;
  }

 private:
  void take(uint32_t brick) {
    taken_.emplace(brick, gaussiansOf(classifier_, brick));
    added(brick);
  }
  void added(uint32_t brick) {
    splats_ += cache_.bricks()[brick].splats;
    if (!cache_.bricks()[brick].isLeaf()) candidates_.push({brick, cache_.bricks()[brick].error});
  }

  void refine(uint32_t number) {
    const Brick& brick = cache_.bricks()[number];
    uint64_t splats = splats_ - brick.splats;
    for (uint32_t n = 0; n < brick.child_count; ++n) splats += cache_.bricks()[brick.first_child + n].splats;
    if (splats > max_splats_) return;
    std::vector<BrickGaussians> children;
    double faint = 0, all = 0;
    for (uint32_t n = 0; n < brick.child_count; ++n) {
      children.push_back(gaussiansOf(classifier_, brick.first_child + n));
      faint += children.back().faint;
      all += children.back().all;
    }
    if (faint > kMaxFaint * all) return;
    taken_.erase(number);
    splats_ -= brick.splats;
    for (uint32_t n = 0; n < brick.child_count; ++n) {
      taken_.emplace(brick.first_child + n, std::move(children[n]));
      added(brick.first_child + n);
    }
  }

  const CacheReader& cache_;
  const Classifier& classifier_;
  const uint64_t max_splats_;
  std::map<uint32_t, BrickGaussians> taken_;
  std::priority_queue<Candidate> candidates_;
  uint64_t splats_ = 0;
};

}  // namespace

GaussianOpacity gaussianOpacity(double optical_depth) {
  const double opacity = -std::expm1(-optical_depth);
  if (!(optical_depth > 1e-6)) return {opacity, 1};
  // Ein(τ) = Σ -(-τ)^n / (n n!), summed to convergence; for large τ it is ln τ + γ + E1(τ), E1 negligible.
  double ein = 0;
  if (optical_depth < 20) {
    double term = 1;
    for (int n = 1; n < 100; ++n) {
      term *= -optical_depth / n;
      ein -= term / n;
    }
  } else {
    ein = std::log(optical_depth) + std::numbers::egamma;
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
  const Classifier classifier{cache, variable, ClassificationTable::of(function, info.min, info.max)};
  return FinestChoice(cache, classifier, max_splats).run(progress);
}

namespace {

constexpr double kLowPassPx2 = 0.3;
constexpr float kMinAlpha = 1.0f / 255, kMaxAlpha = 0.99f;  // as the published renderer has them

struct View {
  glm::dvec3 right, down, forward, position;
  double pixels;  // to a world unit
};

View viewOf(const Camera& camera, ImageSize size) {
  if (camera.projection != Projection::kOrthographic)
    throw UsageError("Gaussian splats are compared with orthographic cameras only");
  View view;
  const ViewAxes axes = camera.axes();
  view.forward = axes.forward;
  view.right = axes.right;
  view.down = -axes.up;
  view.position = camera.focal_point;
  view.pixels = 0.5 * size.height / camera.parallel_scale;
  return view;
}

/// One splat on the screen: its ellipse is xx x² + 2 xy x y + yy y² = q.
struct Footprint {
  float x, y, xx, xy, yy, reach_x, reach_y;
};

Footprint footprintOf(const GaussianSplat& splat, const View& view, ImageSize size) {
  const glm::dmat3 axes = glm::mat3_cast(glm::dquat(splat.rotation));
  double cxx = kLowPassPx2, cxy = 0, cyy = kLowPassPx2;
  for (int axis = 0; axis < 3; ++axis) {
    const glm::dvec3 along = axes[axis] * (view.pixels * static_cast<double>(splat.deviation[axis]));
    const double u = glm::dot(along, view.right), v = glm::dot(along, view.down);
    cxx += u * u;
    cxy += u * v;
    cyy += v * v;
  }
  const double determinant = cxx * cyy - cxy * cxy;
  const glm::dvec3 from = glm::dvec3(splat.position) - view.position;
  // As far as the alpha of an opaque one is 1/255.
  const double reach = std::sqrt(2 * std::log(255.0));
  return {static_cast<float>(0.5 * size.width + view.pixels * glm::dot(from, view.right)),
          static_cast<float>(0.5 * size.height + view.pixels * glm::dot(from, view.down)),
          static_cast<float>(cyy / determinant),
          static_cast<float>(-cxy / determinant),
          static_cast<float>(cxx / determinant),
          static_cast<float>(reach * std::sqrt(cxx)),
          static_cast<float>(reach * std::sqrt(cyy))};
}

/// The whole pixels whose middles lie in [middle - reach, middle + reach], within 0 .. size - 1.
std::pair<int, int> pixelsIn(float middle, float reach, int size) {
  const float first = std::ceil(middle - reach - 0.5f), last = std::floor(middle + reach - 0.5f);
  return {static_cast<int>(std::clamp(first, 0.0f, static_cast<float>(size))),
          static_cast<int>(std::clamp(last, -1.0f, static_cast<float>(size - 1)))};
}

void blend(const GaussianSplat& splat, const Footprint& print, Image& image) {
  const auto [x0, x1] = pixelsIn(print.x, print.reach_x, image.size.width);
  const auto [y0, y1] = pixelsIn(print.y, print.reach_y, image.size.height);
  for (int y = y0; y <= y1; ++y) {
    const float dy = static_cast<float>(y) + 0.5f - print.y;
    for (int x = x0; x <= x1; ++x) {
      const float dx = static_cast<float>(x) + 0.5f - print.x;
      const float q = print.xx * dx * dx + 2 * print.xy * dx * dy + print.yy * dy * dy;
      const float alpha = std::min(kMaxAlpha, splat.opacity * std::exp(-0.5f * q));
      if (alpha < kMinAlpha) continue;
      float* pixel = image.pixel(x, y);  // front to back: [3] is what is absorbed so far
      const float share = (1 - pixel[3]) * alpha;
      for (int c = 0; c < 3; ++c) pixel[c] += share * splat.colour[c];
      pixel[3] += share;
    }
  }
}

}  // namespace

Image drawGaussians(std::span<const GaussianSplat> splats, const Camera& camera, ImageSize size) {
  const View view = viewOf(camera, size);
  std::vector<std::pair<float, uint32_t>> order(splats.size());
  for (uint32_t n = 0; n < splats.size(); ++n)
    order[n] = {static_cast<float>(glm::dot(glm::dvec3(splats[n].position) - view.position, view.forward)),
                n};
  std::sort(order.begin(), order.end());
  Image image(size);
  for (const auto& [depth, n] : order) blend(splats[n], footprintOf(splats[n], view, size), image);
  for (size_t at = 0; at < image.rgba.size(); at += 4) {
    for (size_t c = 0; c < 3; ++c) image.rgba[at + c] += 1 - image.rgba[at + 3];
    image.rgba[at + 3] = 1;
  }
  return image;
}

}  // namespace curvisplat
