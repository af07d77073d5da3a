#include "tests/reference/reference_march.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <limits>
#include <memory>
#include <numbers>
#include <optional>
#include <utility>

namespace curvisplat {
namespace {

// A step is halved until the optical depth that extinction's change over it could be worth is below this.
constexpr double kDepthTolerance = 2e-5;
constexpr int kMaxHalvings = 16;

struct Ray {
  glm::dvec3 origin, direction;  // of length 1
  glm::dvec3 at(double t) const { return origin + t * direction; }
};

// The ray through the centre of a pixel; rows are counted from the top.
Ray rayThrough(const Camera& camera, ImageSize size, int x, int y) {
  const glm::dvec3 forward = glm::normalize(camera.focal_point - camera.position);
  const glm::dvec3 right = glm::normalize(glm::cross(forward, camera.view_up));
  const glm::dvec3 up = glm::cross(right, forward);
  // In units of half the image's height.
  const double across = (2 * (x + 0.5) - size.width) / size.height;
  const double upwards = (size.height - 2 * (y + 0.5)) / size.height;
  if (camera.projection == Projection::kOrthographic)
    return {camera.position + camera.parallel_scale * (across * right + upwards * up), forward};
  const double half_height = std::tan(0.5 * camera.view_angle_deg * std::numbers::pi / 180);
  return {camera.position, glm::normalize(forward + half_height * (across * right + upwards * up))};
}

// The part of the ray in front of the viewer that lies in the box.
std::optional<std::pair<double, double>> partInBox(const Ray& ray, const glm::dvec3& lower,
                                                   const glm::dvec3& upper) {
  double begin = 0, end = std::numeric_limits<double>::infinity();
  for (int axis = 0; axis < 3; ++axis) {
    if (ray.direction[axis] == 0) {
      if (ray.origin[axis] < lower[axis] || ray.origin[axis] > upper[axis]) return std::nullopt;
      continue;
    }
    const double a = (lower[axis] - ray.origin[axis]) / ray.direction[axis];
    const double b = (upper[axis] - ray.origin[axis]) / ray.direction[axis];
    begin = std::max(begin, std::min(a, b));
    end = std::min(end, std::max(a, b));
  }
  if (begin >= end) return std::nullopt;
  return std::pair(begin, end);
}

class Marcher {
 public:
  Marcher(const ReferenceField& field, const OpticalFunction& function, const Ray& ray,
          const ReferenceLight* light)
      : probe_(field.probe()), function_(function), ray_(ray), light_(light) {}

  ReferencePixel march(double begin, double end, const MarchSteps& steps) {
    double t = begin;
    bool is_inside = inside(t);
    while (t < end) {
      double step = steps.step;
      if (is_inside)
        step = std::clamp(steps.cells * probe_->cellLength(ray_.direction), kMinStep * step, step);
      const double next = std::min(end, t + step);
      const bool next_inside = inside(next);
      if (is_inside && next_inside) {
        add(t, next);
        t = next;
      } else if (is_inside) {
        add(t, face(t, next));
        t = next;
      } else if (next_inside) {
        t = face(next, t);  // and then in steps of the cells that are there
        inside(t);
      } else {
        t = next;
      }
      is_inside = next_inside;
    }
    return {colour_ + transmittance_, transmittance_};
  }

 private:
  static constexpr double kMinStep = 1e-5;  // of the largest

  bool inside(double t) { return probe_->at(ray_.at(t)).has_value(); }
  // A point between two inside that is not: a fold of a grid, or a gap no wider than a step. It is empty.
  OpticalProperties properties(double t) {
    const std::optional<double> scalar = probe_->at(ray_.at(t));
    if (!scalar) return {};
    OpticalProperties found = function_(*scalar);
    if (light_ && found.extinction > 0) found.colour = lit(found.colour, gradient(ray_.at(t), *scalar));
    return found;
  }

  glm::dvec3 gradient(const glm::dvec3& at, double scalar) {
    constexpr double kStep = 1e-4;
    glm::dvec3 result;
    for (int axis = 0; axis < 3; ++axis) {
      glm::dvec3 step(0.0);
      step[axis] = kStep;
      const std::optional<double> before = probe_->at(at - step), after = probe_->at(at + step);
      const double length = (before ? kStep : 0) + (after ? kStep : 0);
      result[axis] = length > 0 ? (after.value_or(scalar) - before.value_or(scalar)) / length : 0;
    }
    return result;
  }

  glm::dvec3 lit(const glm::dvec3& colour, const glm::dvec3& g) const {
    const double steepness = glm::length(g);
    if (steepness == 0) return colour;
    const double strength = steepness * steepness / (steepness * steepness + light_->g0 * light_->g0);
    const glm::dvec3 n = g / steepness, viewer = -ray_.direction;
    const glm::dvec3 towards = light_->towards ? glm::normalize(*light_->towards) : viewer;
    const double facing = std::abs(glm::dot(n, towards));
    const double shine = std::abs(glm::dot(n, glm::normalize(towards + viewer)));
    return (1 - strength + strength * (light_->ambient + light_->diffuse * facing)) * colour +
           glm::dvec3(strength * light_->specular * std::pow(shine, 32));
  }

  // Where the field ends between a point inside and one outside, to the last bits.
  double face(double in, double out) {
    for (int n = 0; n < 60; ++n) {
      const double middle = 0.5 * (in + out);
      (inside(middle) ? in : out) = middle;
    }
    return in;
  }

  void add(double begin, double end) {
    addHalving(begin, end, properties(begin).extinction, properties(end).extinction, 0);
  }

  void addHalving(double begin, double end, double at_begin, double at_end, int halvings) {
    const double middle = 0.5 * (begin + end), length = end - begin;
    const OpticalProperties here = properties(middle);
    const auto [least, most] = std::minmax({at_begin, here.extinction, at_end});
    if ((most - least) * length > kDepthTolerance && halvings < kMaxHalvings) {
      addHalving(begin, middle, at_begin, here.extinction, halvings + 1);
      addHalving(middle, end, here.extinction, at_end, halvings + 1);
      return;
    }
    const double passed = std::exp(-here.extinction * length);
    colour_ += transmittance_ * (1 - passed) * here.colour;
    transmittance_ *= passed;
  }

  std::unique_ptr<FieldProbe> probe_;
  const OpticalFunction& function_;
  Ray ray_;
  const ReferenceLight* light_;
  glm::dvec3 colour_{0.0};
  double transmittance_ = 1;
};

glm::dvec3 sectionNineColour(double f) {
  return {std::clamp(2 * f - 0.4, 0.0, 1.0), std::clamp(1 - 2.5 * std::abs(f - 0.5), 0.0, 1.0),
          std::clamp(1 - 2 * f, 0.0, 1.0)};
}

}  // namespace

OpticalProperties smoothFunction(double f) {
  return {sectionNineColour(f), 8 * f * f};
}
OpticalProperties bandFunction(double f) {
  return {sectionNineColour(f), 24 * std::exp(-(f - 0.5) * (f - 0.5) / 0.0018)};
}
OpticalProperties stepFunction(double f) {
  return {sectionNineColour(f), f > 0.5 ? 16.0 : 0.0};
}

ReferenceImage referenceMarch(const ReferenceField& field, const OpticalFunction& function,
                              const Camera& camera, ImageSize size, const MarchSteps& steps,
                              const ReferenceLight* light) {
  ReferenceImage image{size, {}};
  image.pixels.resize(size.pixels());
  const auto [lower, upper] = field.bounds();
  const glm::dvec3 forward = glm::normalize(camera.focal_point - camera.position);
  tbb::parallel_for(0, size.height, [&, lower = lower, upper = upper](int y) {
    for (int x = 0; x < size.width; ++x) {
      const Ray ray = rayThrough(camera, size, x, y);
      ReferencePixel& pixel = image.pixels[static_cast<size_t>(y) * size.width + x];
      pixel.colour = glm::dvec3(1.0);
      const auto part = partInBox(ray, lower, upper);
      if (!part) continue;
      const bool from_eye = camera.projection == Projection::kPerspective;
      const double near = from_eye ? steps.near / glm::dot(ray.direction, forward) : 0.0;
      const double begin = std::max(part->first, near);
      if (begin < part->second)
        pixel = Marcher(field, function, ray, light).march(begin, part->second, steps);
    }
  });
  return image;
}

ReferenceImage referenceMarch(const Scene& scene, const OpticalFunction& function, const Camera& camera,
                              ImageSize size, double step) {
  MarchSteps steps;
  steps.step = step;
  return referenceMarch(SceneField(scene), function, camera, size, steps);
}

ReferenceImage convergedMarch(const ReferenceField& field, const OpticalFunction& function,
                              const Camera& camera, ImageSize size, MarchSteps steps, double agreement_db,
                              double* reached_db) {
  constexpr int kMaxHalvingsOfSteps = 6;
  ReferenceImage image = referenceMarch(field, function, camera, size, steps);
  double agreement = 0;
  for (int n = 0; n < kMaxHalvingsOfSteps && agreement < agreement_db; ++n) {
    steps.step *= 0.5;
    steps.cells *= 0.5;
    ReferenceImage finer = referenceMarch(field, function, camera, size, steps);
    double sum = 0;
    for (size_t p = 0; p < image.pixels.size(); ++p) {
      const glm::dvec3 d = finer.pixels[p].colour - image.pixels[p].colour;
      sum += glm::dot(d, d) / 3;
    }
    agreement = sum > 0 ? -10 * std::log10(sum / static_cast<double>(image.pixels.size())) : 200.0;
    image = std::move(finer);
  }
  if (reached_db) *reached_db = agreement;
  return image;
}

Image toImage(const ReferenceImage& reference) {
  Image image(reference.size);
  for (size_t n = 0; n < reference.pixels.size(); ++n) {
    for (int c = 0; c < 3; ++c)
      image.rgba[4 * n + static_cast<size_t>(c)] = static_cast<float>(reference.pixels[n].colour[c]);
    image.rgba[4 * n + 3] = 1;
  }
  return image;
}

Camera halfAnnulusCamera() {
  Camera camera;
  camera.focal_point = {-0.4, 0, 0.5};
  camera.position = camera.focal_point - 4.0 * glm::normalize(glm::dvec3(0.8, 0.35, -0.45));
  camera.view_up = {0, 0, 1};
  camera.projection = Projection::kOrthographic;
  camera.parallel_scale = 1.25;
  return camera;
}

}  // namespace curvisplat
