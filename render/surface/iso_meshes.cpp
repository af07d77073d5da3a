#include "render/surface/iso_meshes.h"

#include <algorithm>
#include <utility>

#include "render/surface/cell_contour.h"

namespace curvisplat {
namespace {

/// The bytes of a triangle and its half of a vertex while the mesh is made: in arrays that double when they are full, with the old array
/// beside the new one. It is more than the mesh takes with its vertices on the screen and its runs in tiles.
constexpr uint64_t kTriangleBytes = 80;

/// The most triangles of all isosurfaces together: each cell has few of each.
uint64_t mostTriangles(uint64_t nodes, size_t values) {
  return std::min(IsoMeshes::kMaxTriangles, 4 * nodes * values);
}

bool isSame(const ClipPlane& a, const ClipPlane& b) {
  return a.point == b.point && a.normal == b.normal;
}

}  // namespace

bool IsoMeshes::Wanted::operator==(const Wanted& wanted) const {
  return values == wanted.values && variable == wanted.variable && other == wanted.other &&
         other_is_of_opacities == wanted.other_is_of_opacities && keep_going == wanted.keep_going &&
         std::equal(planes.begin(), planes.end(), wanted.planes.begin(), wanted.planes.end(), isSame);
}

uint64_t IsoMeshes::bytes(const Manifest& manifest, bool two_scalars, size_t values) {
  if (!canBeOf(manifest)) return 0;
  const GridNodes::Bytes bytes = GridNodes::bytes(manifest, two_scalars);
  return std::max(bytes.while_made,
                  bytes.kept + bytes.of_gradients + kTriangleBytes * mostTriangles(manifest.nodes, values));
}

const IsoMeshes::Meshes* IsoMeshes::of(const CacheReader& cache, const Wanted& wanted,
                                       const std::function<void()>& throw_if_stopped) {
  if (!canBeOf(cache.manifest()) || has_lost_seams_) return nullptr;
  if (of_ != wanted) {
    const bool has_nodes = of_ && of_->variable == wanted.variable && of_->other == wanted.other;
    meshes_.reset();
    of_.reset();
    damaged_.clear();
    if (!has_nodes || !nodes_) {
      nodes_.reset();
      nodes_.emplace(cache, wanted.variable, wanted.other, wanted.keep_going, throw_if_stopped);
    }
    damaged_ = nodes_->damaged();
    has_lost_seams_ = !nodes_->areComplete() && damaged_.empty();
    if (nodes_->areComplete())
      contour(wanted);
    else
      nodes_.reset();
    of_ = wanted;
  }
  return meshes_ ? &*meshes_ : nullptr;
}

/// Makes the meshes, and keeps none of them where they have too many triangles together.
void IsoMeshes::contour(const Wanted& wanted) {
  const uint64_t most = mostTriangles(nodes_->size(), wanted.values.size());
  Meshes meshes;
  uint64_t left = most;
  for (const double value : wanted.values) {
    std::optional<TriangleMesh> mesh = contourCells(*nodes_, value, wanted.planes, left);
    if (!mesh) {
      nodes_.reset();
      return;
    }
    left -= std::min<uint64_t>(left, mesh->triangles.size());
    if (wanted.other_is_of_opacities) mesh->opacity_scalars.swap(mesh->scalars);
    meshes.push_back(std::make_shared<const TriangleMesh>(std::move(*mesh)));
  }
  meshes_ = std::move(meshes);
}

void IsoMeshes::release() {
  nodes_.reset();
  meshes_.reset();
  damaged_.clear();
  of_.reset();
  has_lost_seams_ = false;
}

void addIsoSurfaces(const IsoMeshes::Meshes& meshes, const IsoGroup& group, const IsoColours& look,
                    IsoSurfaces& to) {
  for (size_t n = 0; n < meshes.size(); ++n) {
    if (meshes[n]->triangles.empty()) continue;
    const double value = group.values[n];
    Surface surface;
    surface.mesh = meshes[n];
    surface.by_scalar = group.colours_of_other;
    const std::optional<glm::vec3> own = group.ownColour(n);
    surface.own_colour = own.has_value();
    if (own || !surface.by_scalar) surface.colour = own ? *own : look.colours.at(value);
    surface.opacity = {group.opacity.factor, group.opacity.by_function && group.opacities_of_other};
    if (group.opacity.by_function && !group.opacities_of_other && look.opacities)
      surface.opacity.factor *= double{look.opacities->opacityAt(value)};
    if (!(surface.opacity.factor > 0)) continue;
    to.surfaces.push_back(std::move(surface));
    to.values.push_back(value);
  }
}

}  // namespace curvisplat
