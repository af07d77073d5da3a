#include "render/surface/surface_light.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>

namespace curvisplat {

SurfaceLight::SurfaceLight(const std::optional<Light>& light, const ScreenView& view)
    : light_(light.value_or(Light{})), per_scale_(1.0 / view.scale) {
  if (light_.towards) towards_ = glm::vec3(glm::normalize(*light_.towards));
}

/// Without a branch, so that compilers make vectors of a loop of it.
template <bool kAtViewer>
inline glm::vec3 SurfaceLight::litBy(const glm::vec3& colour, const glm::vec3& normal,
                                     const glm::vec3& towards_viewer) const {
  const glm::vec3 stretched = normal * per_scale_;
  const float length = std::sqrt(glm::dot(stretched, stretched));
  const glm::vec3 n = stretched / length;
  const float facing = std::min(1.0f, std::abs(glm::dot(n, kAtViewer ? towards_viewer : towards_)));
  float shine = facing;
  if constexpr (!kAtViewer) {
    const glm::vec3 half = towards_ + towards_viewer;
    const float of_half = std::sqrt(glm::dot(half, half));
    const float of_normal = std::min(1.0f, std::abs(glm::dot(n, half)) / of_half);
    shine = of_half > 1e-6f ? of_normal : 0.0f;
  }
  for (int power = 0; power < 5; ++power) shine *= shine;  // to the power of 32
  const bool known = length > 0;
  const float factor = known ? light_.ambient + light_.diffuse * facing : 1.0f;
  const float white = known ? light_.specular * shine : 0.0f;
  return {std::min(factor * colour.x + white, 1.0f), std::min(factor * colour.y + white, 1.0f),
          std::min(factor * colour.z + white, 1.0f)};
}

glm::vec3 SurfaceLight::lit(const glm::vec3& colour, const glm::vec3& normal,
                            const glm::vec3& towards_viewer) const {
  return light_.towards ? litBy<false>(colour, normal, towards_viewer)
                        : litBy<true>(colour, normal, towards_viewer);
}

template <bool kAtViewer>
void SurfaceLight::lightBy(LitPoints& points, size_t count) const {
  const auto at = [](const LitPoints::Vectors& vectors, size_t n) {
    return glm::vec3(vectors[0][n], vectors[1][n], vectors[2][n]);
  };
  const SurfaceLight light = *this;  // which the points cannot overlap
  for (size_t n = 0; n < count; ++n) {
    const glm::vec3 lit =
        light.litBy<kAtViewer>(at(points.colour, n), at(points.normal, n), at(points.towards_viewer, n));
    points.colour[0][n] = lit.x;
    points.colour[1][n] = lit.y;
    points.colour[2][n] = lit.z;
  }
}

void SurfaceLight::light(LitPoints& points, size_t count) const {
  light_.towards ? lightBy<false>(points, count) : lightBy<true>(points, count);
}

}  // namespace curvisplat
