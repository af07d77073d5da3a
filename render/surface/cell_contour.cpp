#include "render/surface/cell_contour.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/vector_relational.hpp>
#include <limits>
#include <map>
#include <utility>
#include <vector>

#include "render/surface/node_gradients.h"

namespace curvisplat {
namespace {

constexpr uint32_t kNone = std::numeric_limits<uint32_t>::max();

// Corner c of a cell is at (c & 1, c >> 1 & 1, c >> 2). Edges: four along i, four along j, four along k, from the lower corner.
constexpr std::array<std::array<uint8_t, 2>, 12> kEdges{
    {{0, 1}, {2, 3}, {4, 5}, {6, 7}, {0, 2}, {1, 3}, {4, 6}, {5, 7}, {0, 4}, {1, 5}, {2, 6}, {3, 7}}};
// The corners around each face, as seen from outside counter-clockwise in a right-handed cell, and the edge after each of them.
struct Face {
  std::array<uint8_t, 4> corners, edges;
};
constexpr std::array<Face, 6> kFaces{{{{0, 2, 3, 1}, {4, 1, 5, 0}},
                                      {{4, 5, 7, 6}, {2, 7, 3, 6}},
                                      {{0, 1, 5, 4}, {0, 9, 2, 8}},
                                      {{2, 6, 7, 3}, {10, 3, 11, 1}},
                                      {{0, 4, 6, 2}, {8, 6, 10, 4}},
                                      {{1, 3, 7, 5}, {5, 11, 7, 9}}}};

class Contour {
 public:
  Contour(const GridNodes& nodes, double value, uint64_t most)
      : nodes_(nodes), gradients_(nodes), value_(value), most_(most) {
    mesh_.origin = nodes.origin();
  }

  std::optional<TriangleMesh> find() {
    for (const GridNodes::Block& block : nodes_.blocks())
      if (!addBlock(block)) return std::nullopt;
    for (size_t n = 0; n < slopes_.size(); ++n) {
      // Where the gradient is not known, the mean of the triangles' normals.
      glm::dvec3 normal(slopes_[n] != glm::vec3(0.0f) ? slopes_[n] : mesh_.normals[n]);
      const double length = glm::length(normal);  // its square may be beyond single precision
      mesh_.normals[n] = length > 0 ? glm::vec3(normal / length) : glm::vec3(0, 0, 1);
    }
    return std::move(mesh_);
  }

 private:
  /// The vertices on the edges that begin at the nodes of a plane of the block; kNone: none yet.
  struct OfPlane {
    std::array<std::vector<uint32_t>, 3> along;

    void clear(size_t nodes) {
      for (std::vector<uint32_t>& axis : along) axis.assign(nodes, kNone);
    }
  };

  bool isAbove(size_t node) const { return double{nodes_.value(node)} >= value_; }

  bool addBlock(const GridNodes::Block& block) {
    const size_t ni = block.size[0], nj = block.size[1], plane = ni * nj;
    strides_ = {1, ni, plane};
    upper_.clear(plane);
    for (size_t k = 0; k + 1 < block.size[2]; ++k) {
      std::swap(lower_, upper_);
      upper_.clear(plane);
      for (size_t j = 0; j + 1 < nj; ++j) {
        const size_t row = j * ni, first = block.first + k * plane + row;
        unsigned left = sidesAt(first);
        for (size_t i = 0; i + 1 < ni; ++i) {
          const unsigned right = sidesAt(first + i + 1);
          if ((left | right << 4) != 0 && (left & right) != 0xf) addCell(first + i, row + i);
          left = right;
        }
        if (mesh_.triangles.size() > most_) return false;
      }
    }
    return true;
  }
  /// The sides of the nodes around a face across i: bits of those at or above the value.
  unsigned sidesAt(size_t node) const {
    const size_t j = strides_[1], k = strides_[2];
    return unsigned{isAbove(node)} | unsigned{isAbove(node + j)} << 1 | unsigned{isAbove(node + k)} << 2 |
           unsigned{isAbove(node + j + k)} << 3;
  }

  /// `node`: the lowest one; `in_plane`: its number in the plane.
  void addCell(size_t node, size_t in_plane) {
    std::array<size_t, 8> corners;
    for (size_t c = 0; c < 8; ++c)
      corners[c] = node + (c & 1) * strides_[0] + (c >> 1 & 1) * strides_[1] + (c >> 2) * strides_[2];
    if (nodes_.hasBlanks() &&
        std::any_of(corners.begin(), corners.end(), [this](size_t corner) { return nodes_.isBlank(corner); }))
      return;
    std::array<uint8_t, 12> next;  // [edge]: that the line which begins there ends at
    next.fill(12);
    for (const Face& face : kFaces) addLines(face, corners, next);
    std::array<uint32_t, 12> polygon;
    for (size_t edge = 0; edge < 12; ++edge) {
      if (next[edge] == 12) continue;
      size_t count = 0;
      for (size_t at = edge; next[at] != 12 && count < 12;) {
        polygon[count++] = vertexOn(at, corners, in_plane);
        at = std::exchange(next[at], uint8_t{12});
      }
      addPolygon(std::span(polygon).first(count));
    }
  }
  /// Adds the lines of a face, from where the field rises to the value to where it falls below it.
  void addLines(const Face& face, const std::array<size_t, 8>& corners, std::array<uint8_t, 12>& next) const {
    std::array<bool, 4> above;
    for (size_t n = 0; n < 4; ++n) above[n] = isAbove(corners[face.corners[n]]);
    for (size_t n = 0; n < 4; ++n) {
      if (above[n] || !above[(n + 1) % 4]) continue;
      size_t end = (n + 1) % 4;
      while (above[(end + 1) % 4]) end = (end + 1) % 4;
      next[face.edges[n]] = face.edges[end];
    }
  }
  uint32_t vertexOn(size_t edge, const std::array<size_t, 8>& corners, size_t in_plane) {
    const auto [a, b] = kEdges[edge];
    const size_t place = in_plane + (a & 1) + (a >> 1 & 1) * strides_[1];
    uint32_t& vertex = (a < 4 ? lower_ : upper_).along[edge / 4][place];
    if (vertex == kNone) vertex = vertexBetween(corners[a], corners[b]);
    return vertex;
  }
  /// Blocks that meet, and one that closes on itself, have the vertices of their seam in common.
  uint32_t vertexBetween(size_t a, size_t b) {
    if (!gradients_.isShared(a) || !gradients_.isShared(b)) return makeVertex(a, b);
    a = gradients_.representative(a);
    b = gradients_.representative(b);
    if (b < a) std::swap(a, b);
    const auto [at, is_new] = of_seams_.try_emplace({a, b}, kNone);
    if (is_new) at->second = makeVertex(a, b);
    return at->second;
  }
  uint32_t makeVertex(size_t a, size_t b) {
    const double from = double{nodes_.value(a)} - value_, to = double{nodes_.value(b)} - value_;
    const double part = from / (from - to);
    const glm::dvec3 start(nodes_.position(a)), end(nodes_.position(b));
    const float other = nodes_.hasOther()
                            ? static_cast<float>(double{nodes_.other(a)} +
                                                 part * (double{nodes_.other(b)} - double{nodes_.other(a)}))
                            : 0;
    const glm::dvec3 slope_a = gradients_.at(a), slope_b = gradients_.at(b);
    const glm::vec3 slope(slope_a + part * (slope_b - slope_a));
    const bool known =
        slope_a != glm::dvec3(0.0) && slope_b != glm::dvec3(0.0) && !glm::any(glm::isinf(slope));
    slopes_.push_back(known ? slope : glm::vec3(0.0f));
    mesh_.positions.push_back(glm::vec3(start + part * (end - start)));
    mesh_.normals.emplace_back(0.0f);
    if (nodes_.hasOther()) mesh_.scalars.push_back(other);
    return static_cast<uint32_t>(mesh_.positions.size() - 1);
  }

  /// Cuts the polygon into triangles, at its shortest diagonals first.
  void addPolygon(std::span<uint32_t> polygon) {
    size_t count = polygon.size();
    while (count > 3) {
      size_t ear = 0;
      float shortest = std::numeric_limits<float>::infinity();
      for (size_t n = 0; n < count; ++n) {
        const glm::vec3 diagonal =
            mesh_.positions[polygon[(n + count - 1) % count]] - mesh_.positions[polygon[(n + 1) % count]];
        const float length2 = glm::dot(diagonal, diagonal);
        if (length2 < shortest) shortest = length2, ear = n;
      }
      addTriangle({polygon[(ear + count - 1) % count], polygon[ear], polygon[(ear + 1) % count]});
      std::copy(polygon.begin() + static_cast<std::ptrdiff_t>(ear) + 1,
                polygon.begin() + static_cast<std::ptrdiff_t>(count),
                polygon.begin() + static_cast<std::ptrdiff_t>(ear));
      --count;
    }
    if (count == 3) addTriangle({polygon[0], polygon[1], polygon[2]});
  }
  void addTriangle(const std::array<uint32_t, 3>& corners) {
    const auto at = [&](size_t n) { return mesh_.positions[corners[n]]; };
    const glm::vec3 normal = glm::cross(at(1) - at(0), at(2) - at(0));
    for (const uint32_t corner : corners) mesh_.normals[corner] += normal;
    mesh_.triangles.push_back(corners);
  }

  const GridNodes& nodes_;
  const NodeGradients gradients_;
  const double value_;
  const uint64_t most_;
  std::array<size_t, 3> strides_{};
  OfPlane lower_, upper_;
  std::map<std::pair<size_t, size_t>, uint32_t> of_seams_;  // vertices between two places of several nodes
  std::vector<glm::vec3> slopes_;                           // [vertex]: the field's gradient; 0: not known
  TriangleMesh mesh_;
};

/// Cuts off what is outside of a plane. New vertices are the same whichever triangle asks.
class MeshCut {
 public:
  MeshCut(TriangleMesh& mesh, const ClipPlane& plane) : mesh_(mesh) {
    const glm::dvec3 normal = glm::normalize(plane.normal);
    for (const glm::vec3& at : mesh.positions)
      inside_.push_back(glm::dot(normal, mesh.origin + glm::dvec3(at) - plane.point));
  }

  void cut() {
    std::vector<std::array<uint32_t, 3>> left;
    left.reserve(mesh_.triangles.size());
    for (const std::array<uint32_t, 3>& corners : mesh_.triangles) {
      std::array<uint32_t, 4> polygon;
      size_t count = 0;
      for (size_t n = 0; n < 3; ++n) {
        const uint32_t here = corners[n], after = corners[(n + 1) % 3];
        if (isInside(here)) polygon[count++] = here;
        if (isInside(here) != isInside(after)) polygon[count++] = between(here, after);
      }
      for (size_t n = 2; n < count; ++n) left.push_back({polygon[0], polygon[n - 1], polygon[n]});
    }
    mesh_.triangles = std::move(left);
  }

 private:
  bool isInside(uint32_t vertex) const { return inside_[vertex] >= 0; }
  uint32_t between(uint32_t a, uint32_t b) {
    if (b < a) std::swap(a, b);
    const double part = inside_[a] / (inside_[a] - inside_[b]);
    const auto mixed = [part](const auto& from, const auto& to) {
      return from + static_cast<float>(part) * (to - from);
    };
    mesh_.positions.push_back(mixed(mesh_.positions[a], mesh_.positions[b]));
    const glm::vec3 normal = mesh_.normals[a];  // of either side
    mesh_.normals.push_back(
        mixed(normal, glm::dot(normal, mesh_.normals[b]) < 0 ? -mesh_.normals[b] : mesh_.normals[b]));
    if (!mesh_.scalars.empty()) mesh_.scalars.push_back(mixed(mesh_.scalars[a], mesh_.scalars[b]));
    inside_.push_back(0);
    return static_cast<uint32_t>(mesh_.positions.size() - 1);
  }

  TriangleMesh& mesh_;
  std::vector<double> inside_;  // [vertex]: how far
};

}  // namespace

std::optional<TriangleMesh> contourCells(const GridNodes& nodes, double value,
                                         std::span<const ClipPlane> planes, uint64_t most) {
  std::optional<TriangleMesh> mesh = Contour(nodes, value, most).find();
  if (!mesh) return mesh;
  for (const ClipPlane& plane : planes) MeshCut(*mesh, plane).cut();
  return mesh;
}

}  // namespace curvisplat
