#include "tests/reference/reference_field.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <string>

namespace curvisplat {
namespace {

/// A pipe scene of preprocess/scenes: between two cylinders around the z axis, or the half of that where
/// x <= 0, from a wavy floor to a ceiling one unit above. Told here a second time; reference_march_test holds
/// it to Scene::contains().
struct Pipe {
  double inner = 0;
  bool is_half = false;
};
constexpr double kOuter = 1, kWave = 0.15;
constexpr double kReach = 1.6;  // from kMiddle: all of a pipe is nearer
constexpr glm::dvec3 kMiddle{0, 0, 0.5};

std::optional<Pipe> pipeOf(const std::string& scene) {
  if (scene == "half-annulus" || scene == "half-annulus-constant" || scene == "shell") return Pipe{0.3, true};
  if (scene == "o-grid") return Pipe{0.3, false};
  if (scene == "axis") return Pipe{0, false};
  return std::nullopt;
}

/// The height above the floor, times the squared distance from the axis: a polynomial.
double floorAt(const glm::dvec3& p) {
  return p.z * (p.x * p.x + p.y * p.y) - kWave * p.x * (p.x * p.x - 3 * p.y * p.y);
}

bool isIn(const Pipe& pipe, const glm::dvec3& p) {
  const double radius2 = p.x * p.x + p.y * p.y, above = floorAt(p);
  return radius2 >= pipe.inner * pipe.inner && radius2 <= kOuter * kOuter && (!pipe.is_half || p.x <= 0) &&
         above >= 0 && above <= radius2;
}

/// Coefficients of the powers of t.
using Cubic = std::array<double, 4>;

double valueOf(const Cubic& f, double t) {
  return f[0] + t * (f[1] + t * (f[2] + t * f[3]));
}

/// The root between two places of different signs, between which f rises or falls: Newton's method, and halving.
double rootBetween(const Cubic& f, double low, double high) {
  const bool low_is_negative = valueOf(f, low) < 0;
  double t = 0.5 * (low + high);
  for (int n = 0; n < 100; ++n) {
    const double value = valueOf(f, t);
    ((value < 0) == low_is_negative ? low : high) = t;
    double next = t - value / (f[1] + t * (2 * f[2] + t * 3 * f[3]));
    if (!(next > low && next < high)) next = 0.5 * (low + high);
    const bool is_there = std::abs(next - t) < 1e-15;
    t = next;
    if (is_there) break;
  }
  return t;
}

/// Appends the real roots of a t² + b t + c.
void appendRoots(double a, double b, double c, std::vector<double>& roots) {
  const double discriminant = b * b - 4 * a * c;
  if (discriminant < 0) return;
  const double q = -0.5 * (b + std::copysign(std::sqrt(discriminant), b));
  if (a != 0) roots.push_back(q / a);
  if (q != 0) roots.push_back(c / q);
}

/// Appends the roots in [-kReach, kReach].
void appendRoots(const Cubic& f, std::vector<double>& roots) {
  std::vector<double> ends;
  appendRoots(3 * f[3], 2 * f[2], f[1], ends);
  std::erase_if(ends, [](double t) { return !(std::abs(t) < kReach); });
  ends.insert(ends.end(), {-kReach, kReach});
  std::sort(ends.begin(), ends.end());
  for (size_t n = 0; n + 1 < ends.size(); ++n)
    if ((valueOf(f, ends[n]) < 0) != (valueOf(f, ends[n + 1]) < 0))
      roots.push_back(rootBetween(f, ends[n], ends[n + 1]));
}

/// The distances from `o` at which the line along `d` enters or leaves the pipe.
void appendCrossings(const Pipe& pipe, const glm::dvec3& o, const glm::dvec3& d,
                     std::vector<double>& distances) {
  std::vector<double> met{-kReach, kReach};
  const double a = d.x * d.x + d.y * d.y, b = 2 * (o.x * d.x + o.y * d.y), c = o.x * o.x + o.y * o.y;
  for (const double radius : {pipe.inner, kOuter}) appendRoots(a, b, c - radius * radius, met);
  if (pipe.is_half && d.x != 0) met.push_back(-o.x / d.x);
  // floorAt() along the line; the ceiling is the floor of what lies one unit lower.
  const double x2[] = {o.x * o.x, 2 * o.x * d.x, d.x * d.x}, y2[] = {o.y * o.y, 2 * o.y * d.y, d.y * d.y};
  for (const double floor : {0.0, 1.0}) {
    Cubic f{};
    for (size_t n = 0; n < 3; ++n) {
      const double of_z = x2[n] + y2[n], of_x = kWave * (x2[n] - 3 * y2[n]);
      f[n] += (o.z - floor) * of_z - o.x * of_x;
      f[n + 1] += d.z * of_z - d.x * of_x;
    }
    appendRoots(f, met);
  }
  std::erase_if(met, [](double t) { return !(std::abs(t) <= kReach); });
  std::sort(met.begin(), met.end());
  bool was_in = false;
  for (size_t n = 1; n < met.size(); ++n) {
    const bool is_in = isIn(pipe, o + 0.5 * (met[n - 1] + met[n]) * d);
    if (is_in != was_in) distances.push_back(met[n - 1]);
    was_in = is_in;
  }
}

class SceneProbe : public FieldProbe {
 public:
  explicit SceneProbe(const Scene& scene) : scene_(scene) {}
  std::optional<double> at(const glm::dvec3& world) override {
    if (!scene_.contains(world)) return std::nullopt;
    return scene_.scalar(world);
  }
  std::optional<double> atInside(const glm::dvec3& world) override { return scene_.scalar(world); }

 private:
  const Scene& scene_;
};

class ClippedProbe : public FieldProbe {
 public:
  ClippedProbe(std::unique_ptr<FieldProbe> whole, const std::vector<ClipPlane>& planes)
      : whole_(std::move(whole)), planes_(planes) {}
  std::optional<double> at(const glm::dvec3& world) override {
    for (const ClipPlane& plane : planes_)
      if (glm::dot(plane.normal, world - plane.point) < 0) return std::nullopt;
    return whole_->at(world);
  }
  std::optional<double> atInside(const glm::dvec3& world) override { return whole_->atInside(world); }
  double cellLength(const glm::dvec3& direction) const override { return whole_->cellLength(direction); }

 private:
  const std::unique_ptr<FieldProbe> whole_;
  const std::vector<ClipPlane>& planes_;
};

}  // namespace

std::unique_ptr<FieldProbe> SceneField::probe() const {
  return std::make_unique<SceneProbe>(scene_);
}

bool SceneField::crossings(const glm::dvec3& origin, const glm::dvec3& direction,
                           std::vector<double>& distances) const {
  const std::optional<Pipe> pipe = pipeOf(scene_.name());
  if (!pipe) return false;
  // From the place nearest the middle, where numbers are small.
  const double nearest = glm::dot(kMiddle - origin, direction);
  const size_t before = distances.size();
  appendCrossings(*pipe, origin + nearest * direction, direction, distances);
  for (size_t n = before; n < distances.size(); ++n) distances[n] += nearest;
  return true;
}

std::unique_ptr<FieldProbe> ClippedField::probe() const {
  return std::make_unique<ClippedProbe>(whole_.probe(), planes_);
}

bool ClippedField::crossings(const glm::dvec3& origin, const glm::dvec3& direction,
                             std::vector<double>& distances) const {
  if (!whole_.crossings(origin, direction, distances)) return false;
  for (const ClipPlane& plane : planes_) {
    const double along = glm::dot(plane.normal, direction);
    if (along != 0) distances.push_back(glm::dot(plane.normal, plane.point - origin) / along);
  }
  return true;
}

}  // namespace curvisplat
