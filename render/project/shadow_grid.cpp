#include "render/project/shadow_grid.h"

#include <tbb/parallel_for.h>

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <cmath>
#include <span>

#include "render/project/gradient_opacity.h"
#include "stream/cache/coarse_level.h"

namespace curvisplat {
namespace {

constexpr uint64_t kMinSplatsOfLevel = 100'000;  // of the level; eight times as many at most
constexpr int kMaxPoints = 6;                    // of a splat, along an axis
constexpr double kOcclusionReach = 0.125;        // diagonals of the data
constexpr double kMaxAmount = 1e24;              // sums of a million are finite in single precision

/// Lattice cells are cubes in stretched space, except in thin data.
ShadowLattice latticeOver(const glm::dvec3& lower, const glm::dvec3& upper, const glm::dvec3& scale) {
  const glm::dvec3 extent = upper - lower, stretched = scale * extent;
  const double longest = std::max({stretched.x, stretched.y, stretched.z, 1e-300});
  ShadowLattice lattice;
  lattice.lower = lower;
  for (int axis = 0; axis < 3; ++axis) {
    const double cells = std::ceil(stretched[axis] / longest * (ShadowGrid::kMaxNodes - 1));
    const int nodes = std::clamp(static_cast<int>(cells) + 1, ShadowGrid::kMinNodes, ShadowGrid::kMaxNodes);
    lattice.nodes[static_cast<size_t>(axis)] = nodes;
    lattice.edge[axis] = std::max(extent[axis], 1e-6 * longest / scale[axis]) / (nodes - 1);
  }
  return lattice;
}

/// The optical depths of a volume of extinction on a lattice.
class ExtinctionLattice {
 public:
  ExtinctionLattice(const ShadowLattice& lattice, const glm::dvec3& scale)
      : lattice_(lattice), scale_(scale), extinctions_(lattice.size(), 0.0f) {}

  /// Adds the splats of a level. Returns the damaged bricks that it has left out.
  std::vector<std::pair<uint32_t, std::string>> add(const CacheReader& cache, size_t variable,
                                                    const ClassificationTable& table,
                                                    const ShadowScene& scene);
  /// Replaces the sums by extinctions, with a margin: nodes on faces have less of the volume.
  void divide();
  /// [node] the optical depth from there in the direction `towards`, stretched, of length 1, as far as `reach`
  /// or the box's end.
  std::vector<float> depths(const glm::dvec3& towards, double reach) const;

 private:
  void addBox(const glm::dvec3& data, const glm::dvec3& half, double amount);

  const ShadowLattice lattice_;
  const glm::dvec3 scale_;
  std::vector<float> extinctions_;  // [lattice_.size()], then of withMargin(lattice_)
};

/// The shares of a box along an axis that the nodes from `first` on get: each place's goes to the two nodes
/// beside it, the nearer the more. So boxes that fill space give even shares, wherever nodes lie between them.
struct AxisShares {
  AxisShares(double at, double half, int nodes) {
    const double last = nodes - 1, inside = std::clamp(at, 0.0, last);
    const double low = std::max(inside - half, 0.0),
                 high = std::max(std::min(inside + half, last), low + 1e-9);
    first = std::min(static_cast<int>(low), nodes - 2);
    for (int cell = 0; cell < kMaxShares - 1 && first + cell < nodes - 1; ++cell) {
      const double begin = std::max(low - first - cell, 0.0), end = std::min(high - first - cell, 1.0);
      if (end <= begin) break;
      const double share = (end - begin) / (high - low), middle = 0.5 * (begin + end);
      of[static_cast<size_t>(cell)] += share * (1 - middle);
      of[static_cast<size_t>(cell) + 1] = share * middle;
      count = cell + 2;
    }
  }

  static constexpr int kMaxShares = 4;
  int first = 0, count = 0;
  std::array<double, kMaxShares> of{};
};

void ExtinctionLattice::addBox(const glm::dvec3& data, const glm::dvec3& half, double amount) {
  const auto sharesOf = [&](int axis) {
    const double edge = lattice_.edge[axis];
    return AxisShares((data[axis] - lattice_.lower[axis]) / edge, std::min(half[axis] / edge, 1.0),
                      lattice_.nodes[static_cast<size_t>(axis)]);
  };
  const AxisShares x = sharesOf(0), y = sharesOf(1), z = sharesOf(2);
  for (int k = 0; k < z.count; ++k)
    for (int j = 0; j < y.count; ++j) {
      const double of_row = amount * z.of[static_cast<size_t>(k)] * y.of[static_cast<size_t>(j)];
      float* const row = extinctions_.data() + lattice_.index(x.first, y.first + j, z.first + k);
      for (int i = 0; i < x.count; ++i) row[i] += static_cast<float>(of_row * x.of[static_cast<size_t>(i)]);
    }
}

/// A splat's cell as points, close enough together for a lattice.
struct CellPoints {
  CellPoints(const Shape& s, const glm::dvec3& edge)
      : columns{glm::dvec3(s.axis0, s.axis0 * s.shear10, s.axis0 * s.shear20),
                glm::dvec3(0, s.axis1, s.axis1 * s.shear21), glm::dvec3(0, 0, s.axis2)} {
    for (size_t c = 0; c < 3; ++c) {
      const glm::dvec3 cells = glm::abs(columns[c] / edge);
      const double most = std::max({cells.x, cells.y, cells.z});
      along[c] = std::isfinite(most)
                     ? std::clamp(static_cast<int>(std::ceil(std::min(most, 99.0))), 1, kMaxPoints)
                     : 1;
    }
  }
  int count() const { return along[0] * along[1] * along[2]; }
  /// The place of a point, in [-1/2, 1/2] along each column.
  glm::dvec3 placeOf(int n) const {
    const auto part = [](int at, int of) { return (at + 0.5) / of - 0.5; };
    return {part(n % along[0], along[0]), part(n / along[0] % along[1], along[1]),
            part(n / along[0] / along[1], along[2])};
  }
  /// Half of the box around the part of the cell that a point stands for.
  glm::dvec3 halfBox() const {
    glm::dvec3 half(0.0);
    for (size_t c = 0; c < 3; ++c) half += glm::abs(columns[c]) / (2.0 * along[c]);
    return half;
  }
  glm::dvec3 offsetOf(const glm::dvec3& place) const {
    return place.x * columns[0] + place.y * columns[1] + place.z * columns[2];
  }

  std::array<glm::dvec3, 3> columns;
  std::array<int, 3> along{};
};

std::vector<std::pair<uint32_t, std::string>> ExtinctionLattice::add(const CacheReader& cache,
                                                                     size_t variable,
                                                                     const ClassificationTable& table,
                                                                     const ShadowScene& scene) {
  const double cell = lattice_.edge.x * lattice_.edge.y * lattice_.edge.z;
  std::vector<std::pair<uint32_t, std::string>> damaged;
  const glm::vec3 per_scale(1.0 / scale_);
  const auto is_clipped = [&](const glm::dvec3& at) {
    return std::any_of(scene.clip_planes.begin(), scene.clip_planes.end(),
                       [&](const ClipPlane& plane) { return glm::dot(plane.normal, at - plane.point) < 0; });
  };
  SplatGeometry geometry;
  SplatVariable values;
  for (const uint32_t brick : bricksAtALevel(cache, kMinSplatsOfLevel)) {
    const BrickVariable& bounds = cache.brickVariables(variable)[brick];
    const float spread = bounds.largest_slope + 2 * bounds.largest_deviation;  // √3 deviations are looked up
    if (table.fullyTransparent(bounds.min - spread, bounds.max + spread)) continue;
    try {
      cache.readGeometry(brick, geometry);
      cache.readVariable(brick, variable, values);
    } catch (const DamagedBrick& error) {
      if (!scene.leave_out_damaged) throw;
      damaged.emplace_back(brick, error.what());
      continue;
    }
    const glm::dvec3 corner = cache.manifest().root.cellMin(cache.bricks()[brick].cell);
    for (size_t i = 0; i < geometry.size(); ++i) {
      const Shape shape{geometry.axis0[i],   geometry.axis1[i],   geometry.axis2[i],
                        geometry.shear10[i], geometry.shear20[i], geometry.shear21[i]};
      const Slope slope{values.slope0[i], values.slope1[i], values.slope2[i]};
      const glm::dvec3 w(slope.w0, slope.w1, slope.w2);
      const CellPoints points(shape, lattice_.edge);
      double volume = geometry.weight[i] / cell / points.count();  // of lattice cells
      if (scene.gradient)
        volume *= double{scene.gradient->of(glm::length(gradientOf(shape, slope, per_scale)))};
      if (!(volume > 0 && std::isfinite(volume))) continue;
      const glm::dvec3 centre = corner + glm::dvec3(geometry.x[i], geometry.y[i], geometry.z[i]);
      const glm::dvec3 within(w.x / points.along[0], w.y / points.along[1], w.z / points.along[2]);
      const double half_width =
          std::sqrt(3 * std::max(0.0, double{values.variance[i]}) + 0.25 * glm::dot(within, within));
      const glm::dvec3 half = points.halfBox();
      for (int n = 0; n < points.count(); ++n) {
        const glm::dvec3 place = points.placeOf(n), at = centre + points.offsetOf(place);
        const double extinction = table.mean(double{values.mean[i]} + glm::dot(w, place), half_width).w;
        if (extinction > 0 && !is_clipped(at)) addBox(at, half, std::min(extinction * volume, kMaxAmount));
      }
    }
  }
  return damaged;
}

/// A lattice with one more node at each end of each axis, which has the value of the one at the end: a ray that ends on a
/// face reads beyond it, with no weight or that of a rounding error.
ShadowLattice withMargin(const ShadowLattice& lattice) {
  ShadowLattice wider = lattice;
  for (int& nodes : wider.nodes) nodes += 2;
  return wider;
}

std::vector<float> valuesWithMargin(const ShadowLattice& lattice, const std::vector<float>& values) {
  const ShadowLattice wider = withMargin(lattice);
  std::vector<float> out(wider.size());
  const auto inside = [&](int n, size_t axis) { return std::clamp(n - 1, 0, lattice.nodes[axis] - 1); };
  for (int k = 0; k < wider.nodes[2]; ++k)
    for (int j = 0; j < wider.nodes[1]; ++j)
      for (int i = 0; i < wider.nodes[0]; ++i)
        out[wider.index(i, j, k)] = values[lattice.index(inside(i, 0), inside(j, 1), inside(k, 2))];
  return out;
}

void ExtinctionLattice::divide() {
  const auto& [columns, rows, layers] = lattice_.nodes;
  const auto shareOf = [](int n, int nodes) { return n == 0 || n == nodes - 1 ? 0.5 : 1.0; };
  for (int k = 0; k < layers; ++k)
    for (int j = 0; j < rows; ++j)
      for (int i = 0; i < columns; ++i)
        extinctions_[lattice_.index(i, j, k)] /=
            static_cast<float>(shareOf(i, columns) * shareOf(j, rows) * shareOf(k, layers));
  extinctions_ = valuesWithMargin(lattice_, extinctions_);
}

/// The steps of rays in one direction over a lattice, from one layer of nodes to the next, across the axis along which they
/// pass most of them. Rays begin at nodes, so all of them are at the same place between nodes after as many steps.
class RaySteps {
 public:
  /// `passed`: cells along each axis, to a unit of length; `reach`: the length of a ray.
  RaySteps(const ShadowLattice& lattice, const glm::dvec3& passed, double reach) : nodes_(lattice.nodes) {
    const glm::dvec3 most = glm::abs(passed);
    const int main = most.x >= most.y && most.x >= most.z ? 0 : most.y >= most.z ? 1 : 2;
    length_ = 1 / most[main];
    step_ = passed * length_;
    most_ = reach / length_;
    u_ = static_cast<size_t>((main + 1) % 3);
    v_ = static_cast<size_t>((main + 2) % 3);
  }

  double length() const { return length_; }  // of a step
  size_t u() const { return u_; }            // the axes across
  size_t v() const { return v_; }

  /// How many steps a ray from a node goes, as far as its reach or the lattice's end.
  double from(const std::array<int, 3>& node) const {
    double steps = most_;
    for (size_t a = 0; a < 3; ++a) {
      const double step = step_[static_cast<int>(a)];
      if (step > 0) steps = std::min(steps, (nodes_[a] - 1 - node[a]) / step);
      if (step < 0) steps = std::min(steps, node[a] / -step);
    }
    return steps;
  }

  struct Place {
    std::array<int, 3> node{};  // from the ray's own
    float on_u = 0, on_v = 0;   // the part of the way to the next one along u, along v
  };
  Place after(int steps) const {
    Place place;
    const auto split = [&](size_t axis) {
      const double moved = steps * step_[static_cast<int>(axis)], whole = std::floor(moved);
      place.node[axis] = static_cast<int>(whole);
      return static_cast<float>(moved - whole);
    };
    for (size_t a = 0; a < 3; ++a)
      if (a != u_ && a != v_) place.node[a] = step_[static_cast<int>(a)] > 0 ? steps : -steps;
    place.on_u = split(u_);
    place.on_v = split(v_);
    return place;
  }

 private:
  std::array<int, 3> nodes_;
  double length_ = 1, most_ = 0;
  glm::dvec3 step_{0.0};
  size_t u_ = 1, v_ = 2;
};

/// The trapezoidal rule: within a layer of nodes values are bilinear. What is left at the end counts as the last sample.
std::vector<float> ExtinctionLattice::depths(const glm::dvec3& towards, double reach) const {
  const RaySteps rays(lattice_, towards / (scale_ * lattice_.edge), reach);
  const ShadowLattice wider = withMargin(lattice_);
  const std::array<size_t, 3> strides{1, wider.index(0, 1, 0), wider.index(0, 0, 1)};
  const size_t along_u = strides[rays.u()], along_v = strides[rays.v()];
  struct Sample {
    std::ptrdiff_t offset;
    float on_u, on_v;
  };
  std::vector<Sample> samples;
  const int most = *std::max_element(lattice_.nodes.begin(), lattice_.nodes.end());
  for (int n = 0; n < most; ++n) {
    const RaySteps::Place place = rays.after(n);
    std::ptrdiff_t offset = 0;
    for (size_t a = 0; a < 3; ++a) offset += place.node[a] * static_cast<std::ptrdiff_t>(strides[a]);
    samples.push_back({offset, place.on_u, place.on_v});
  }

  std::vector<float> out(lattice_.size());
  const auto depthFrom = [&](const std::array<int, 3>& node) {
    const double steps = rays.from(node);
    const auto whole = static_cast<int>(steps);
    const double rest = steps - whole;
    const float* const own = extinctions_.data() + wider.index(node[0] + 1, node[1] + 1, node[2] + 1);
    const auto at = [&](const Sample& sample) {
      const float* const corner = own + sample.offset;
      const float* const next = corner + along_v;
      const float here = corner[0] + sample.on_u * (corner[along_u] - corner[0]);
      const float there = next[0] + sample.on_u * (next[along_u] - next[0]);
      return double{here + sample.on_v * (there - here)};
    };
    if (whole == 0) return static_cast<float>(rays.length() * rest * double{*own});
    double sum = 0.5 * double{*own};
    for (int n = 1; n < whole; ++n) sum += at(samples[static_cast<size_t>(n)]);
    sum += (0.5 + rest) * at(samples[static_cast<size_t>(whole)]);
    return static_cast<float>(rays.length() * sum);
  };
  tbb::parallel_for(0, lattice_.nodes[2], [&](int k) {
    for (int j = 0; j < lattice_.nodes[1]; ++j)
      for (int i = 0; i < lattice_.nodes[0]; ++i) out[lattice_.index(i, j, k)] = depthFrom({i, j, k});
  });
  return out;
}

/// The directions of ambient light: towards the faces and the corners of a cube.
std::vector<glm::dvec3> directionsAround() {
  std::vector<glm::dvec3> directions;
  for (int axis = 0; axis < 3; ++axis)
    for (const double sign : {-1.0, 1.0}) {
      glm::dvec3 direction(0.0);
      direction[axis] = sign;
      directions.push_back(direction);
    }
  for (int n = 0; n < 8; ++n)
    directions.push_back(glm::normalize(glm::dvec3(n & 1 ? 1 : -1, n & 2 ? 1 : -1, n & 4 ? 1 : -1)));
  return directions;
}

}  // namespace

std::vector<double> ShadowGrid::keyOf(const ShadowScene& scene) {
  const Light& light = scene.light;
  std::vector<double> key;
  const auto add = [&key](const glm::dvec3& of) {
    for (int axis = 0; axis < 3; ++axis) key.push_back(of[axis]);
  };
  add(light.shadow > 0 ? light.towards.value_or(glm::dvec3(0.0)) : glm::dvec3(0.0));
  add({light.shadow, light.ambient_occlusion, scene.leave_out_damaged});
  add(scene.scale);
  key.push_back(static_cast<double>(scene.clip_planes.size()));
  for (const ClipPlane& plane : scene.clip_planes) {
    add(plane.point);
    add(plane.normal);
  }
  return key;
}

ShadowGrid::ShadowGrid(const CacheReader& cache, size_t variable, const ClassificationTable& table,
                       const ShadowScene& scene)
    : lattice_(latticeOver(cache.manifest().lower, cache.manifest().upper, scene.scale)),
      arriving_(lattice_.size(), 1.0f) {
  const Light& light = scene.light;
  const glm::dvec3 stretched = scene.scale * (cache.manifest().upper - cache.manifest().lower);
  ExtinctionLattice extinctions(lattice_, scene.scale);
  damaged_ = extinctions.add(cache, variable, table, scene);
  extinctions.divide();
  if (light.ambient_occlusion > 0) {
    const std::vector<glm::dvec3> directions = directionsAround();
    const float share = light.ambient_occlusion / static_cast<float>(directions.size());
    for (const glm::dvec3& direction : directions) {
      const std::vector<float> depths =
          extinctions.depths(direction, kOcclusionReach * glm::length(stretched));
      for (size_t n = 0; n < depths.size(); ++n) arriving_[n] -= share * -std::expm1(-depths[n]);
    }
  }
  if (light.shadow > 0 && light.towards) {
    const std::vector<float> depths =
        extinctions.depths(glm::normalize(*light.towards), glm::length(stretched));
    for (size_t n = 0; n < depths.size(); ++n) arriving_[n] *= 1 - light.shadow * -std::expm1(-depths[n]);
  }
}

}  // namespace curvisplat
