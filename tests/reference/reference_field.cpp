#include "tests/reference/reference_field.h"

#include <glm/geometric.hpp>

namespace curvisplat {
namespace {

class SceneProbe : public FieldProbe {
 public:
  explicit SceneProbe(const Scene& scene) : scene_(scene) {}
  std::optional<double> at(const glm::dvec3& world) override {
    if (!scene_.contains(world)) return std::nullopt;
    return scene_.scalar(world);
  }

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
  double cellLength(const glm::dvec3& direction) const override { return whole_->cellLength(direction); }

 private:
  const std::unique_ptr<FieldProbe> whole_;
  const std::vector<ClipPlane>& planes_;
};

}  // namespace

std::unique_ptr<FieldProbe> SceneField::probe() const {
  return std::make_unique<SceneProbe>(scene_);
}

std::unique_ptr<FieldProbe> ClippedField::probe() const {
  return std::make_unique<ClippedProbe>(whole_.probe(), planes_);
}

}  // namespace curvisplat
