// Analytic curvilinear scenes: grids of any size whose positions, scalar, inverse mapping and volume are
// known in closed form. They are what `curvisplat generate` writes and what the tests compare with.
//
// A scene maps the unit cube (u, v, w), along i, j, k, to the world. The mapping is put together from one
// function an axis, so that a grid needs three small tables and no transcendental function a node.
#pragma once

#include <glm/vec3.hpp>
#include <glm/vec4.hpp>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "preprocess/grid/grid_source.h"

namespace curvisplat {

/// Immutable; any thread may ask.
class Scene {
 public:
  virtual ~Scene() = default;

  const std::string& name() const { return name_; }

  /// Where (u, v, w) in [0, 1]³ lies in the world.
  glm::dvec3 position(const glm::dvec3& uvw) const {
    return join(alongU(uvw.x), alongV(uvw.y), alongW(uvw.z));
  }
  /// The (u, v, w) of a point of the world; none outside of the scene.
  virtual std::optional<glm::dvec3> inverse(const glm::dvec3& world) const = 0;
  bool contains(const glm::dvec3& world) const { return inverse(world).has_value(); }
  /// The scalar "f", in [0, 1]; defined outside of the scene too.
  virtual double scalar(const glm::dvec3& world) const = 0;
  /// Of the image of the unit cube, world units.
  virtual double volume() const = 0;

  /// The corners of a box that holds the scene, tightly.
  virtual std::pair<glm::dvec3, glm::dvec3> bounds() const = 0;

  /// The parts of position(): join(alongU(u), alongV(v), alongW(w)) is the position of (u, v, w).
  virtual glm::dvec3 alongU(double u) const = 0;
  virtual glm::dvec3 alongV(double v) const = 0;
  virtual glm::dvec3 alongW(double w) const = 0;
  virtual glm::dvec3 join(const glm::dvec3& of_u, const glm::dvec3& of_v, const glm::dvec3& of_w) const = 0;

 protected:
  explicit Scene(std::string name) : name_(std::move(name)) {}

 private:
  std::string name_;
};

/// half-annulus           design section 9: half a pipe with a wavy floor, cells clustered towards the inside
/// half-annulus-constant  the same grid, f = 0.5 everywhere
/// shell                  the same grid, f a thin layer on the inner wall
/// o-grid                 the whole annulus, with half-annulus' field; i closes on itself
/// axis                   the same down to the axis: j = 0 is a line, and all i are in one place there
/// sheared-waves          a parallelepiped of even, strongly sheared cells, with waves
/// wake                   an O-grid around a cylinder with a vortex street behind it; i closes on itself, and
///                        wall cells are e^clustering times thinner than the outermost ones
/// spectral, dome, globe, duct   rough_scenes.h
std::vector<std::string> sceneNames();

/// The blocks of a scene: one, but for globe (6) and duct (3). `clustering`: the outermost cells along j are about
/// e^clustering times as long as the innermost; none: the scene's own (2.5; shell 4, axis 1, wake 9, dome 9.7). Throws
/// UsageError for another name (it lists the names there are) and for a clustering that is not in (0, 20], or that the
/// scene does not have.
std::vector<std::shared_ptr<const Scene>> makeScenes(std::string_view name,
                                                     std::optional<double> clustering = std::nullopt);
/// A scene of one block.
std::shared_ptr<const Scene> makeScene(std::string_view name,
                                       std::optional<double> clustering = std::nullopt);

struct SceneGridSize {
  uint64_t ni = 0, nj = 0, nk = 0;
};

/// A scene sampled at ni x nj x nk nodes a block, from u, v, w = 0 to 1 inclusive, evaluated as it is read. One
/// scalar, "f". Memory: three tables of ni, nj and nk entries a block.
class SceneGridSource : public GridSource {
 public:
  /// `coordinate_bytes`: 4 rounds the coordinates to single precision, as a file would; 8 does not. Throws
  /// UsageError unless each dimension has at least two nodes.
  SceneGridSource(std::vector<std::shared_ptr<const Scene>> blocks, SceneGridSize size,
                  int coordinate_bytes = 8);
  SceneGridSource(std::shared_ptr<const Scene> scene, SceneGridSize size, int coordinate_bytes = 8)
      : SceneGridSource(std::vector{std::move(scene)}, size, coordinate_bytes) {}

  const GridDescription& description() const override { return description_; }
  void read(uint32_t block, const NodeBox& box, std::span<const uint32_t> scalars,
            NodeArrays& out) const override;

 private:
  struct Block {
    std::shared_ptr<const Scene> scene;
    std::vector<glm::dvec3> of_i, of_j, of_k;
  };

  GridDescription description_;
  std::vector<Block> blocks_;
};

}  // namespace curvisplat
