// The field that the reference renderer marches through: a scalar over a bounded part of space, known at any
// point.
#pragma once

#include <glm/vec3.hpp>
#include <limits>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "preprocess/scenes/scenes.h"
#include "render/project/plane_cuts.h"

namespace curvisplat {

/// Asks a field along one ray. Remembers where it was: one thread each, and the quicker the nearer together
/// its points are.
class FieldProbe {
 public:
  virtual ~FieldProbe() = default;

  /// The scalar at a point of the world; nothing outside of the field.
  virtual std::optional<double> at(const glm::dvec3& world) = 0;
  /// The scalar as at() has it, for a point that is known to be in the field or just outside of it.
  virtual std::optional<double> atInside(const glm::dvec3& world) { return at(world); }
  /// How far one may go along `direction` (of length 1) from the point last asked about, which had a scalar,
  /// until about one cell of the grid is passed. Infinite where the field has no cells.
  virtual double cellLength(const glm::dvec3& /*direction*/) const {
    return std::numeric_limits<double>::infinity();
  }
};

/// Immutable; any thread may take probes.
class ReferenceField {
 public:
  virtual ~ReferenceField() = default;
  virtual std::unique_ptr<FieldProbe> probe() const = 0;
  /// The corners of a box that holds the field.
  virtual std::pair<glm::dvec3, glm::dvec3> bounds() const = 0;
  /// Appends the distances along a ray between which it lies inside or outside of the field throughout,
  /// unordered. False: they are not known. `direction` has length 1.
  virtual bool crossings(const glm::dvec3& /*origin*/, const glm::dvec3& /*direction*/,
                         std::vector<double>& /*distances*/) const {
    return false;
  }
};

/// An analytic scene. `scene` outlives it. The crossings of half-annulus, half-annulus-constant, shell, o-grid
/// and axis are known.
class SceneField : public ReferenceField {
 public:
  explicit SceneField(const Scene& scene) : scene_(scene) {}
  std::unique_ptr<FieldProbe> probe() const override;
  std::pair<glm::dvec3, glm::dvec3> bounds() const override { return scene_.bounds(); }
  bool crossings(const glm::dvec3& origin, const glm::dvec3& direction,
                 std::vector<double>& distances) const override;

 private:
  const Scene& scene_;
};

/// The part of a field that clip planes leave. The field outlives it.
class ClippedField : public ReferenceField {
 public:
  ClippedField(const ReferenceField& whole, std::vector<ClipPlane> planes)
      : whole_(whole), planes_(std::move(planes)) {}
  std::unique_ptr<FieldProbe> probe() const override;
  std::pair<glm::dvec3, glm::dvec3> bounds() const override { return whole_.bounds(); }
  bool crossings(const glm::dvec3& origin, const glm::dvec3& direction,
                 std::vector<double>& distances) const override;

 private:
  const ReferenceField& whole_;
  const std::vector<ClipPlane> planes_;
};

}  // namespace curvisplat
