#include "tools/options/still_faces.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <initializer_list>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "preprocess/grid/grid_source.h"
#include "stream/base/error.h"

namespace curvisplat {
namespace {

/// Values below this part of the largest one are zero, as far as what is stored, which is rounded, can tell.
constexpr double kZero = 1e-4;
/// The part of a rectangle's cells that has to rest: a ragged edge does not hide a wall.
constexpr double kFilled = 0.9;

/// A component of the velocity, or of the momentum, as the faces have it.
struct Component {
  std::shared_ptr<const FacesReader> faces;
  size_t scalar;
};

/// The three components, and what is zero among their values: nothing is above it.
struct Flow {
  std::vector<Component> components;
  double zero = 0;
};

std::optional<size_t> variableCalled(const Manifest& manifest, const char* name) {
  for (size_t n = 0; n < manifest.variables.size(); ++n)
    if (simplifiedName(manifest.variables[n].name) == name) return n;
  return std::nullopt;
}

/// Finds the three components; none if one of them is missing.
Flow flowOf(const Manifest& manifest, const FacesReader& like, const FacesWith& faces_with) {
  constexpr std::array<std::array<const char*, 3>, 8> kNames{{{"velocityx", "velocityy", "velocityz"},
                                                              {"velocity:x", "velocity:y", "velocity:z"},
                                                              {"u", "v", "w"},
                                                              {"momentumx", "momentumy", "momentumz"},
                                                              {"momentum:x", "momentum:y", "momentum:z"},
                                                              {"xmomentum", "ymomentum", "zmomentum"},
                                                              {"rhou", "rhov", "rhow"},
                                                              {"svu", "svv", "svw"}}};
  for (const auto& names : kNames) {
    Flow flow;
    for (const char* name : names) {
      const auto variable = variableCalled(manifest, name);
      if (!variable) break;
      const VariableInfo& info = manifest.variables[*variable];
      try {
        const auto faces = faces_with(info.name);
        const auto scalar = faces ? faces->scalarOf(info.number) : std::nullopt;
        if (!scalar || faces->patches().size() != like.patches().size()) return {};
        // Scalars of one file are read together.
        const bool is_same =
            !flow.components.empty() && flow.components.back().faces->path() == faces->path();
        flow.components.push_back({is_same ? flow.components.back().faces : faces, *scalar});
        flow.zero = std::max({flow.zero, kZero * std::abs(info.min), kZero * std::abs(info.max)});
      } catch (const Error&) {
        return {};  // faces of an earlier version, without these values: nothing is known of their flow
      }
    }
    if (flow.components.size() == names.size()) return flow;
  }
  return {};
}

struct RestingNodes {
  std::vector<uint8_t> rests;  // [node of the patch]
  std::vector<uint8_t> quads;  // PatchNodes::quads
};

RestingNodes nodesAtRest(const Flow& flow, uint32_t patch) {
  RestingNodes nodes;
  const FacesReader* read_from = nullptr;
  PatchNodes read;
  for (const Component& one : flow.components) {
    if (read_from != one.faces.get()) read = one.faces->read(patch);
    read_from = one.faces.get();
    const std::vector<float>& values = read.scalars.at(one.scalar);
    nodes.rests.resize(values.size(), 1);
    for (size_t n = 0; n < values.size(); ++n)
      if (!(std::abs(static_cast<double>(values[n])) <= flow.zero)) nodes.rests[n] = 0;
  }
  nodes.quads = std::move(read.quads);
  return nodes;
}

bool anyAtRest(const Flow& flow, const GridFace& face) {
  if (face.side == FaceSide::kPlane || face.root == kNoPatch) return false;
  const std::vector<uint8_t> rests = nodesAtRest(flow, face.root).rests;
  return std::ranges::find(rests, 1) != rests.end();
}

/// The rectangle of a face's cells whose four nodes are at rest; none if others fill more than a tenth of it.
class RestingCells {
 public:
  void add(const GridFace& face, const FacePatch& patch, const RestingNodes& nodes) {
    const auto& [rests, quads] = nodes;
    const size_t across = patch.nodes[0];
    for (uint64_t v = 0; v + 1 < patch.nodes[1]; ++v)
      for (uint64_t u = 0; u + 1 < across; ++u) {
        const size_t at = v * across + u;
        if (!quads[v * (across - 1) + u]) continue;  // blanked, or another block goes on there
        if (!(rests[at] && rests[at + 1] && rests[at + across] && rests[at + across + 1])) continue;
        const std::array<uint64_t, 2> node{latticeIndex(face, patch, 0, u), latticeIndex(face, patch, 1, v)};
        for (size_t along = 0; along < 2; ++along) {
          first_[along] = number_ == 0 ? node[along] : std::min(first_[along], node[along]);
          last_[along] = number_ == 0 ? node[along] + 1 : std::max(last_[along], node[along] + 1);
        }
        ++number_;
      }
  }
  std::optional<GridSurface::Part> partOf(uint32_t face) const {
    constexpr uint64_t kFewest = 4;
    const double cells =
        static_cast<double>(last_[0] - first_[0]) * static_cast<double>(last_[1] - first_[1]);
    if (number_ < kFewest || static_cast<double>(number_) < kFilled * cells) return std::nullopt;
    return GridSurface::Part{face, first_, last_};
  }

 private:
  std::array<uint64_t, 2> first_{}, last_{};
  uint64_t number_ = 0;
};

}  // namespace

std::vector<GridSurface::Part> stillParts(const Manifest& manifest, const FacesReader& faces,
                                          const FacesWith& faces_with) {
  const Flow flow = flowOf(manifest, faces, faces_with);
  std::vector<GridSurface::Part> parts;
  if (flow.components.empty() || flow.zero == 0) return parts;  // of a flow without motion nothing is known
  for (uint32_t n = 0; n < faces.faces().size(); ++n) {
    const GridFace& face = faces.faces()[n];
    if (!anyAtRest(flow, face)) continue;
    RestingCells cells;
    for (uint32_t patch = 0; patch < faces.patches().size(); ++patch) {
      const FacePatch& info = faces.patches()[patch];
      if (info.face == n && info.child_count == 0) cells.add(face, info, nodesAtRest(flow, patch));
    }
    if (const auto part = cells.partOf(n)) parts.push_back(*part);
  }
  return parts;
}

}  // namespace curvisplat
