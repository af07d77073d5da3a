#include "stream/paging/layer_merger.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <limits>
#include <span>

#include "stream/base/error.h"
#include "stream/model/kernel.h"

namespace curvisplat {
namespace {

constexpr uint32_t kNone = 0x7fffffff;     // no splat follows
constexpr uint32_t kFollows = 0x80000000;  // another one comes before it
constexpr double kMaxVoxels = 1 << 20;     // along an axis

/// A symmetric matrix: its lower triangle.
struct Moments {
  double xx = 0, xy = 0, yy = 0, xz = 0, yz = 0, zz = 0;

  double trace() const { return xx + yy + zz; }
  void add(double weight, const Moments& s) {
    xx += weight * s.xx;
    xy += weight * s.xy;
    yy += weight * s.yy;
    xz += weight * s.xz;
    yz += weight * s.yz;
    zz += weight * s.zz;
  }
  static Moments squareOf(const glm::dvec3& v) {
    return {v.x * v.x, v.x * v.y, v.y * v.y, v.x * v.z, v.y * v.z, v.z * v.z};
  }
};

/// A, the lower triangular factor of a shape S = A Aᵀ.
struct Factor {
  double a00, a10, a11, a20, a21, a22;

  static Factor of(const SplatGeometry& g, size_t n) {
    const double a0 = g.axis0[n], a1 = g.axis1[n];
    return {a0, a0 * g.shear10[n], a1, a0 * g.shear20[n], a1 * g.shear21[n], g.axis2[n]};
  }
  Moments shape() const {
    return {a00 * a00,
            a10 * a00,
            a10 * a10 + a11 * a11,
            a20 * a00,
            a20 * a10 + a21 * a11,
            a20 * a20 + a21 * a21 + a22 * a22};
  }
  glm::dvec3 times(const glm::dvec3& w) const {
    return {a00 * w.x, a10 * w.x + a11 * w.y, a20 * w.x + a21 * w.y + a22 * w.z};
  }
  glm::dvec3 solve(const glm::dvec3& h) const {
    const double x = h.x / a00, y = (h.y - a10 * x) / a11;
    return {x, y, (h.z - a20 * x - a21 * y) / a22};
  }
};

/// nullopt if S is not positive definite, by rounding.
std::optional<Factor> factorOf(const Moments& s) {
  const double a00 = std::sqrt(s.xx), a10 = s.xy / a00, a20 = s.xz / a00;
  const double d1 = s.yy - a10 * a10, a11 = std::sqrt(d1), a21 = (s.yz - a20 * a10) / a11;
  const double d2 = s.zz - a20 * a20 - a21 * a21;
  if (!(s.xx > 0 && d1 > 0 && d2 > 0)) return std::nullopt;
  return Factor{a00, a10, a11, a20, a21, std::sqrt(d2)};
}

/// A cell that is about twice as wide as thick, and thin for a voxel; lengths in voxels.
struct Layer {
  glm::dvec3 normal;  // a unit vector
  double width2;      // of the width, σ₂: the square of a lower bound within a factor of √2

  /// nullopt if the cell is not thin, or small in all directions.
  static std::optional<Layer> of(Factor a, const glm::dvec3& per_voxel) {
    constexpr double kThin = 0.6, kFlat = 2, kWide = 0.25;
    a = {a.a00 * per_voxel.x, a.a10 * per_voxel.y, a.a11 * per_voxel.y,
         a.a20 * per_voxel.z, a.a21 * per_voxel.z, a.a22 * per_voxel.z};
    const Moments s = a.shape();
    // The adjugate of S, which is nearly (σ₁σ₂)² times the square of the normal.
    const Moments faces{s.yy * s.zz - s.yz * s.yz, s.xz * s.yz - s.xy * s.zz, s.xx * s.zz - s.xz * s.xz,
                        s.xy * s.yz - s.xz * s.yy, s.xy * s.xz - s.xx * s.yz, s.xx * s.yy - s.xy * s.xy};
    const double volume = a.a00 * a.a11 * a.a22;
    const double thickness2 = volume * volume / faces.trace(), width2 = faces.trace() / s.trace();
    if (!(thickness2 <= kThin * kThin && kFlat * kFlat * thickness2 <= width2 && width2 >= kWide * kWide))
      return std::nullopt;
    const glm::dvec3 column = faces.xx >= std::max(faces.yy, faces.zz)
                                  ? glm::dvec3(faces.xx, faces.xy, faces.xz)
                              : faces.yy >= faces.zz ? glm::dvec3(faces.xy, faces.yy, faces.yz)
                                                     : glm::dvec3(faces.xz, faces.yz, faces.zz);
    return Layer{glm::normalize(column), width2};
  }
  /// Whether a cell at this distance lies above or below it. The next one in its layer does not: two that are merged would
  /// leave stripes.
  bool isStackedWith(const glm::dvec3& distance) const {
    constexpr double kAside = 0.6;
    const double along = glm::dot(distance, normal);
    return glm::dot(distance, distance) - along * along <= kAside * kAside * width2;
  }
};

/// The sums of one scalar over the splats of a layer, about the first one's mean.
class ValueSums {
 public:
  ValueSums(const SplatVariable& values, size_t first) : values_(values), first_mean_(values.mean[first]) {}

  void add(size_t n, double weight, const Factor& factor, const glm::dvec3& e) {
    const double d = values_.mean[n] - first_mean_;
    const glm::dvec3 slope(values_.slope0[n], values_.slope1[n], values_.slope2[n]);
    mean_ += weight * d;
    slope_ += weight * (factor.times(slope) + (12 * d) * e);
    variance_ += weight * (glm::dot(slope, slope) / 12 + values_.variance[n] + d * d);
  }

  /// Writes the merged scalar. `shrunk`: the drawn shape's lengths, relative to `factor`'s.
  void finish(double weight, const Factor& factor, const glm::dvec3& centre, double shrunk,
              SplatVariable& out, size_t at) const {
    const double mean = mean_ / weight;
    const double total = std::max(0.0, variance_ / weight - mean * mean);
    glm::dvec3 slope = factor.solve(slope_ / weight - (12 * mean) * centre);
    // A slope never explains more than the variance there is; rounding may say so.
    const double explained = glm::dot(slope, slope) / 12;
    if (explained > total) slope *= std::sqrt(total / explained);
    slope *= shrunk;
    out.mean[at] = static_cast<float>(first_mean_ + mean);
    out.slope0[at] = static_cast<float>(slope.x);
    out.slope1[at] = static_cast<float>(slope.y);
    out.slope2[at] = static_cast<float>(slope.z);
    out.variance[at] = static_cast<float>(std::max(0.0, total - explained));
  }

 private:
  const SplatVariable& values_;
  const double first_mean_;
  double mean_ = 0, variance_ = 0;
  glm::dvec3 slope_{0.0};
};

glm::dvec3 positionOf(const SplatGeometry& g, size_t n) {
  return {g.x[n], g.y[n], g.z[n]};
}

/// How much shorter a shape has to be for its support to stay within a radius.
double shrinkingTo(double radius, const Factor& a) {
  const double most = radius / kKernelSupport;
  if (a.shape().trace() <= most * most) return 1;
  Splat splat;
  splat.axis = {a.a00, a.a11, a.a22};
  splat.shear = {a.a10 / a.a00, a.a20 / a.a00, a.a21 / a.a11};
  return std::min(1.0, (1 - 1e-6) * most / largestSingularValue({&splat, 1}));
}

/// The arrays of a brick that is merged.
struct Decoded {
  SplatGeometry& geometry;
  SplatVariable& values;
  SplatVariable* second;  // null: one scalar
};

void copySplat(size_t from, size_t to, const Decoded& splats) {
  const auto copy = [&](auto& array) { array[to] = array[from]; };
  forEachArrayOfGeometry(splats.geometry, copy);
  forEachArrayOfVariable(splats.values, copy);
  if (splats.second) forEachArrayOfVariable(*splats.second, copy);
}

/// Writes the splat that stands for `first` and those after it, by `next`, to `at`, which is not after `first`. False if
/// they have no shape together.
bool writeMerged(size_t first, std::span<const uint32_t> next, size_t at, double largest_radius,
                 const Decoded& splats) {
  SplatGeometry& g = splats.geometry;
  SplatVariable& values = splats.values;
  SplatVariable* const second = splats.second;
  const glm::dvec3 origin = positionOf(g, first);
  double weight = 0;
  glm::dvec3 centre(0.0);
  Moments shape;
  ValueSums sums(values, first);
  std::optional<ValueSums> second_sums;
  if (second) second_sums.emplace(*second, first);
  for (uint32_t n = static_cast<uint32_t>(first); n != kNone; n = next[n] & ~kFollows) {
    const Factor factor = Factor::of(g, n);
    const double w = g.weight[n];
    const glm::dvec3 e = positionOf(g, n) - origin;
    weight += w;
    centre += w * e;
    shape.add(w, factor.shape());
    shape.add(12 * w, Moments::squareOf(e));
    sums.add(n, w, factor, e);
    if (second) second_sums->add(n, w, factor, e);
  }
  centre /= weight;
  Moments merged;
  merged.add(1 / weight, shape);
  merged.add(-12, Moments::squareOf(centre));
  const std::optional<Factor> factor = factorOf(merged);
  if (!factor) return false;
  const double shrunk = shrinkingTo(largest_radius, *factor);
  g.x[at] = static_cast<float>(origin.x + centre.x);
  g.y[at] = static_cast<float>(origin.y + centre.y);
  g.z[at] = static_cast<float>(origin.z + centre.z);
  g.axis0[at] = static_cast<float>(shrunk * factor->a00);
  g.axis1[at] = static_cast<float>(shrunk * factor->a11);
  g.axis2[at] = static_cast<float>(shrunk * factor->a22);
  g.shear10[at] = static_cast<float>(factor->a10 / factor->a00);
  g.shear20[at] = static_cast<float>(factor->a20 / factor->a00);
  g.shear21[at] = static_cast<float>(factor->a21 / factor->a11);
  g.weight[at] = static_cast<float>(weight);
  g.border_code[at] = kNoBorder;
  g.growth_code[at] = kNoGrowth;
  sums.finish(weight, *factor, centre, shrunk, values, at);
  if (second) second_sums->finish(weight, *factor, centre, shrunk, *second, at);
  return true;
}

}  // namespace

uint16_t ScalarBins::of(float value) const {
  const double v = log_scale ? std::log(std::max(value, std::numeric_limits<float>::min())) : double{value};
  const double position = std::floor(scale * v + bias);
  if (!(position >= 0)) return bins.front();
  return bins[std::min(static_cast<size_t>(std::min(position, 1e9)) + 1, bins.size() - 1)];
}

/// Links the splats of each layer: next_.
void LayerMerger::findLayers(const LayerMerging& merging, const SplatGeometry& g, const SplatVariable& values,
                             const SplatVariable* second) {
  const size_t count = g.size(), slots = std::bit_ceil(count + count / 2 + 1);
  const glm::dvec3 per_voxel = 1.0 / merging.voxel;
  keys_.resize(count);
  next_.assign(count, kNone);
  last_.assign(slots, kNone);
  for (uint32_t n = 0; n < count; ++n) {
    if (g.border_code[n] != kNoBorder || !(g.weight[n] > 0)) continue;
    const auto layer = Layer::of(Factor::of(g, n), per_voxel);
    if (!layer) continue;
    const glm::dvec3 position = per_voxel * positionOf(g, n), at = glm::max(position, 0.0);
    if (!(at.x < kMaxVoxels && at.y < kMaxVoxels && at.z < kMaxVoxels)) continue;
    const auto whole = [](double voxels) { return static_cast<uint64_t>(voxels); };
    const uint32_t second_bin = second && merging.second_bins ? merging.second_bins->of(second->mean[n]) : 0u;
    keys_[n] = {whole(at.x) | whole(at.y) << 20 | whole(at.z) << 40,
                merging.bins.of(values.mean[n]) | second_bin << 16};
    const auto isAnothers = [&](uint32_t last) {
      return keys_[last] != keys_[n] || !layer->isStackedWith(position - per_voxel * positionOf(g, last));
    };
    size_t slot = keys_[n].hash() & (slots - 1);
    while (last_[slot] != kNone && isAnothers(last_[slot])) slot = (slot + 1) & (slots - 1);
    if (last_[slot] != kNone) {
      next_[last_[slot]] = (next_[last_[slot]] & kFollows) | n;
      next_[n] |= kFollows;
    }
    last_[slot] = n;
  }
}

void LayerMerger::merge(const LayerMerging& merging, double largest_radius, SplatGeometry& geometry,
                        SplatVariable& values, SplatVariable* second) {
  findLayers(merging, geometry, values, second);
  const Decoded splats{geometry, values, second};
  size_t left = 0;
  for (size_t n = 0; n < next_.size(); ++n) {
    if (next_[n] & kFollows) continue;
    if (next_[n] == kNone) {
      copySplat(n, left++, splats);
    } else if (writeMerged(n, next_, left, largest_radius, splats)) {
      ++left;
    } else {
      for (uint32_t m = next_[n] & ~kFollows; m != kNone;) {
        const uint32_t after = next_[m] & ~kFollows;
        next_[m] = kNone;
        m = after;
      }
      copySplat(n, left++, splats);
    }
  }
  geometry.resize(left);
  values.resize(left);
  if (second) second->resize(left);
}

}  // namespace curvisplat
