#include "preprocess/scenes/scenes.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <numbers>

#include "preprocess/scenes/rough_scenes.h"
#include "stream/base/error.h"
#include "stream/base/text.h"

namespace curvisplat {
namespace {

using std::numbers::pi;

double square(double x) {
  return x * x;
}

bool inUnitInterval(double x) {
  return x >= 0 && x <= 1;
}

// The part of a pipe around the z axis that a grid fills.
struct PipeShape {
  double turns;  // 0.5: the half with negative x; 1: the full circle
  double inner;  // inner radius; if 0, all nodes of a row j = 0 coincide on the axis
  double clustering;
};

double halfAnnulusField(const glm::dvec3& p) {
  const glm::dvec3 to_wide = p - glm::dvec3(-0.5, 0.3, 0.5), to_narrow = p - glm::dvec3(-0.4, -0.4, 0.3);
  return std::clamp(0.2 + std::exp(-8 * glm::dot(to_wide, to_wide)) +
                        0.8 * std::exp(-20 * glm::dot(to_narrow, to_narrow)) +
                        0.06 * std::sin(9 * p.x) * std::cos(8 * p.y + 2 * p.z),
                    0.0, 1.0);
}

// A layer on the inner wall, 0.004 thick: five of 64 cells with the scene's default clustering.
double boundaryLayer(const glm::dvec3& p) {
  const double angle = std::atan2(-p.x, p.y);
  return (0.8 + 0.2 * std::cos(5 * angle + 3 * p.z)) *
         std::exp(-square((std::hypot(p.x, p.y) - 0.3) / 0.004));
}

// 1 at the wall, and 0 where the layers end; steepest at the wall.
constexpr double kLayersWall = 0.96;
double wallLayers(const glm::dvec3& p) {
  return 1 - std::sqrt(std::clamp((std::hypot(p.x, p.y) - kLayersWall) / (1 - kLayersWall), 0.0, 1.0));
}

// The pipe scenes: an annulus around the z axis, or half of it, whose floor waves with the angle.
class Pipe : public Scene {
 public:
  using Field = double (*)(const glm::dvec3&);

  Pipe(std::string name, const PipeShape& shape, Field field)
      : Scene(std::move(name)), shape_(shape), growth_(std::expm1(shape.clustering)), field_(field) {}

  glm::dvec3 alongU(double u) const override {
    // On the full circle, u = 1 gives exactly the point of u = 0.
    const double angle = 2 * pi * shape_.turns * (shape_.turns == 1 ? u - std::floor(u) : u);
    return {-std::sin(angle), std::cos(angle), kWave * std::sin(3 * angle)};
  }
  glm::dvec3 alongV(double v) const override {
    return glm::dvec3(shape_.inner + (kOuter - shape_.inner) * std::expm1(shape_.clustering * v) / growth_);
  }
  glm::dvec3 alongW(double w) const override { return {0, 0, w}; }
  glm::dvec3 join(const glm::dvec3& of_u, const glm::dvec3& of_v, const glm::dvec3& of_w) const override {
    return of_v * of_u + of_w;
  }

  std::optional<glm::dvec3> inverse(const glm::dvec3& world) const override {
    const double radius = std::hypot(world.x, world.y);
    double angle = std::atan2(-world.x, world.y);
    if (shape_.turns == 1 && angle < 0) angle += 2 * pi;
    const double u = angle / (2 * pi * shape_.turns);
    const double stretched = (radius - shape_.inner) / (kOuter - shape_.inner);
    const double w = world.z - kWave * radius * std::sin(3 * angle);
    if (!inUnitInterval(u) || !inUnitInterval(stretched) || !inUnitInterval(w)) return std::nullopt;
    return glm::dvec3(u, std::log1p(stretched * growth_) / shape_.clustering, w);
  }

  double scalar(const glm::dvec3& p) const override { return field_(p); }

  std::pair<glm::dvec3, glm::dvec3> bounds() const override {
    return {{-kOuter, -kOuter, -kWave * kOuter},
            {shape_.turns == 1 ? kOuter : 0.0, kOuter, 1 + kWave * kOuter}};
  }

  double volume() const override { return shape_.turns * pi * (square(kOuter) - square(shape_.inner)); }

 private:
  static constexpr double kOuter = 1.0, kWave = 0.15;
  PipeShape shape_;
  double growth_;
  Field field_;
};

// A sixth of a sphere's surface, as thin as an ocean is: a thousandth of the radius. u runs to the east, v down, w to the north.
class Ocean : public Scene {
 public:
  Ocean(std::string name, double clustering)
      : Scene(std::move(name)), clustering_(clustering), growth_(std::expm1(clustering)) {}

  glm::dvec3 alongU(double u) const override {
    const double longitude = kReach * (2 * u - 1);
    return {std::cos(longitude), std::sin(longitude), 1};
  }
  glm::dvec3 alongV(double v) const override {
    return glm::dvec3(1 - kDepth * std::expm1(clustering_ * v) / growth_);
  }
  glm::dvec3 alongW(double w) const override {
    const double latitude = kReach * (2 * w - 1);
    return {std::cos(latitude), std::cos(latitude), std::sin(latitude)};
  }
  glm::dvec3 join(const glm::dvec3& of_u, const glm::dvec3& of_v, const glm::dvec3& of_w) const override {
    return of_u * of_v * of_w;
  }
  std::optional<glm::dvec3> inverse(const glm::dvec3& world) const override {
    const double u = 0.5 + 0.5 * std::atan2(world.y, world.x) / kReach, depth = depthOf(world);
    const double w = 0.5 + 0.5 * std::atan2(world.z, std::hypot(world.x, world.y)) / kReach;
    if (!inUnitInterval(u) || !inUnitInterval(depth) || !inUnitInterval(w)) return std::nullopt;
    return glm::dvec3(u, std::log1p(depth * growth_) / clustering_, w);
  }
  // A temperature: warm at the surface and towards the equator, cold below the thermocline.
  double scalar(const glm::dvec3& world) const override {
    const double radius = glm::length(world), north = world.z / radius;
    return std::clamp((1 - square(north)) * std::exp(-5 * std::max(depthOf(world), 0.0)), 0.0, 1.0);
  }
  std::pair<glm::dvec3, glm::dvec3> bounds() const override {
    const double side = std::sin(kReach);
    return {{(1 - kDepth) * square(std::cos(kReach)), -side, -side}, {1, side, side}};
  }
  double volume() const override {
    return 2 * kReach * 2 * std::sin(kReach) * (1 - std::pow(1 - kDepth, 3)) / 3;
  }

 private:
  static constexpr double kReach = pi / 3, kDepth = 1e-3;

  // 0 at the surface, 1 at the bottom.
  static double depthOf(const glm::dvec3& world) { return (1 - glm::length(world)) / kDepth; }

  double clustering_, growth_;
};

// A parallelepiped of strongly sheared cells. The scalar is that of Marschner and Lobb, "An Evaluation of
// Reconstruction Filters for Volume Rendering", 1994, with a lower frequency.
class ShearedWaves : public Scene {
 public:
  explicit ShearedWaves(std::string name) : Scene(std::move(name)) {}

  glm::dvec3 alongU(double u) const override { return {2 * u - 1, 0, 0}; }
  glm::dvec3 alongV(double v) const override { return (2 * v - 1) * glm::dvec3(kXY, 1, 0); }
  glm::dvec3 alongW(double w) const override { return (2 * w - 1) * glm::dvec3(kXZ, kYZ, 1); }
  glm::dvec3 join(const glm::dvec3& of_u, const glm::dvec3& of_v, const glm::dvec3& of_w) const override {
    return of_u + of_v + of_w;
  }
  std::optional<glm::dvec3> inverse(const glm::dvec3& world) const override {
    const double c = world.z, b = world.y - kYZ * c, a = world.x - kXY * b - kXZ * c;
    const glm::dvec3 uvw = 0.5 * (glm::dvec3(a, b, c) + 1.0);
    if (!inUnitInterval(uvw.x) || !inUnitInterval(uvw.y) || !inUnitInterval(uvw.z)) return std::nullopt;
    return uvw;
  }
  double scalar(const glm::dvec3& p) const override {
    constexpr double kFrequency = 4, kWaves = 0.25;
    const double wave = std::cos(2 * pi * kFrequency * std::cos(0.5 * pi * std::hypot(p.x, p.y)));
    return (1 - std::sin(0.5 * pi * p.z) + kWaves * (1 + wave)) / (2 * (1 + kWaves));
  }
  std::pair<glm::dvec3, glm::dvec3> bounds() const override {
    const glm::dvec3 corner(1 + kXY + kXZ, 1 + kYZ, 1);
    return {-corner, corner};
  }
  double volume() const override { return 8; }

 private:
  static constexpr double kXY = 1.2, kXZ = 0.8, kYZ = 1.0;
};

// An O-grid around a cylinder along z: circles from the wall outwards, whose centres move downstream (+x).
// Along v the spacing grows geometrically through the wall layer (half of the nodes) and is uniform beyond
// it; along u the nodes are denser downstream.
class Wake : public Scene {
 public:
  Wake(std::string name, double clustering, const SceneTime& time = {})
      : Scene(std::move(name)),
        clustering_(clustering),
        time_(time),
        wall_(std::exp(-clustering)),
        stretch_(stretched(1)) {}

  glm::dvec3 alongU(double u) const override {
    const double turn = 2 * pi * (u - std::floor(u));  // u = 1 gives exactly the point of u = 0
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
    const double x = of_v.z + of_v.x * of_u.x;
    return {x, of_v.y * of_u.y + sway(x), of_w.z};
  }

  std::optional<glm::dvec3> inverse(const glm::dvec3& swayed) const override {
    const glm::dvec3 world(swayed.x, swayed.y - sway(swayed.x), swayed.z);
    // Solves |(x, y) - (s D, 0)| = wall + s G, a quadratic equation in s.
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

  // Vortex strength: rollers shed alternately from above and below, each a core with a spiral arm, wavy along
  // the span; braids between them; and the shear layers that separate from the wall.
  double scalar(const glm::dvec3& swayed) const override {
    const glm::dvec3 p(swayed.x, swayed.y - sway(swayed.x), swayed.z);
    const double radius = std::hypot(p.x, p.y);
    const double layer = bump((radius - kWall - 0.03) / 0.07) * (0.7 - 0.3 * p.x / radius);
    const double separated = 0.7 * bump((std::abs(p.y) - 0.5 - 0.05 * p.x) / 0.12) *
                             smoothStep((p.x + 0.1) / 0.5) * smoothStep((1.9 - p.x) / 1.2);
    return std::clamp(std::max({layer, separated, street(p)}), 0.0, 1.0);
  }

  std::pair<glm::dvec3, glm::dvec3> bounds() const override {
    const double most = time_.moving ? kSway * (kDownstream + kOuter) : 0;
    return {{kDownstream - kOuter, -kOuter - most, 0}, {kDownstream + kOuter, kOuter + most, kSpan}};
  }

  // Swaying shears the grid along y.
  double volume() const override { return pi * (square(kOuter) - square(kWall)) * kSpan; }

 private:
  static constexpr double kWall = 0.5, kOuter = 4.0, kDownstream = 3.0, kSpan = 4, kGathering = 0.6,
                          kWaveLength = 2.5, kSway = 0.1;

  double sway(double x) const { return time_.moving ? kSway * x * std::sin(2 * pi * time_.time) : 0; }

  double street(const glm::dvec3& p) const {
    const double behind = smoothStep((p.x - 0.6) / 1.4);
    if (behind == 0) return 0;
    const double height = 0.42 + 0.03 * p.x;
    const double along = p.x - 0.22 * std::sin(pi * p.z + 0.4 * p.x) - kWaveLength * time_.time;
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
  // 1 at multiples of 2 pi; a larger concentration gives narrower peaks.
  static double periodicBump(double phase, double concentration) {
    return std::exp(concentration * (std::cos(phase) - 1));
  }
  static double smoothStep(double x) {
    const double t = std::clamp(x, 0.0, 1.0);
    return t * t * (3 - 2 * t);
  }

  // The integral of a logistic spacing: grows as e^(2 B v) near the wall, linearly from v = 1/2 on.
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

  double clustering_;
  SceneTime time_;
  double wall_, stretch_;
};

double nodeCoordinate(uint64_t index, uint64_t nodes) {
  return static_cast<double>(index) / static_cast<double>(nodes - 1);
}

}  // namespace

std::vector<std::string> sceneNames() {
  return {"half-annulus", "half-annulus-constant",
          "shell",        "o-grid",
          "axis",         "sheared-waves",
          "wake",         "spectral",
          "dome",         "globe",
          "duct",         "boundary-layer",
          "ocean"};
}

std::vector<std::shared_ptr<const Scene>> makeScenes(std::string_view name,
                                                     std::optional<double> clustering) {
  if (clustering && !(*clustering > 0 && *clustering <= 20))
    throw UsageError("--clustering {} is out of range; expected above 0, at most 20", *clustering);
  const auto pipe = [&](double turns, double inner, double own_clustering, Pipe::Field field) {
    return std::vector<std::shared_ptr<const Scene>>{std::make_shared<Pipe>(
        std::string(name), PipeShape{turns, inner, clustering.value_or(own_clustering)}, field)};
  };
  if (name == "half-annulus") return pipe(0.5, 0.3, 2.5, halfAnnulusField);
  if (name == "half-annulus-constant") return pipe(0.5, 0.3, 2.5, [](const glm::dvec3&) { return 0.5; });
  if (name == "shell") return pipe(0.5, 0.3, 4, boundaryLayer);
  if (name == "o-grid") return pipe(1, 0.3, 2.5, halfAnnulusField);
  if (name == "axis") return pipe(1, 0, 1, halfAnnulusField);
  if (name == "wake") return {std::make_shared<Wake>(std::string(name), clustering.value_or(9))};
  if (name == "dome") return {makeDome(clustering)};
  if (name == "boundary-layer") return pipe(0.5, kLayersWall, 4.5, wallLayers);
  if (name == "ocean") return {std::make_shared<Ocean>(std::string(name), clustering.value_or(3))};

  const auto names = sceneNames();
  if (std::find(names.begin(), names.end(), name) == names.end())
    throw UsageError("there is no scene '{}'{}; available: {}", name, didYouMean(name, names),
                     fmt::join(names, ", "));
  if (clustering) throw UsageError("scene '{}' has its own spacing; omit --clustering", name);
  if (name == "sheared-waves") return {std::make_shared<ShearedWaves>(std::string(name))};
  if (name == "spectral") return {makeSpectral()};
  if (name == "globe") return makeGlobe();
  CURVISPLAT_CHECK(name == "duct");
  return makeDuct();
}

std::vector<std::shared_ptr<const Scene>> makeScenesAt(std::string_view name,
                                                       std::optional<double> clustering,
                                                       const SceneTime& time) {
  if (name != "wake") throw UsageError("scene '{}' does not change with time; wake does", name);
  makeScenes(name, clustering);  // checks the clustering
  return {std::make_shared<Wake>(std::string(name), clustering.value_or(9), time)};
}

std::shared_ptr<const Scene> makeScene(std::string_view name, std::optional<double> clustering) {
  auto blocks = makeScenes(name, clustering);
  CURVISPLAT_CHECK_OP(blocks.size(), ==, 1u);
  return std::move(blocks.front());
}

SceneGridSource::SceneGridSource(std::vector<std::shared_ptr<const Scene>> blocks, SceneGridSize size,
                                 int coordinate_bytes) {
  if (std::min({size.ni, size.nj, size.nk}) < 2)
    throw UsageError("found {} x {} x {} nodes; a scene needs at least 2 along each axis", size.ni, size.nj,
                     size.nk);
  CURVISPLAT_CHECK(coordinate_bytes == 4 || coordinate_bytes == 8);
  description_.format = fmt::format("analytic scene {}", blocks.front()->name());
  description_.scalars = {{"f", "", {}}};
  description_.coordinate_bytes = coordinate_bytes;
  for (auto& scene : blocks) {
    description_.blocks.push_back(
        {fmt::format("block {}", description_.blocks.size() + 1), size.ni, size.nj, size.nk, false});
    Block block;
    for (uint64_t i = 0; i < size.ni; ++i) block.of_i.push_back(scene->alongU(nodeCoordinate(i, size.ni)));
    for (uint64_t j = 0; j < size.nj; ++j) block.of_j.push_back(scene->alongV(nodeCoordinate(j, size.nj)));
    for (uint64_t k = 0; k < size.nk; ++k) block.of_k.push_back(scene->alongW(nodeCoordinate(k, size.nk)));
    block.scene = std::move(scene);
    blocks_.push_back(std::move(block));
  }
}

void SceneGridSource::read(uint32_t block_number, const NodeBox& box, std::span<const uint32_t> scalars,
                           NodeArrays& out) const {
  CURVISPLAT_CHECK_OP(block_number, <, blocks_.size());
  const Block& block = blocks_[block_number];
  CURVISPLAT_CHECK(box.j0 <= box.j1 && box.j1 <= block.of_j.size() && box.k0 <= box.k1 &&
                   box.k1 <= block.of_k.size());
  const size_t nodes = block.of_i.size() * (box.j1 - box.j0) * (box.k1 - box.k0);
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
      for (const glm::dvec3& of_i : block.of_i) {
        const glm::dvec3 position = block.scene->join(of_i, block.of_j[j], block.of_k[k]);
        out.x[n] = stored(position.x);
        out.y[n] = stored(position.y);
        out.z[n] = stored(position.z);
        if (!scalars.empty()) {
          const auto f = static_cast<float>(block.scene->scalar(position));
          for (auto& values : out.scalars) values[n] = f;
        }
        ++n;
      }
}

}  // namespace curvisplat
