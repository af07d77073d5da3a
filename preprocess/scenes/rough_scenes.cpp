#include "preprocess/scenes/rough_scenes.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <numbers>

namespace curvisplat {
namespace {

using std::numbers::pi;

bool isWithinGrid(double x) {
  return x >= 0 && x <= 1;
}

double waves(const glm::dvec3& p) {
  return 0.5 + 0.25 * std::sin(5 * p.x + p.y) + 0.25 * std::cos(4 * p.y - 3 * p.z);
}

class Spectral : public Scene {
 public:
  Spectral() : Scene("spectral") {}

  glm::dvec3 alongU(double u) const override {
    const double x = gathered(u);
    return {x, kWave * std::sin(2 * pi * x), 0};
  }
  glm::dvec3 alongV(double v) const override { return {0, gathered(v), 0}; }
  glm::dvec3 alongW(double w) const override { return {0, 0, gathered(w)}; }
  glm::dvec3 join(const glm::dvec3& of_u, const glm::dvec3& of_v, const glm::dvec3& of_w) const override {
    return of_u + of_v + of_w;
  }
  std::optional<glm::dvec3> inverse(const glm::dvec3& world) const override {
    const double y = world.y - kWave * std::sin(2 * pi * world.x);
    if (!isWithinGrid(world.x) || !isWithinGrid(y) || !isWithinGrid(world.z)) return std::nullopt;
    return glm::dvec3(even(world.x), even(y), even(world.z));
  }
  double scalar(const glm::dvec3& p) const override { return waves(p); }
  std::pair<glm::dvec3, glm::dvec3> bounds() const override { return {{0, -kWave, 0}, {1, 1 + kWave, 1}}; }
  double volume() const override { return 1; }

 private:
  static constexpr double kWave = 0.1;
  static constexpr int kElements = 6;  // along each axis

  // Even steps in, Chebyshev-Gauss-Lobatto points of each element out.
  static double gathered(double t) {
    const double element = std::min(std::floor(t * kElements), kElements - 1.0);
    return (element + 0.5 * (1 - std::cos(pi * (t * kElements - element)))) / kElements;
  }
  static double even(double x) {
    const double element = std::min(std::floor(x * kElements), kElements - 1.0);
    const double local = std::clamp(x * kElements - element, 0.0, 1.0);
    return (element + std::acos(1 - 2 * local) / pi) / kElements;
  }
};

class Dome : public Scene {
 public:
  explicit Dome(double clustering)
      : Scene("dome"), clustering_(clustering), growth_(std::expm1(clustering)) {}

  glm::dvec3 alongU(double u) const override {
    const double angle = 2 * pi * (u - std::floor(u));  // u = 1 is the very point of u = 0
    return {std::cos(angle), std::sin(angle), 0};
  }
  glm::dvec3 alongV(double v) const override {
    return glm::dvec3(kInner + (kOuter - kInner) * std::expm1(clustering_ * v) / growth_);
  }
  // The base is flat to the last bit.
  glm::dvec3 alongW(double w) const override {
    return {std::sin(0.5 * pi * w), std::sin(0.5 * pi * w), w == 1 ? 0.0 : std::cos(0.5 * pi * w)};
  }
  glm::dvec3 join(const glm::dvec3& of_u, const glm::dvec3& of_v, const glm::dvec3& of_w) const override {
    return of_v * glm::dvec3(of_w.x * of_u.x, of_w.y * of_u.y, of_w.z);
  }
  std::optional<glm::dvec3> inverse(const glm::dvec3& world) const override {
    const double radius = glm::length(world);
    const double stretched = (radius - kInner) / (kOuter - kInner);
    if (!isWithinGrid(stretched) || world.z < 0) return std::nullopt;
    double angle = std::atan2(world.y, world.x);
    if (angle < 0) angle += 2 * pi;
    return glm::dvec3(angle / (2 * pi), std::log1p(stretched * growth_) / clustering_,
                      std::atan2(std::hypot(world.x, world.y), world.z) / (0.5 * pi));
  }
  double scalar(const glm::dvec3& p) const override { return waves(p); }
  std::pair<glm::dvec3, glm::dvec3> bounds() const override {
    return {{-kOuter, -kOuter, 0}, {kOuter, kOuter, kOuter}};
  }
  double volume() const override { return 2 * pi / 3 * (std::pow(kOuter, 3) - std::pow(kInner, 3)); }

 private:
  static constexpr double kInner = 0.05, kOuter = 1;
  double clustering_, growth_;
};

// One face of a cubed sphere whose lines are great circles at even angles.
class GlobeFace : public Scene {
 public:
  /// The face lies around `axis`; `right` and `up` are its directions of u and v.
  GlobeFace(const glm::dvec3& axis, const glm::dvec3& right, const glm::dvec3& up)
      : Scene("globe"), axis_(axis), right_(right), up_(up) {}

  glm::dvec3 alongU(double u) const override { return axis_ + slope(u) * right_; }
  glm::dvec3 alongV(double v) const override { return slope(v) * up_; }
  glm::dvec3 alongW(double w) const override { return glm::dvec3(kInner + (kOuter - kInner) * w); }
  glm::dvec3 join(const glm::dvec3& of_u, const glm::dvec3& of_v, const glm::dvec3& of_w) const override {
    return of_w * glm::normalize(of_u + of_v);
  }
  std::optional<glm::dvec3> inverse(const glm::dvec3& world) const override {
    const double w = (glm::length(world) - kInner) / (kOuter - kInner);
    const double along = glm::dot(world, axis_);
    if (!isWithinGrid(w) || along <= 0) return std::nullopt;
    const double u = 0.5 + std::atan(glm::dot(world, right_) / along) / (0.5 * pi);
    const double v = 0.5 + std::atan(glm::dot(world, up_) / along) / (0.5 * pi);
    if (!isWithinGrid(u) || !isWithinGrid(v)) return std::nullopt;
    return glm::dvec3(u, v, w);
  }
  double scalar(const glm::dvec3& p) const override { return waves(p); }
  std::pair<glm::dvec3, glm::dvec3> bounds() const override {
    // The middle of the face reaches the farthest along its axis, the inner corners the least far; the
    // middles of its edges reach the farthest sideways.
    const double side = kOuter * std::numbers::sqrt2 / 2, near = kInner / std::numbers::sqrt3;
    const glm::dvec3 sideways = side * (glm::abs(right_) + glm::abs(up_));
    const glm::dvec3 a = near * axis_, b = kOuter * axis_;
    return {glm::min(a, b) - sideways, glm::max(a, b) + sideways};
  }
  double volume() const override { return 4 * pi / 3 * (std::pow(kOuter, 3) - std::pow(kInner, 3)) / 6; }

 private:
  static constexpr double kInner = 0.97, kOuter = 1;
  // Exactly +-1 at the ends, so that faces that abut share their nodes.
  static double slope(double t) { return t == 0 ? -1.0 : t == 1 ? 1.0 : std::tan(0.5 * pi * (t - 0.5)); }

  glm::dvec3 axis_, right_, up_;
};

class DuctPart : public Scene {
 public:
  /// A part of the duct from x = begin to begin + 1. `clustering`: cells along i gather at the beginning
  /// where it is positive, at the end where it is negative.
  DuctPart(double begin, double clustering)
      : Scene("duct"), begin_(begin), clustering_(clustering), growth_(std::expm1(clustering)) {}

  glm::dvec3 alongU(double u) const override {
    const double x = u == 0 ? begin_ : u == 1 ? begin_ + 1 : begin_ + std::expm1(clustering_ * u) / growth_;
    return {x, bend(x), 0};
  }
  glm::dvec3 alongV(double v) const override { return {0, v, 0}; }
  glm::dvec3 alongW(double w) const override { return {0, 0, w}; }
  glm::dvec3 join(const glm::dvec3& of_u, const glm::dvec3& of_v, const glm::dvec3& of_w) const override {
    return of_u + of_v + of_w;
  }
  std::optional<glm::dvec3> inverse(const glm::dvec3& world) const override {
    const double x = world.x - begin_, v = world.y - bend(world.x);
    if (!isWithinGrid(x) || !isWithinGrid(v) || !isWithinGrid(world.z)) return std::nullopt;
    return glm::dvec3(std::log1p(x * growth_) / clustering_, v, world.z);
  }
  double scalar(const glm::dvec3& p) const override { return waves(p); }
  std::pair<glm::dvec3, glm::dvec3> bounds() const override {
    // The bend rises all the way.
    return {{begin_, bend(begin_), 0}, {begin_ + 1, 1 + bend(begin_ + 1), 1}};
  }
  double volume() const override { return 1; }

 private:
  static double bend(double x) { return 0.4 * std::tanh(2 * (x - 1.5)); }

  double begin_, clustering_, growth_;
};

}  // namespace

std::shared_ptr<const Scene> makeSpectral() {
  return std::make_shared<Spectral>();
}

std::shared_ptr<const Scene> makeDome(std::optional<double> clustering) {
  constexpr double kGrowth = 1.5;
  constexpr int kCells = 24;
  return std::make_shared<Dome>(clustering.value_or(kCells * std::log(kGrowth)));
}

std::vector<std::shared_ptr<const Scene>> makeGlobe() {
  const glm::dvec3 x(1, 0, 0), y(0, 1, 0), z(0, 0, 1);
  std::vector<std::shared_ptr<const Scene>> faces;
  for (const auto& [axis, right, up] : {std::array{x, y, z}, std::array{-x, -y, z}, std::array{y, -x, z},
                                        std::array{-y, x, z}, std::array{z, y, -x}, std::array{-z, y, x}})
    faces.push_back(std::make_shared<GlobeFace>(axis, right, up));
  return faces;
}

std::vector<std::shared_ptr<const Scene>> makeDuct() {
  std::vector<std::shared_ptr<const Scene>> parts;
  double begin = 0;
  for (const double clustering : {2.5, -1.0, -3.0})
    parts.push_back(std::make_shared<DuctPart>(begin++, clustering));
  return parts;
}

}  // namespace curvisplat
