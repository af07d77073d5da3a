// Analytic curvilinear scenes: grids of any size whose positions, scalar, inverse mapping and volume are
// known in closed form. `curvisplat generate` writes them, and tests use them as ground truth.
#pragma once

#include <glm/vec3.hpp>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "preprocess/grid/grid_source.h"
#include "preprocess/scenes/scene.h"

namespace curvisplat {

/// half-annulus           half a pipe with a wavy floor; cells clustered towards the inner wall
/// half-annulus-constant  the same grid, f = 0.5 everywhere
/// shell                  the same grid; f is a thin layer on the inner wall
/// o-grid                 the full annulus with the field of half-annulus; periodic along i
/// axis                   the same down to the axis: at j = 0 all i coincide on a line
/// sheared-waves          a parallelepiped of uniform, strongly sheared cells; f has waves
/// wake                   an O-grid around a cylinder with a vortex street; periodic along i; cells at the
///                        wall are e^clustering times thinner than the outermost ones
/// spectral               a wavy channel with Gauss-Lobatto spacing (rough_scenes.h, as all below)
/// dome                   a half ball with a flat base; cells grow by 1.5 from one to the next; periodic along i
/// globe                  six thin shells, the faces of a cubed sphere: six blocks
/// duct                   three abutting blocks of a bent duct, with cells of very different lengths
/// boundary-layer         layers on the half of a pipe, 0.04 of its radius together; f falls as the root of the distance
/// ocean                  a sixth of a sphere, a thousandth of its radius deep, not exaggerated; f is warm at the surface
std::vector<std::string> sceneNames();

/// The blocks of a scene: one, except for globe (6) and duct (3). `clustering`: the outermost cells along j
/// are about e^clustering times as long as the innermost; nullopt: the scene's default (2.5; shell 4, axis 1,
/// wake 9, dome 9.7, boundary-layer 4.5, ocean 3). Throws UsageError for an unknown name (listing the names), for a clustering outside
/// (0, 20], and for a clustering of a scene without one.
std::vector<std::shared_ptr<const Scene>> makeScenes(std::string_view name,
                                                     std::optional<double> clustering = std::nullopt);
/// The time of a scene, for those that change: wake. Its vortices move down the street by a wave length per
/// unit of time. `moving`: the grid sways along y as well, fixed at the cylinder's upstream side.
struct SceneTime {
  double time = 0;
  bool moving = false;
};
/// The wake at a time. Throws UsageError for another scene, and as makeScenes().
std::vector<std::shared_ptr<const Scene>> makeScenesAt(std::string_view name,
                                                       std::optional<double> clustering,
                                                       const SceneTime& time);
/// Makes a scene of one block, as makeScenes() does.
std::shared_ptr<const Scene> makeScene(std::string_view name,
                                       std::optional<double> clustering = std::nullopt);

struct SceneGridSize {
  uint64_t ni = 0, nj = 0, nk = 0;
};

/// A scene sampled at ni x nj x nk nodes per block, from u, v, w = 0 to 1 inclusive, evaluated at each read.
/// One scalar, "f". Memory: three tables of ni, nj and nk entries per block.
class SceneGridSource : public GridSource {
 public:
  /// `coordinate_bytes`: 4 rounds the coordinates to single precision, as a file would; 8 does not. Throws
  /// UsageError if a dimension has fewer than two nodes.
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
