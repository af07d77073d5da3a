// Isosurfaces in the cells of the grid, as surfaces of a scene: for caches whose nodes can be found again (grid_nodes.h), and where they
// have at most kMaxTriangles triangles. Which pictures that are depends on the cache, the values and the clip planes alone, not on the
// view, memory, threads or ranks. All others have isosurfaces of the field of splats (iso_layers.h).
//
// Nodes and meshes stay from picture to picture: a further view costs no more than its triangles. One thread at a time.
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
    bool other_is_of_opacities = false;          // alone; else they are the meshes' scalars
    bool keep_going = false;                     // false: a damaged leaf is an error

    bool operator==(const Wanted& wanted) const;
  };
  using Meshes = std::vector<std::shared_ptr<const TriangleMesh>>;  // [value]

  /// Whether isosurfaces of the cache may be made so.
  static bool canBeOf(const Manifest& manifest) { return GridNodes::canBeOf(manifest); }
  /// About the most that they take, with what is kept from picture to picture.
  static uint64_t bytes(const Manifest& manifest, bool two_scalars, size_t values);

  /// The meshes; null where they are of another cache than canBeOf() says, have too many triangles, or leaves are damaged. Valid until the
  /// next call. Throws as GridNodes does.
  const Meshes* of(const CacheReader& cache, const Wanted& wanted,
                   const std::function<void()>& throw_if_stopped);
  /// The damaged leaves that the last call to of() met, with one line each that says why.
  const std::map<uint32_t, std::string>& damaged() const { return damaged_; }
  /// Forgets all: the cache is at another step, or the memory is needed.
  void release();

 private:
  void contour(const Wanted& wanted);

  std::optional<GridNodes> nodes_;
  std::optional<Wanted> of_;  // that the nodes and the meshes are of
  std::optional<Meshes> meshes_;
  std::map<uint32_t, std::string> damaged_;
  bool has_lost_seams_ = false;  // nodes that blocks share are not found, whichever scalar is asked for
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
/// Adds the meshes of a group, except for those that nothing is seen of.
void addIsoSurfaces(const IsoMeshes::Meshes& meshes, const IsoGroup& group, const IsoColours& look,
                    IsoSurfaces& to);

}  // namespace curvisplat
