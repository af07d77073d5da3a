#include "preprocess/scenes.h"

#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <numbers>

#include "stream/error.h"

namespace curvisplat {
namespace {

using std::numbers::pi;

double square(double x) {
  return x * x;
}

bool inUnitInterval(double x) {
  return x >= 0 && x <= 1;
}

// Design section 9. Half a pipe around the z axis, on the side of negative x; its floor waves with the angle.
class HalfAnnulus : public Scene {
 public:
  HalfAnnulus(std::string name, double clustering)
      : Scene(std::move(name)), clustering_(clustering), growth_(std::expm1(clustering)) {}

  glm::dvec3 alongU(double u) const override {
    return {-std::sin(pi * u), std::cos(pi * u), kWave * std::sin(3 * pi * u)};
  }
  glm::dvec3 alongV(double v) const override {
    return glm::dvec3(kInner + (kOuter - kInner) * std::expm1(clustering_ * v) / growth_);
  }
  glm::dvec3 alongW(double w) const override { return {0, 0, w}; }
  glm::dvec3 join(const glm::dvec3& of_u, const glm::dvec3& of_v, const glm::dvec3& of_w) const override {
    return of_v * of_u + of_w;
  }

  std::optional<glm::dvec3> inverse(const glm::dvec3& world) const override {
    const double radius = std::hypot(world.x, world.y);
    const double u = std::atan2(-world.x, world.y) / pi;
    const double stretched = (radius - kInner) / (kOuter - kInner);
    const double w = world.z - kWave * radius * std::sin(3 * pi * u);
    if (!inUnitInterval(u) || !inUnitInterval(stretched) || !inUnitInterval(w)) return std::nullopt;
    return glm::dvec3(u, std::log1p(stretched * growth_) / clustering_, w);
  }

  double scalar(const glm::dvec3& p) const override {
    const glm::dvec3 to_wide = p - glm::dvec3(-0.5, 0.3, 0.5), to_narrow = p - glm::dvec3(-0.4, -0.4, 0.3);
    return std::clamp(0.2 + std::exp(-8 * glm::dot(to_wide, to_wide)) +
                          0.8 * std::exp(-20 * glm::dot(to_narrow, to_narrow)) +
                          0.06 * std::sin(9 * p.x) * std::cos(8 * p.y + 2 * p.z),
                      0.0, 1.0);
  }

  std::pair<glm::dvec3, glm::dvec3> bounds() const override {
    return {{-kOuter, -kOuter, -kWave * kOuter}, {0, kOuter, 1 + kWave * kOuter}};
  }

  double volume() const override { return 0.5 * pi * (square(kOuter) - square(kInner)); }

 private:
  static constexpr double kInner = 0.3, kOuter = 1.0, kWave = 0.15;
  double clustering_, growth_;
};

class ConstantHalfAnnulus : public HalfAnnulus {
 public:
  using HalfAnnulus::HalfAnnulus;
  double scalar(const glm::dvec3&) const override { return 0.5; }
};

// An O-grid around a cylinder along z: circles from the wall outwards, whose centres move downstream (+x).
// Along v the spacing grows geometrically through the wall layer (half of the nodes) and is even beyond it;
// along u the nodes gather downstream.
class Wake : public Scene {
 public:
  Wake(std::string name, double clustering)
      : Scene(std::move(name)),
        clustering_(clustering),
        wall_(std::exp(-clustering)),
        stretch_(stretched(1)) {}

  glm::dvec3 alongU(double u) const override {
    const double turn = 2 * pi * (u - std::floor(u));  // u = 1 is the very point of u = 0
    const double angle = turn - kGathering * std::sin(turn);
    return {std::cos(angle), std::sin(angle), 0};
  }
  glm::dvec3 alongV(double v) const override {
    const double s = stretched(v) / stretch_;
    const double radius = kWall + s * (kOuter - kWall);
    return {radius, radius, s * kDownstream};
  }
  glm::dvec3 alongW(double w) const override { return {0, 0, kSpan * w}; }
  glm::dvec3 join(const glm::dvec3& of_u, const glm::dvec3& of_v, const glm::dvec3& of_w) const override {
    return {of_v.z + of_v.x * of_u.x, of_v.y * of_u.y, of_w.z};
  }

  std::optional<glm::dvec3> inverse(const glm::dvec3& world) const override {
    // |(x, y) - (s D, 0)| = wall + s G, a quadratic in s.
    const double growth = kOuter - kWall;
    const double a = square(growth) - square(kDownstream);
    const double b = world.x * kDownstream + kWall * growth;
    const double c = square(world.x) + square(world.y) - square(kWall);
    const double root = std::sqrt(std::max(0.0, b * b + a * c));
    const double s = b > 0 ? c / (b + root) : (root - b) / a;
    const double w = world.z / kSpan;
    if (!inUnitInterval(s) || !inUnitInterval(w)) return std::nullopt;
    const double v = std::log1p((1 + wall_) / wall_ * std::expm1(s * stretch_)) / (2 * clustering_);
    return glm::dvec3(turnOf(std::atan2(world.y, world.x - s * kDownstream)) / (2 * pi), v, w);
  }

  // The strength of the vortices: rollers shed in turn from above and below, each a core and an arm wound
  // around it, waving along the span; braids between them; and the layers that leave the wall.
  double scalar(const glm::dvec3& p) const override {
    const double radius = std::hypot(p.x, p.y);
    const double layer = bump((radius - kWall - 0.03) / 0.07) * (0.7 - 0.3 * p.x / radius);
    const double separated = 0.7 * bump((std::abs(p.y) - 0.5 - 0.05 * p.x) / 0.12) *
                             smoothStep((p.x + 0.1) / 0.5) * smoothStep((1.9 - p.x) / 1.2);
    return std::clamp(std::max({layer, separated, street(p)}), 0.0, 1.0);
  }

  std::pair<glm::dvec3, glm::dvec3> bounds() const override {
    return {{kDownstream - kOuter, -kOuter, 0}, {kDownstream + kOuter, kOuter, kSpan}};
  }

  double volume() const override { return pi * (square(kOuter) - square(kWall)) * kSpan; }

 private:
  static constexpr double kWall = 0.5, kOuter = 4.0, kDownstream = 3.0, kSpan = 4, kGathering = 0.6,
                          kWaveLength = 2.5;

  double street(const glm::dvec3& p) const {
    const double behind = smoothStep((p.x - 0.6) / 1.4);
    if (behind == 0) return 0;
    const double height = 0.42 + 0.03 * p.x;
    const double along = p.x - 0.22 * std::sin(pi * p.z + 0.4 * p.x);
    const double upper = roller(along, p.y - height, 1),
                 lower = roller(along + 0.5 * kWaveLength, height + p.y, -1);
    const double phase = 2 * pi * along / kWaveLength;
    const double braid = bump((p.y - 1.2 * height * std::cos(phase)) / 0.16) *
                         periodicBump(2 * pi * p.z + (std::sin(phase) > 0 ? 0.0 : pi), 4.0) *
                         square(std::sin(phase));
    return behind * std::exp(-0.05 * p.x) * (upper + lower + 0.75 * braid);
  }

  // A core and a spiral arm around each multiple of the wave length.
  static double roller(double along, double above, double turning) {
    const double x = along - kWaveLength * std::round(along / kWaveLength);
    const double radius = std::hypot(x, above);
    const double arm = 0.5 + 0.5 * std::cos(std::atan2(turning * above, x) - 2 * pi * radius / 0.42);
    return bump(radius / 0.22) + 0.75 * bump(radius / 0.57) * (1 - bump(radius / 0.25)) * square(arm);
  }

  static double bump(double x) { return std::exp(-x * x); }
  // 1 at multiples of 2 pi, and the narrower in between the larger the concentration.
  static double periodicBump(double phase, double concentration) {
    return std::exp(concentration * (std::cos(phase) - 1));
  }
  static double smoothStep(double x) {
    const double t = std::clamp(x, 0.0, 1.0);
    return t * t * (3 - 2 * t);
  }

  // A logistic spacing's integral: e^(2 B v) near the wall, a straight line from v = 1/2 on.
  double stretched(double v) const {
    return std::log1p(wall_ * std::expm1(2 * clustering_ * v) / (1 + wall_));
  }

  // Solves angle = turn - kGathering sin(turn) (Kepler's equation) for turn in [0, 2 pi).
  static double turnOf(double angle) {
    if (angle < 0) angle += 2 * pi;
    double turn = angle + kGathering * std::sin(angle);
    for (int n = 0; n < 50; ++n) {
      const double step = (turn - kGathering * std::sin(turn) - angle) / (1 - kGathering * std::cos(turn));
      turn -= step;
      if (std::abs(step) < 1e-15) break;
    }
    return std::clamp(turn, 0.0, 2 * pi);
  }

  double clustering_, wall_, stretch_;
};

double nodeCoordinate(uint64_t index, uint64_t nodes) {
  return static_cast<double>(index) / static_cast<double>(nodes - 1);
}

}  // namespace

std::vector<std::string> sceneNames() {
  return {"half-annulus", "half-annulus-constant", "wake"};
}

std::unique_ptr<Scene> makeScene(std::string_view name, std::optional<double> clustering) {
  if (clustering && !(*clustering > 0 && *clustering <= 20))
    throw UsageError("clustering {} is not between 0 and 20", *clustering);
  if (name == "half-annulus")
    return std::make_unique<HalfAnnulus>(std::string(name), clustering.value_or(2.5));
  if (name == "half-annulus-constant")
    return std::make_unique<ConstantHalfAnnulus>(std::string(name), clustering.value_or(2.5));
  if (name == "wake") return std::make_unique<Wake>(std::string(name), clustering.value_or(9));
  throw UsageError("there is no scene '{}'; there are {}", name, fmt::join(sceneNames(), ", "));
}

SceneGridSource::SceneGridSource(std::shared_ptr<const Scene> scene, SceneGridSize size, int coordinate_bytes)
    : scene_(std::move(scene)) {
  if (std::min({size.ni, size.nj, size.nk}) < 2)
    throw UsageError("a scene needs at least 2 nodes along each axis, not {} x {} x {}", size.ni, size.nj,
                     size.nk);
  CURVISPLAT_CHECK(coordinate_bytes == 4 || coordinate_bytes == 8);
  description_.format = fmt::format("analytic scene {}", scene_->name());
  description_.blocks = {{"block 1", size.ni, size.nj, size.nk, false}};
  description_.scalars = {{"f", "", {}}};
  description_.coordinate_bytes = coordinate_bytes;
  for (uint64_t i = 0; i < size.ni; ++i) of_i_.push_back(scene_->alongU(nodeCoordinate(i, size.ni)));
  for (uint64_t j = 0; j < size.nj; ++j) of_j_.push_back(scene_->alongV(nodeCoordinate(j, size.nj)));
  for (uint64_t k = 0; k < size.nk; ++k) of_k_.push_back(scene_->alongW(nodeCoordinate(k, size.nk)));
}

void SceneGridSource::read(uint32_t block, const NodeBox& box, std::span<const uint32_t> scalars,
                           NodeArrays& out) const {
  CURVISPLAT_CHECK_OP(block, ==, 0u);
  CURVISPLAT_CHECK(box.j0 <= box.j1 && box.j1 <= of_j_.size() && box.k0 <= box.k1 && box.k1 <= of_k_.size());
  const size_t nodes = of_i_.size() * (box.j1 - box.j0) * (box.k1 - box.k0);
  out.x.resize(nodes);
  out.y.resize(nodes);
  out.z.resize(nodes);
  out.blank.assign(nodes, 0);
  out.scalars.resize(scalars.size());
  for (auto& values : out.scalars) values.resize(nodes);

  const bool single = description_.coordinate_bytes == 4;
  const auto stored = [single](double x) { return single ? static_cast<float>(x) : x; };
  size_t n = 0;
  for (uint64_t k = box.k0; k < box.k1; ++k)
    for (uint64_t j = box.j0; j < box.j1; ++j)
      for (const glm::dvec3& of_i : of_i_) {
        const glm::dvec3 position = scene_->join(of_i, of_j_[j], of_k_[k]);
        out.x[n] = stored(position.x);
        out.y[n] = stored(position.y);
        out.z[n] = stored(position.z);
        if (!scalars.empty()) {
          const auto f = static_cast<float>(scene_->scalar(position));
          for (auto& values : out.scalars) values[n] = f;
        }
        ++n;
      }
}

}  // namespace curvisplat
