// The triangles of an isosurface while cells are contoured: vertices have a number from the first cell that meets them on, and go out
// in this order once no further cell can meet them, with the mean normal of the triangles around them.
//
// A vertex lies on an edge between two points of the grid, whose numbers name it; one that lies exactly at a point is named by that point
// alone, so that all cells around the point share it. One thread.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <glm/vec3.hpp>
#include <unordered_map>

namespace curvisplat {

/// Takes the vertices of a mesh, in the order of their numbers from 0 on, and its triangles, whose corners may come later.
class TriangleSink {
 public:
  virtual ~TriangleSink() = default;
  /// Throws Error if there are too many, or if they cannot be written.
  virtual void addVertex(const glm::dvec3& at, const glm::vec3& normal) = 0;
  virtual void addTriangle(const std::array<uint32_t, 3>& corners) = 0;
};

class ContourMesh {
 public:
  /// Two points, by their numbers; the lower one first. Equal: the vertex is at the point.
  struct Edge {
    uint64_t first = 0, second = 0;

    bool operator==(const Edge& other) const = default;
  };

  explicit ContourMesh(TriangleSink& sink) : sink_(&sink) {}

  /// The number of the vertex on an edge. Throws Error if there are 2^31.
  uint32_t vertexOn(const Edge& edge, const glm::dvec3& at);
  /// The place of a vertex that was not forgotten.
  const glm::dvec3& at(uint32_t vertex) const { return waiting_[vertex - sent_].at; }
  /// Adds a triangle, counter-clockwise as seen from smaller values. One with two equal corners is left out.
  void addTriangle(const std::array<uint32_t, 3>& corners);
  /// Forgets the vertices of edges that keep(edge) says no to: no further cell has them.
  template <typename Keep>
  void keepOnly(const Keep& keep) {
    std::erase_if(vertices_, [&](const auto& vertex) {
      const bool forget = !keep(vertex.first);
      if (forget) waiting_[vertex.second - sent_].complete = true;
      return forget;
    });
    send();
  }
  /// Forgets all.
  void finish() {
    keepOnly([](const Edge&) { return false; });
  }

 private:
  struct Hash {
    size_t operator()(const Edge& edge) const;
  };
  struct Vertex {
    glm::dvec3 at;
    glm::dvec3 normal{0.0};  // the sum of the triangles', by area
    bool complete = false;
  };
  void send();

  TriangleSink* sink_;
  std::unordered_map<Edge, uint32_t, Hash> vertices_;
  std::deque<Vertex> waiting_;  // from number sent_ on
  uint32_t sent_ = 0;
};

}  // namespace curvisplat
