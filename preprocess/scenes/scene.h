// An analytic curvilinear scene: positions, scalar, inverse mapping and volume in closed form.
//
// A scene maps the unit cube (u, v, w), along i, j, k, to the world. The mapping is composed of one function
// per axis, so that a grid needs three small tables and evaluates no transcendental function per node.
#pragma once

#include <glm/vec3.hpp>
#include <optional>
#include <string>
#include <utility>

namespace curvisplat {

/// Immutable; thread-safe.
class Scene {
 public:
  virtual ~Scene() = default;

  const std::string& name() const { return name_; }

  /// The world position of (u, v, w) in [0, 1]³.
  glm::dvec3 position(const glm::dvec3& uvw) const {
    return join(alongU(uvw.x), alongV(uvw.y), alongW(uvw.z));
  }
  /// The (u, v, w) of a world position; nullopt outside the scene.
  virtual std::optional<glm::dvec3> inverse(const glm::dvec3& world) const = 0;
  bool contains(const glm::dvec3& world) const { return inverse(world).has_value(); }
  /// The scalar "f", in [0, 1]; also defined outside the scene.
  virtual double scalar(const glm::dvec3& world) const = 0;
  /// Volume of the image of the unit cube, in world units.
  virtual double volume() const = 0;

  /// The lower and upper corner of a tight bounding box.
  virtual std::pair<glm::dvec3, glm::dvec3> bounds() const = 0;

  /// The factors of position(): the position of (u, v, w) is join(alongU(u), alongV(v), alongW(w)).
  virtual glm::dvec3 alongU(double u) const = 0;
  virtual glm::dvec3 alongV(double v) const = 0;
  virtual glm::dvec3 alongW(double w) const = 0;
  virtual glm::dvec3 join(const glm::dvec3& of_u, const glm::dvec3& of_v, const glm::dvec3& of_w) const = 0;

 protected:
  explicit Scene(std::string name) : name_(std::move(name)) {}

 private:
  std::string name_;
};

}  // namespace curvisplat
