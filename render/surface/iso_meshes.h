// Isosurfaces in the cells of the grid, as surfaces of a scene: for caches whose nodes can be found again
// (grid_nodes.h), and where they have at most kMaxTriangles triangles. Whether that is so depends on the
// cache, the values and the clip planes alone, not on the view, memory, threads or ranks. All other pictures
// have isosurfaces of the splats' field (iso_layers.h).
//
// Nodes and meshes are kept between pictures: another view only draws the triangles again. One thread at a
// time.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "render/project/plane_cuts.h"
#include "render/surface/grid_nodes.h"
#include "render/surface/iso_groups.h"
#include "render/surface/surface_scene.h"
#include "stream/cache/cache_reader.h"

namespace curvisplat {

class IsoMeshes {
 public:
  /// The most triangles of all isosurfaces of a picture. It bounds the memory.
  static constexpr uint64_t kMaxTriangles = 200000;

  /// The isosurfaces of a scalar, and what they are coloured or made translucent by.
  struct Wanted {
    std::vector<double> values;
    std::vector<ClipPlane> planes;
    size_t variable = 0;
    std::optional<size_t> other = std::nullopt;  // another variable, whose values the meshes have, too
    bool other_is_of_opacities = false;          // true: it gives the opacities alone; false: the colours
    bool keep_going = false;                     // false: a damaged leaf is an error

    bool operator==(const Wanted& wanted) const;
  };
  using Meshes = std::vector<std::shared_ptr<const TriangleMesh>>;  // [value]

  /// Whether the cache's isosurfaces can be contoured in the grid's cells.
  static bool canBeOf(const Manifest& manifest) { return GridNodes::canBeOf(manifest); }
  /// The bytes of memory that they take at most, approximately, with what is kept between pictures.
  static uint64_t bytes(const Manifest& manifest, bool two_scalars, size_t values);

  /// The meshes, valid until the next call; null if canBeOf() is false for the cache, they have too many
  /// triangles, or leaves are damaged. Throws as GridNodes does.
  const Meshes* of(const CacheReader& cache, const Wanted& wanted,
                   const std::function<void()>& throw_if_stopped);
  /// The damaged leaves that the last call to of() met, with one line each that says why.
  const std::map<uint32_t, std::string>& damaged() const { return damaged_; }
  /// Frees nodes and meshes, for when the cache goes to another step or the memory is needed.
  void release();

 private:
  void contour(const Wanted& wanted);

  std::optional<GridNodes> nodes_;
  std::optional<Wanted> of_;  // what nodes_ and meshes_ were made for
  std::optional<Meshes> meshes_;
  std::map<uint32_t, std::string> damaged_;
  bool has_lost_seams_ = false;  // the nodes that blocks share cannot be found, for any scalar
};

/// Isosurfaces as surfaces of a scene, and the value of each.
struct IsoSurfaces {
  std::vector<Surface> surfaces;
  std::vector<double> values;
};
struct IsoColours {
  const ColourTable& colours;
  const ColourTable* opacities;  // of the picture's function; null: no opacity is taken from it
};
/// Adds the meshes of a group, except empty and fully transparent ones.
void addIsoSurfaces(const IsoMeshes::Meshes& meshes, const IsoGroup& group, const IsoColours& look,
                    IsoSurfaces& to);

}  // namespace curvisplat
