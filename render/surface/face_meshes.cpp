#include "render/surface/face_meshes.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <limits>
#include <map>
#include <queue>
#include <tuple>
#include <utility>
#include <vector>

namespace curvisplat {
namespace {

constexpr double kFinestPixels = 0.5;
// Edges may be this many times as long as the error: what an edge leaves out lies within half its length of a
// node that is drawn. With longer ones, smooth normals would suffer.
constexpr double kFreeEdges = 2;
constexpr size_t kMinNodes = 1 << 16;
// Bytes while a mesh is made: nodes, triangles, the mesh itself, and the last picture's vertices on the
// screen.
constexpr uint64_t kBytesANode = 164;

size_t mostNodes(uint64_t pixels) {
  return std::max<size_t>(kMinNodes, pixels);
}

/// How a box looks in a view.
struct BoxInView {
  bool out_of_sight = false;
  double pixels_a_unit = 0;  // of what is nearest

  BoxInView(const FacePatch& patch, const ScreenView& view) {
    const bool perspective = view.projection == Projection::kPerspective;
    const double half_width = 0.5 * view.size.width / view.focal_px;
    const double half_height = 0.5 * view.size.height / view.focal_px;
    double nearest = std::numeric_limits<double>::infinity();
    int beyond[5] = {};
    for (int n = 0; n < 8; ++n) {
      const glm::dvec3 at =
          view.viewFromData({n & 1 ? patch.upper.x : patch.lower.x, n & 2 ? patch.upper.y : patch.lower.y,
                             n & 4 ? patch.upper.z : patch.lower.z});
      nearest = std::min(nearest, at.z);
      const double w = perspective ? at.z : 1;
      beyond[0] += at.x < -half_width * w;
      beyond[1] += at.x > half_width * w;
      beyond[2] += at.y < -half_height * w;
      beyond[3] += at.y > half_height * w;
      beyond[4] += perspective && at.z < view.near;
    }
    out_of_sight = std::any_of(beyond, beyond + 5, [](int corners) { return corners == 8; });
    pixels_a_unit = std::max({view.scale.x, view.scale.y, view.scale.z}) * view.focal_px /
                    (perspective ? std::max(nearest, view.near) : 1);
  }
};

/// Whether a patch has quads of the part.
bool overlaps(const GridFace& face, const FacePatch& patch, const GridSurface::Part& part) {
  for (size_t along = 0; along < 2; ++along)
    if (patch.first[along] >= part.last[along] ||
        latticeIndex(face, patch, along, patch.nodes[along] - 1u) <= part.first[along])
      return false;
  return true;
}

/// The places where a border of a finer patch meets one of a coarser patch along an axis of their face.
class Stitches {
 public:
  Stitches(const FacesReader& faces, const ChosenPatches& chosen, std::vector<PatchNodes>& nodes)
      : faces_(faces), chosen_(chosen), nodes_(nodes) {}

  /// Joins patches from the coarsest on, so that what a patch follows is in its place.
  void join() {
    std::vector<size_t> order(chosen_.size());
    for (size_t n = 0; n < order.size(); ++n) order[n] = n;
    const auto size_of = [&](size_t n) {
      const FacePatch& patch = patchOf(n);
      return uint64_t{patch.stride[0]} * patch.stride[1];
    };
    std::stable_sort(order.begin(), order.end(), [&](size_t a, size_t b) { return size_of(a) > size_of(b); });
    findBorders();
    for (const size_t fine : order)
      for (const auto& [coarse, along] : coarserBeside(fine)) follow(fine, coarse, along);
  }

 private:
  /// A line of a part's face on which patches begin or end: the part, the axis across it, the index.
  using Line = std::tuple<uint32_t, size_t, uint64_t>;
  using Borders = std::map<Line, std::vector<size_t>>;

  void findBorders() {
    for (size_t n = 0; n < chosen_.size(); ++n)
      for (const size_t across : {size_t{0}, size_t{1}}) {
        begins_[{chosen_[n].first, across, patchOf(n).first[across]}].push_back(n);
        ends_[{chosen_[n].first, across, endOf(patchOf(n), across)}].push_back(n);
      }
  }
  /// Patches that are coarser along a line on which a patch begins or ends, and the axis of that line, in their order.
  std::vector<std::pair<size_t, size_t>> coarserBeside(size_t fine) const {
    std::vector<std::pair<size_t, size_t>> found;
    const FacePatch& patch = patchOf(fine);
    const auto add = [&](const Borders& borders, size_t across, uint64_t index) {
      const auto beside = borders.find({chosen_[fine].first, across, index});
      if (beside == borders.end()) return;
      for (const size_t coarse : beside->second)
        if (patchOf(coarse).stride[1 - across] > patch.stride[1 - across])
          found.emplace_back(coarse, 1 - across);
    };
    for (const size_t across : {size_t{0}, size_t{1}}) {
      add(ends_, across, patch.first[across]);
      add(begins_, across, endOf(patch, across));
    }
    std::sort(found.begin(), found.end());
    found.erase(std::unique(found.begin(), found.end()), found.end());
    return found;
  }
  /// The last index of a patch along an axis.
  uint64_t endOf(const FacePatch& patch, size_t axis) const {
    return latticeIndex(faces_.faces()[patch.face], patch, axis, patch.nodes[axis] - 1u);
  }
  const FacePatch& patchOf(size_t n) const { return faces_.patches()[chosen_[n].second]; }
  static size_t placeOf(const FacePatch& patch, size_t along, uint64_t n, uint64_t across) {
    return along == 0 ? across * patch.nodes[0] + n : n * patch.nodes[0] + across;
  }

  void follow(size_t fine_number, size_t coarse_number, size_t along) {
    const FacePatch &fine = patchOf(fine_number), &coarse = patchOf(coarse_number);
    const GridFace& face = faces_.faces()[fine.face];
    const size_t across = 1 - along;
    const bool below = fine.first[across] == endOf(coarse, across);
    const bool above = endOf(fine, across) == coarse.first[across];
    const uint64_t from = std::max(fine.first[along], coarse.first[along]);
    const uint64_t to = std::min(endOf(fine, along), endOf(coarse, along));
    if ((!below && !above) || from >= to) return;
    const uint64_t border = below ? 0 : fine.nodes[across] - 1u;
    const uint64_t of_coarse = below ? coarse.nodes[across] - 1u : 0;
    for (uint64_t n = 0; n < fine.nodes[along]; ++n) {
      const uint64_t at = latticeIndex(face, fine, along, n);
      if (at < from || at > to) continue;
      const uint64_t before =
          std::min<uint64_t>((at - coarse.first[along]) / coarse.stride[along], coarse.nodes[along] - 2u);
      const uint64_t a = latticeIndex(face, coarse, along, before),
                     b = latticeIndex(face, coarse, along, before + 1);
      if (at == a || at == b) continue;
      const double part = static_cast<double>(at - a) / static_cast<double>(b - a);
      move(nodes_[fine_number], placeOf(fine, along, n, border), nodes_[coarse_number],
           {placeOf(coarse, along, before, of_coarse), placeOf(coarse, along, before + 1, of_coarse)}, part);
    }
  }

  static void move(PatchNodes& fine, size_t at, const PatchNodes& coarse,
                   const std::array<size_t, 2>& between, double part) {
    fine.positions[at] = glm::mix(coarse.positions[between[0]], coarse.positions[between[1]], part);
    for (size_t s = 0; s < fine.scalars.size(); ++s)
      fine.scalars[s][at] =
          std::lerp(coarse.scalars[s][between[0]], coarse.scalars[s][between[1]], static_cast<float>(part));
  }

  const FacesReader& faces_;
  const ChosenPatches& chosen_;
  std::vector<PatchNodes>& nodes_;
  Borders begins_, ends_;
};

void appendQuads(const GridSurface& surface, const std::pair<uint32_t, uint32_t>& chosen,
                 const PatchNodes& nodes, RawMesh& mesh) {
  const GridSurface::Part& part = surface.parts[chosen.first];
  const FacePatch& patch = surface.faces->patches()[chosen.second];
  const GridFace& face = surface.faces->faces()[patch.face];
  const auto first = static_cast<uint32_t>(mesh.positions.size());
  mesh.positions.insert(mesh.positions.end(), nodes.positions.begin(), nodes.positions.end());
  if (surface.scalar) {
    const std::vector<float>& scalars = nodes.scalars[*surface.scalar];
    mesh.scalars.insert(mesh.scalars.end(), scalars.begin(), scalars.end());
  }
  if (surface.opacity_scalar)
    mesh.opacity_scalars.insert(mesh.opacity_scalars.end(), nodes.scalars.back().begin(),
                                nodes.scalars.back().end());
  // Whether the middle of a quad, along an axis, lies in the part.
  const auto inside = [&](size_t along, uint64_t n) {
    const uint64_t twice = latticeIndex(face, patch, along, n) + latticeIndex(face, patch, along, n + 1);
    return twice > 2 * part.first[along] && twice < 2 * part.last[along];
  };
  for (uint32_t r = 0; r + 1u < patch.nodes[1]; ++r) {
    if (!inside(1, r)) continue;
    for (uint32_t c = 0; c + 1u < patch.nodes[0]; ++c) {
      if (!nodes.quads[r * (patch.nodes[0] - 1u) + c] || !inside(0, c)) continue;
      const uint32_t a = first + r * patch.nodes[0] + c, b = a + 1, d = a + patch.nodes[0], e = d + 1;
      const auto apart = [&](uint32_t from, uint32_t to) {
        const glm::dvec3 way = mesh.positions[to] - mesh.positions[from];
        return glm::dot(way, way);
      };
      if (apart(a, e) <= apart(b, d))
        mesh.triangles.insert(mesh.triangles.end(), {{a, b, e}, {a, e, d}});
      else
        mesh.triangles.insert(mesh.triangles.end(), {{a, b, d}, {b, e, d}});
    }
  }
}

double longestEdge(double pixels) {
  return std::max({pixels, std::min(2 * pixels, kFreeEdges), kFinestPixels});
}

}  // namespace

ChosenPatches choosePatches(const GridSurface& surface, const ScreenView& view, double pixels,
                            size_t max_nodes) {
  struct Candidate {
    double error_px;
    uint32_t part, patch;
    bool operator<(const Candidate& other) const {
      return std::tie(error_px, other.part, other.patch) < std::tie(other.error_px, part, patch);
    }
  };
  const std::span<const FacePatch> patches = surface.faces->patches();
  std::priority_queue<Candidate> coarse;
  ChosenPatches chosen;
  size_t nodes = 0;
  const double allowed = longestEdge(pixels);
  const auto add = [&](uint32_t part, uint32_t number) {
    const FacePatch& patch = patches[number];
    if (!overlaps(surface.faces->faces()[patch.face], patch, surface.parts[part])) return;
    const BoxInView seen(patch, view);
    if (seen.out_of_sight) return;
    nodes += patch.nodeCount();
    const double error_px = double{patch.error} * seen.pixels_a_unit;
    if (patch.child_count > 0 && error_px > allowed)
      coarse.push({error_px, part, number});
    else
      chosen.emplace_back(part, number);
  };
  for (uint32_t part = 0; part < surface.parts.size(); ++part)
    add(part, surface.faces->faces()[surface.parts[part].face].root);
  while (!coarse.empty()) {
    const Candidate refined = coarse.top();
    coarse.pop();
    const FacePatch& patch = patches[refined.patch];
    size_t of_children = 0;
    for (uint32_t n = 0; n < patch.child_count; ++n)
      of_children += patches[patch.first_child + n].nodeCount();
    if (nodes - patch.nodeCount() + of_children > max_nodes) {
      chosen.emplace_back(refined.part, refined.patch);
      continue;
    }
    nodes -= patch.nodeCount();
    for (uint32_t n = 0; n < patch.child_count; ++n) add(refined.part, patch.first_child + n);
  }
  std::sort(chosen.begin(), chosen.end());
  return chosen;
}

TriangleMesh meshOfPatches(const GridSurface& surface, const ChosenPatches& chosen) {
  std::vector<PatchNodes> nodes(chosen.size());
  tbb::parallel_for(size_t{0}, chosen.size(), [&](size_t n) {
    nodes[n] = surface.faces->read(chosen[n].second);
    if (!surface.opacity_scalar) return;
    // The last of the scalars, and stitched with them.
    PatchNodes other;
    if (surface.opacity_faces != surface.faces) other = surface.opacity_faces->read(chosen[n].second);
    PatchNodes& from = surface.opacity_faces != surface.faces ? other : nodes[n];
    std::vector<float> values = from.scalars[*surface.opacity_scalar];
    nodes[n].scalars.push_back(std::move(values));
  });
  Stitches(*surface.faces, chosen, nodes).join();
  RawMesh mesh;
  for (size_t n = 0; n < chosen.size(); ++n) {
    appendQuads(surface, chosen[n], nodes[n], mesh);
    nodes[n] = {};
  }
  return meshOf(std::move(mesh));
}

SurfaceScene FaceMeshes::withMeshes(const std::shared_ptr<const SurfaceScene>& scene, const ScreenView& view,
                                    double lod_pixels) {
  kept_.resize(scene->grid_surfaces.size());
  SurfaceScene drawn = *scene;
  for (size_t n = 0; n < kept_.size(); ++n) {
    const GridSurface& surface = scene->grid_surfaces[n];
    ChosenPatches chosen =
        choosePatches(surface, view, lod_pixels, mostNodes(view.size.pixels()) / kept_.size());
    if (!kept_[n].mesh || chosen != kept_[n].chosen || !surface.hasMeshOf(kept_[n].surface)) {
      kept_[n].mesh = nullptr;
      kept_[n].mesh = std::make_shared<TriangleMesh>(meshOfPatches(surface, chosen));
      kept_[n].surface = surface;
      kept_[n].chosen = std::move(chosen);
    }
    drawn.surfaces.push_back({kept_[n].mesh, surface.colour, surface.scalar.has_value(), surface.colours,
                              surface.opacity, surface.map, surface.own_colour});
  }
  return drawn;
}

uint64_t FaceMeshes::bytes(const SurfaceScene& scene, uint64_t pixels) {
  uint64_t nodes = 0, coarsest = 0;
  for (const GridSurface& surface : scene.grid_surfaces)
    for (const GridSurface::Part& part : surface.parts) {
      const GridFace& face = surface.faces->faces()[part.face];
      nodes += face.nodes[0] * face.nodes[1];
      coarsest += surface.faces->patches()[face.root].nodeCount();
    }
  return kBytesANode * std::max(coarsest, std::min<uint64_t>(nodes, mostNodes(pixels)));
}

}  // namespace curvisplat
