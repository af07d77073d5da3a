#include "tests/reference/reference_march.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <limits>
#include <memory>
#include <numbers>
#include <optional>
#include <utility>
#include <vector>

#include "stream/base/error.h"

namespace curvisplat {
namespace {

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

using PointColour = std::function<glm::dvec3(const glm::dvec3& world)>;

/// The surroundings of a field: its light, what lies in it, and its colours where they are another scalar's.
struct Surroundings {
  const ReferenceLight* light = nullptr;
  const ReferenceLayers& layers;
  const PointColour* colour = nullptr;
  const std::function<double(double)>* gradient_opacity = nullptr;
};

class Marcher {
 public:
  Marcher(const ReferenceField& field, const OpticalFunction& function, const Ray& ray,
          const MarchSteps& steps, const Surroundings& around)
      : field_(field),
        probe_(field.probe()),
        gradient_probe_(around.light || around.gradient_opacity ? field.probe() : nullptr),
        shadow_probe_(around.light ? field.probe() : nullptr),
        function_(function),
        ray_(ray),
        steps_(steps),
        light_(around.light),
        colour_at_(around.colour),
        gradient_opacity_(around.gradient_opacity) {}

  /// `layers`: from the nearest.
  ReferencePixel march(double begin, double end, const std::vector<ReferenceLayer>& layers) {
    for (const ReferenceLayer& layer : layers) {
      if (layer.distance > begin) marchVolume(begin, std::min(layer.distance, end));
      begin = std::max(begin, layer.distance);
      colour_ += transmittance_ * layer.opacity * layer.colour;
      transmittance_ *= 1 - layer.opacity;
    }
    if (transmittance_ > 0) marchVolume(begin, end);
    return {colour_ + transmittance_, transmittance_};
  }

 private:
  static constexpr double kMinStep = 1e-5;    // of the largest
  static constexpr double kNoLength = 1e-11;  // of the ray's part in the box
  static constexpr double kSkin = 1e-9;       // of an interval: its ends are sampled so far inside of it

  void marchVolume(double begin, double end) {
    if (!(begin < end)) return;
    std::vector<double> ends;
    if (field_.crossings(ray_.origin, ray_.direction, ends))
      marchBetween(std::move(ends), begin, end);
    else
      marchSearching(begin, end, steps_.step);
  }

  /// Marches from one of `ends` to the next, between which the field is there throughout, or nowhere.
  void marchBetween(std::vector<double> ends, double begin, double end) {
    std::erase_if(ends, [&](double t) { return !(t > begin && t < end); });
    ends.push_back(begin);
    ends.push_back(end);
    std::sort(ends.begin(), ends.end());
    for (size_t n = 0; n + 1 < ends.size(); ++n) {
      const double length = ends[n + 1] - ends[n];
      if (length <= kNoLength * (end - begin)) continue;
      const bool middle = inside(ends[n] + 0.5 * length);
      // A face that contains the ray is not met, and faces of blocks need not fit exactly.
      if (inside(ends[n] + 0.03 * length) != middle || inside(ends[n] + 0.97 * length) != middle)
        marchSearching(ends[n], ends[n + 1], std::min(steps_.step, 0.02 * length));
      else if (middle)
        marchInside(ends[n], ends[n + 1]);
    }
  }

  void marchInside(double begin, double end) {
    first_ = begin + kSkin * (end - begin);
    last_ = end - kSkin * (end - begin);
    held_ = {};
    double t = begin;
    Sample here = sample(t);
    double step = stepFromHere(steps_.step);
    while (t < end) {
      const double next = end - t < 1.001 * step ? end : t + step;
      const Sample there = sample(next);
      step = stepFromHere(steps_.step);
      add(t, next, here, there);
      t = next;
      here = there;
    }
    first_.reset();
  }

  /// Marches without knowing where the field begins and ends.
  void marchSearching(double begin, double end, double largest_step) {
    double t = begin;
    Sample here = sample(t);
    while (t < end) {
      const double step = here.is_inside ? stepFromHere(largest_step) : largest_step;
      const double next = std::min(end, t + step);
      const Sample there = sample(next);
      if (!here.is_inside && there.is_inside) {
        t = face(next, t);  // and then in steps of the cells that are there
        here = sample(t);
        here.is_inside = true;
        continue;
      }
      if (here.is_inside) {
        const double last = there.is_inside ? next : face(t, next);
        add(t, last, here, there.is_inside ? there : sample(last));
      }
      t = next;
      here = there;
    }
  }

  /// The step from the point asked about last, which was inside.
  double stepFromHere(double largest) const {
    return std::clamp(steps_.cells * probe_->cellLength(ray_.direction), kMinStep * largest, largest);
  }

  bool inside(double t) { return probe_->at(ray_.at(t)).has_value(); }

  /// The field at a place on the ray. A colour without extinction counts nothing, and is not lit.
  struct Sample {
    bool is_inside = false;
    OpticalProperties optical;
  };

  Sample sample(double t) {
    if (first_) t = std::clamp(t, *first_, last_);
    const glm::dvec3 at = ray_.at(t);
    const std::optional<double> scalar = first_ ? probe_->atInside(at) : probe_->at(at);
    // A point between two inside that is not: a fold of a grid, or a gap no wider than a step. It is empty,
    // unless the field said that it is there.
    if (!scalar) return first_ ? held_ : Sample{};
    Sample found{true, function_(*scalar)};
    if (gradient_opacity_ && found.optical.extinction > 0)
      found.optical.extinction *= (*gradient_opacity_)(glm::length(gradient(at, *scalar)));
    if (found.optical.extinction > 0) {
      glm::dvec3& colour = found.optical.colour;
      if (colour_at_) colour = (*colour_at_)(at);
      if (light_) colour = arrivingAt(at) * lit(colour, gradient(at, *scalar));
    }
    if (first_) held_ = found;
    return found;
  }

  glm::dvec3 gradient(const glm::dvec3& at, double scalar) {
    constexpr double kStep = 1e-4;
    glm::dvec3 result;
    for (int axis = 0; axis < 3; ++axis) {
      glm::dvec3 step(0.0);
      step[axis] = kStep;
      const auto scalarAt = [&](const glm::dvec3& place) {
        return first_ ? gradient_probe_->atInside(place) : gradient_probe_->at(place);
      };
      const std::optional<double> before = scalarAt(at - step), after = scalarAt(at + step);
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

  /// The share of the light that the volume lets through to a point.
  double arrivingAt(const glm::dvec3& at) {
    double arriving = 1;
    if (light_->ambient_occlusion > 0) {
      double sum = 0;
      for (int n = 0; n < 27; ++n) {
        const glm::dvec3 way(n % 3 - 1, n / 3 % 3 - 1, n / 9 - 1);
        const double squared = glm::dot(way, way);  // 1: a face of a cube; 3: a corner
        if (squared == 1 || squared == 3) sum += transmittance(at, way, light_->occlusion_reach);
      }
      arriving *= 1 - light_->ambient_occlusion * (1 - sum / 14);
    }
    if (light_->shadow > 0)
      arriving *= 1 - light_->shadow *
                          (1 - transmittance(at, *light_->towards, std::numeric_limits<double>::infinity()));
    return arriving;
  }

  double transmittance(const glm::dvec3& at, const glm::dvec3& towards, double reach) {
    const auto [lower, upper] = field_.bounds();
    const Ray ray{at, glm::normalize(towards)};
    const auto part = partInBox(ray, lower, upper);
    const double length = std::min(reach, part ? part->second : 0.0);
    const int steps = static_cast<int>(std::ceil(length / light_->shadow_step));
    double depth = 0;
    for (int n = 0; n < steps; ++n) {
      const glm::dvec3 place = ray.at((n + 0.5) / steps * length);
      const std::optional<double> scalar = shadow_probe_->at(place);
      if (scalar) depth += function_(*scalar).extinction * length / steps;
    }
    return std::exp(-depth);
  }

  // The place where the field ends between a point inside and one outside, to the last bits.
  double face(double in, double out) {
    for (int n = 0; n < 60; ++n) {
      const double middle = 0.5 * (in + out);
      (inside(middle) ? in : out) = middle;
    }
    return in;
  }

  /// The gain of a step, by Simpson's rule: exact where colour and extinction are constant.
  struct Gain {
    double depth = 0;        // optical
    double error = 0;        // of the depth and of each channel by the midpoint rule; far above Simpson's
    glm::dvec3 colour{0.0};  // the mean of what comes out
  };
  static Gain gainOf(double length, const OpticalProperties& begin, const OpticalProperties& middle,
                     const OpticalProperties& end) {
    const double a = begin.extinction, b = middle.extinction, c = end.extinction;
    Gain gain{length / 6 * (a + 4 * b + c), length / 6 * std::abs(a - 2 * b + c), middle.colour};
    // How much of the light that each point emits leaves the step.
    const double of_middle = 4 * b * std::exp(-std::max(0.0, length / 24 * (5 * a + 8 * b - c))),
                 of_end = c * std::exp(-gain.depth), sum = a + of_middle + of_end;
    if (!(sum > 0)) return gain;
    gain.colour = (a * begin.colour + of_middle * middle.colour + of_end * end.colour) / sum;
    const glm::dvec3 change = glm::abs(gain.colour - middle.colour);
    gain.error = std::max(gain.error, gain.depth * std::max({change.r, change.g, change.b}));
    return gain;
  }

  void add(double begin, double end, const Sample& at_begin, const Sample& at_end, int halvings = 0) {
    const double middle = 0.5 * (begin + end);
    const Sample at_middle = sample(middle);
    const Gain gain = gainOf(end - begin, at_begin.optical, at_middle.optical, at_end.optical);
    if (gain.error > steps_.tolerance && halvings < kMaxHalvings) {
      add(begin, middle, at_begin, at_middle, halvings + 1);
      add(middle, end, at_middle, at_end, halvings + 1);
      return;
    }
    const double passed = std::exp(-gain.depth);
    colour_ += transmittance_ * (1 - passed) * gain.colour;
    transmittance_ *= passed;
  }

  const ReferenceField& field_;
  std::unique_ptr<FieldProbe> probe_, gradient_probe_, shadow_probe_;  // which remember where they were asked
  const OpticalFunction& function_;
  Ray ray_;
  const MarchSteps& steps_;
  const ReferenceLight* light_;
  const PointColour* colour_at_;
  const std::function<double(double)>* gradient_opacity_;
  std::optional<double> first_;  // between first_ and last_ the field is there
  double last_ = 0;
  Sample held_;  // the last one found since first_ was set
  glm::dvec3 colour_{0.0};
  double transmittance_ = 1;
};

std::vector<ReferenceLayer> layersAlong(const ReferenceLayers& layers, const Ray& ray, double near) {
  std::vector<ReferenceLayer> found;
  if (layers) found = layers(ray.origin, ray.direction);
  std::erase_if(found, [&](const ReferenceLayer& layer) { return layer.distance < near; });
  std::sort(found.begin(), found.end(),
            [](const ReferenceLayer& a, const ReferenceLayer& b) { return a.distance < b.distance; });
  return found;
}

struct March {
  const ReferenceField& field;
  const OpticalFunction& function;
  const Camera& camera;
  const MarchSteps& steps;
  Surroundings around;
};

/// The pixels of `image` for which `wanted` is not 0.
void marchPixels(const March& march, const std::vector<uint8_t>& wanted, ReferenceImage& image) {
  const Camera& camera = march.camera;
  const MarchSteps& steps = march.steps;
  const Surroundings& around = march.around;
  const ImageSize size = image.size;
  const auto [lower, upper] = march.field.bounds();
  const glm::dvec3 forward = glm::normalize(camera.focal_point - camera.position);
  tbb::parallel_for(0, size.height, [&, lower = lower, upper = upper](int y) {
    for (int x = 0; x < size.width; ++x) {
      const size_t p = static_cast<size_t>(y) * static_cast<size_t>(size.width) + static_cast<size_t>(x);
      if (!wanted[p]) continue;
      const int every = steps.every;
      const Ray ray = rayThrough(camera, {every * size.width, every * size.height}, every * x + every / 2,
                                 every * y + every / 2);
      const auto part = partInBox(ray, lower, upper);
      const bool from_eye = camera.projection == Projection::kPerspective;
      const double near = from_eye ? steps.near / glm::dot(ray.direction, forward) : 0.0;
      const auto [begin, end] = part.value_or(std::pair(near, near));
      image.pixels[p] = Marcher(march.field, march.function, ray, steps, around)
                            .march(std::max(begin, near), end, layersAlong(around.layers, ray, near));
    }
  });
}

/// 1 where a pixel or one of its neighbours differs by more than `tolerance`.
std::vector<uint8_t> unsettled(const ReferenceImage& a, const ReferenceImage& b, double tolerance) {
  const int width = a.size.width, height = a.size.height;
  std::vector<uint8_t> out(a.pixels.size(), 0);
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) {
      const glm::dvec3 d = glm::abs(a.at(x, y).colour - b.at(x, y).colour);
      if (std::max({d.r, d.g, d.b}) <= tolerance) continue;
      for (int v = std::max(0, y - 1); v <= std::min(height - 1, y + 1); ++v)
        for (int u = std::max(0, x - 1); u <= std::min(width - 1, x + 1); ++u)
          out[static_cast<size_t>(v) * static_cast<size_t>(width) + static_cast<size_t>(u)] = 1;
    }
  return out;
}

ReferenceImage emptyImage(ImageSize picture, const MarchSteps& steps) {
  const ImageSize size{picture.width / steps.every, picture.height / steps.every};
  return {size, std::vector<ReferencePixel>(size.pixels())};
}

glm::dvec3 sectionNineColour(double f) {
  return {std::clamp(2 * f - 0.4, 0.0, 1.0), std::clamp(1 - 2.5 * std::abs(f - 0.5), 0.0, 1.0),
          std::clamp(1 - 2 * f, 0.0, 1.0)};
}

}  // namespace

namespace {

glm::dvec3 litAtViewer(const glm::dvec3& colour, const glm::dvec3& normal, const glm::dvec3& direction) {
  const ReferenceLight light;
  return (light.ambient + light.diffuse * std::abs(glm::dot(normal, direction))) * colour;
}

}  // namespace

ReferenceLayers planeLayer(const glm::dvec3& point, const glm::dvec3& normal, const glm::dvec3& colour) {
  const glm::dvec3 n = glm::normalize(normal);
  return [=](const glm::dvec3& origin, const glm::dvec3& direction) -> std::vector<ReferenceLayer> {
    const double along = glm::dot(n, direction);
    if (along == 0) return {};
    return {{glm::dot(n, point - origin) / along, litAtViewer(colour, n, direction), 1}};
  };
}

ReferenceLayers sphereLayer(const glm::dvec3& centre, double radius, const glm::dvec3& colour) {
  return [=](const glm::dvec3& origin, const glm::dvec3& direction) -> std::vector<ReferenceLayer> {
    const double middle = glm::dot(centre - origin, direction);
    const glm::dvec3 aside = origin + middle * direction - centre;
    const double half2 = radius * radius - glm::dot(aside, aside);
    if (half2 <= 0) return {};
    const double distance = middle - std::sqrt(half2);
    const glm::dvec3 n = (origin + distance * direction - centre) / radius;
    return {{distance, litAtViewer(colour, n, direction), 1}};
  };
}

ReferenceLayers sliceLayer(const ReferenceField& field, const OpticalFunction& function,
                           const glm::dvec3& point, const glm::dvec3& normal, double opacity) {
  return [&field, function, point, n = glm::normalize(normal), opacity](
             const glm::dvec3& origin, const glm::dvec3& direction) -> std::vector<ReferenceLayer> {
    const double distance = glm::dot(n, point - origin) / glm::dot(n, direction);
    const auto scalar = field.probe()->at(origin + distance * direction);
    if (!scalar) return {};
    return {{distance, function(*scalar).colour, opacity}};
  };
}

namespace {

/// The parts of a line that lie in a field whose crossings are known.
std::vector<std::pair<double, double>> partsInside(const ReferenceField& field, const Ray& line) {
  std::vector<double> ends;
  CURVISPLAT_CHECK(field.crossings(line.origin, line.direction, ends));
  std::sort(ends.begin(), ends.end());
  const auto probe = field.probe();
  std::vector<std::pair<double, double>> parts;
  for (size_t n = 0; n + 1 < ends.size(); ++n)
    if (probe->at(line.at(0.5 * (ends[n] + ends[n + 1])))) parts.emplace_back(ends[n], ends[n + 1]);
  return parts;
}

/// Appends where `surface` is between two places.
void appendMeetings(const ReferenceIsosurface& surface, const Ray& line,
                    const std::pair<double, double>& part, std::vector<ReferenceLayer>& found) {
  constexpr double kStep = 0.008;
  constexpr int kHalvings = 26;
  const auto isAbove = [&](double t) { return surface.scalar(line.at(t)) >= surface.value; };
  const double steps = std::ceil((part.second - part.first) / kStep);
  double begin = part.first;
  bool was_above = isAbove(begin);
  for (double n = 1; n <= steps; ++n) {
    double low = begin, high = std::min(part.second, part.first + n * kStep);
    begin = high;
    const bool is_above = isAbove(high);
    if (is_above == was_above) continue;
    for (int halving = 0; halving < kHalvings; ++halving) {
      const double middle = 0.5 * (low + high);
      (isAbove(middle) == was_above ? low : high) = middle;
    }
    was_above = is_above;
    const glm::dvec3 at = line.at(low);
    glm::dvec3 gradient;
    for (int axis = 0; axis < 3; ++axis) {
      glm::dvec3 step(0.0);
      step[axis] = 1e-5;
      gradient[axis] = surface.scalar(at + step) - surface.scalar(at - step);
    }
    found.push_back(
        {low, litAtViewer(surface.colour, glm::normalize(gradient), line.direction), surface.opacity(at)});
    if (found.back().opacity >= 1) return;  // hides what lies behind it
  }
}

}  // namespace

ReferenceLayers isoLayer(const Scene& scene, const ReferenceIsosurface& surface) {
  return [field = SceneField(scene), surface](const glm::dvec3& origin, const glm::dvec3& direction) {
    const Ray line{origin, direction};
    std::vector<ReferenceLayer> found;
    for (const auto& part : partsInside(field, line)) {
      appendMeetings(surface, line, part, found);
      if (!found.empty() && found.back().opacity >= 1) break;
    }
    return found;
  };
}

ReferenceLayers isoLayer(const Scene& scene, double value, const glm::dvec3& colour, double opacity) {
  return isoLayer(scene, {[&scene](const glm::dvec3& at) { return scene.scalar(at); }, value, colour,
                          [opacity](const glm::dvec3&) { return opacity; }});
}

OpticalProperties smoothFunction(double scalar) {
  return {sectionNineColour(scalar), 8 * scalar * scalar};
}
OpticalProperties bandFunction(double scalar) {
  return {sectionNineColour(scalar), 24 * std::exp(-(scalar - 0.5) * (scalar - 0.5) / 0.0018)};
}
OpticalProperties stepFunction(double scalar) {
  return {sectionNineColour(scalar), scalar > 0.5 ? 16.0 : 0.0};
}

ReferenceImage referenceMarch(const ReferenceField& field, const OpticalFunction& function,
                              const Camera& camera, ImageSize size, const MarchSteps& steps,
                              const ReferenceExtras& extras) {
  ReferenceImage image = emptyImage(size, steps);
  marchPixels(
      {field,
       function,
       camera,
       steps,
       {extras.light, extras.layers, nullptr, extras.gradient_opacity ? &extras.gradient_opacity : nullptr}},
      std::vector<uint8_t>(image.pixels.size(), 1), image);
  return image;
}

ReferenceImage referenceMarch(const ReferenceField& field, const TwoScalars& scalars, const Camera& camera,
                              ImageSize size, const MarchSteps& steps, const ReferenceLayers& layers) {
  ReferenceImage image = emptyImage(size, steps);
  marchPixels({field, scalars.function, camera, steps, {nullptr, layers, &scalars.colour}},
              std::vector<uint8_t>(image.pixels.size(), 1), image);
  return image;
}

MarchSteps stepsFor(const ReferenceField& field) {
  MarchSteps steps;
  std::vector<double> none;
  if (field.crossings(glm::dvec3(0.0), glm::dvec3(1, 0, 0), none)) {
    steps.step = 0.016;  // in 0.032, rays of the step function miss thin parts: 69 dB at 256 x 256
    steps.tolerance = 5e-5;
  }
  return steps;
}

ReferenceImage referenceMarch(const Scene& scene, const OpticalFunction& function, const Camera& camera,
                              ImageSize size, std::optional<double> step) {
  const SceneField field(scene);
  MarchSteps steps = step ? MarchSteps() : stepsFor(field);
  if (step) steps.step = *step;
  return referenceMarch(field, function, camera, size, steps);
}

ConvergedImage convergedMarch(const ReferenceField& field, const OpticalFunction& function,
                              const Camera& camera, ImageSize size, MarchSteps steps, double agreement_db) {
  constexpr int kMaxHalvingsOfSteps = 6;
  const ReferenceLayers no_layers;
  std::vector<double> none;
  const bool exact_ends = field.crossings(camera.position, camera.focal_point - camera.position, none);
  const double tolerance = 0.25 * std::pow(10, -agreement_db / 20);
  ReferenceImage image = referenceMarch(field, function, camera, size, steps);
  std::vector<uint8_t> wanted(size.pixels(), 1);
  double agreement = 0;
  for (int n = 0; n < kMaxHalvingsOfSteps && agreement < agreement_db; ++n) {
    steps.step *= 0.5;
    steps.cells *= 0.5;
    ReferenceImage finer = image;
    marchPixels({field, function, camera, steps, {nullptr, no_layers}}, wanted, finer);
    double sum = 0;
    for (size_t p = 0; p < image.pixels.size(); ++p) {
      const glm::dvec3 d = finer.pixels[p].colour - image.pixels[p].colour;
      sum += glm::dot(d, d) / 3;
    }
    agreement = sum > 0 ? -10 * std::log10(sum / static_cast<double>(image.pixels.size())) : 200.0;
    if (exact_ends) wanted = unsettled(image, finer, tolerance);
    image = std::move(finer);
  }
  return {std::move(image), agreement};
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

ImageDifference compareWithReference(const Image& picture, const Image& reference) {
  const int every = picture.size.width / reference.size.width;
  Image marched(reference.size);
  for (int y = 0; y < marched.size.height; ++y)
    for (int x = 0; x < marched.size.width; ++x)
      std::copy_n(picture.pixel(every * x + every / 2, every * y + every / 2), 4, marched.pixel(x, y));
  return compareImages(marched, reference);
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
