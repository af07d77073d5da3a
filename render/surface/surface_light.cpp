#include "render/surface/surface_light.h"

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>

namespace curvisplat {

SurfaceLight::SurfaceLight(const std::optional<Light>& light, const ScreenView& view)
    : light_(light.value_or(Light{})), per_scale_(1.0 / view.scale) {
  if (light_.towards) towards_ = glm::vec3(glm::normalize(*light_.towards));
}

glm::vec3 SurfaceLight::lit(const glm::vec3& colour, const glm::vec3& normal,
                            const glm::vec3& towards_viewer) const {
  const glm::vec3 stretched = normal * per_scale_;
  const float length = glm::length(stretched);
  if (!(length > 0)) return colour;
  const glm::vec3 n = stretched / length;
  const glm::vec3 towards = light_.towards ? towards_ : towards_viewer;
  const float facing = std::min(1.0f, std::abs(glm::dot(n, towards)));
  float shine = facing;
  if (light_.towards) {
    const glm::vec3 half = towards + towards_viewer;
    const float of_half = glm::length(half);
    shine = of_half > 1e-6f ? std::min(1.0f, std::abs(glm::dot(n, half)) / of_half) : 0.0f;
  }
  for (int n2 = 0; n2 < 5; ++n2) shine *= shine;  // to the power of 32
  return glm::min((light_.ambient + light_.diffuse * facing) * colour + glm::vec3(light_.specular * shine),
                  glm::vec3(1.0f));
}

}  // namespace curvisplat
