#include "render/project/light.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <glm/geometric.hpp>
#include <limits>

#include "render/project/gradient_opacity.h"

namespace curvisplat {
namespace {

// Bits of a packed float, from the lowest bit on.
constexpr int kSpecularBits = 7, kDiffuseBits = 9;
constexpr uint32_t kSpecularMask = (1u << kSpecularBits) - 1, kDiffuseMask = (1u << kDiffuseBits) - 1;
constexpr uint32_t kLitMask = (1u << (kSpecularBits + kDiffuseBits)) - 1;

float shareOf(uint32_t bits, uint32_t mask) {
  return static_cast<float>(bits) / static_cast<float>(mask);
}

uint32_t bitsOf(float share, uint32_t mask) {
  return static_cast<uint32_t>(std::clamp(share, 0.0f, 1.0f) * static_cast<float>(mask) + 0.5f);
}

}  // namespace

LocalLight::LocalLight(const Light& light, double g0, const ScreenView& view, const glm::dvec3& origin)
    : ambient_(light.ambient),
      diffuse_(light.diffuse),
      specular_(light.specular),
      scale_(view.scale),
      per_scale_(1.0 / view.scale),
      perspective_(view.projection == Projection::kPerspective),
      eye_(perspective_ ? view.eye - view.scale * origin : -view.forward),
      at_viewer_(!light.towards),
      g0_squared_(static_cast<float>(std::max(g0 * g0, 1e-30))) {
  if (light.towards) towards_ = glm::vec3(glm::normalize(*light.towards));
}

Lit LocalLight::of(float x, float y, float z, const Shape& s, const Slope& w) const {
  const glm::vec3 g = gradientOf(s, w, per_scale_);
  const float squared = glm::dot(g, g);
  constexpr float kLargest = 1e36f;
  if (!(squared > 0 && squared < kLargest)) return {};
  const float strength = squared / (squared + g0_squared_);
  const float inverse = 1 / std::sqrt(squared);
  const glm::vec3 viewer = perspective_ ? glm::normalize(eye_ - scale_ * glm::vec3(x, y, z)) : eye_;
  const glm::vec3 light = at_viewer_ ? viewer : towards_;
  const float facing = std::min(1.0f, inverse * std::abs(glm::dot(g, light)));
  float shine = facing;
  if (!at_viewer_) {
    const glm::vec3 half = light + viewer;
    const float length = glm::length(half);
    shine = length > 1e-6f ? std::min(1.0f, inverse * std::abs(glm::dot(g, half)) / length) : 0.0f;
  }
  for (int n = 0; n < 5; ++n) shine *= shine;  // to the power of 32
  return {1 - strength + strength * (ambient_ + diffuse_ * facing), strength * specular_ * shine};
}

float packLit(float half_width, const Lit& lit) {
  const float held =
      std::clamp(half_width, std::numeric_limits<float>::min(), std::numeric_limits<float>::max());
  const uint32_t width = std::bit_cast<uint32_t>(held) & ~kLitMask;
  return std::bit_cast<float>(width | bitsOf(lit.diffuse, kDiffuseMask) << kSpecularBits |
                              bitsOf(lit.specular, kSpecularMask));
}

float unpackHalfWidth(float packed) {
  return std::bit_cast<float>(std::bit_cast<uint32_t>(packed) & ~kLitMask);
}

Lit unpackLit(float packed) {
  const auto bits = std::bit_cast<uint32_t>(packed);
  return {shareOf(bits >> kSpecularBits & kDiffuseMask, kDiffuseMask),
          shareOf(bits & kSpecularMask, kSpecularMask)};
}

}  // namespace curvisplat
