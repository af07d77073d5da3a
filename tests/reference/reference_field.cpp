#include "tests/reference/reference_field.h"

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

}  // namespace

std::unique_ptr<FieldProbe> SceneField::probe() const {
  return std::make_unique<SceneProbe>(scene_);
}

}  // namespace curvisplat
