#include "preprocess/contour/contour_mesh.h"

#include <glm/geometric.hpp>
#include <limits>

#include "stream/base/error.h"

namespace curvisplat {

size_t ContourMesh::Hash::operator()(const Edge& edge) const {
  constexpr uint64_t kOdd = 0x9e3779b97f4a7c15;
  uint64_t mixed = (edge.first * kOdd) ^ (edge.second + (edge.first >> 7));
  mixed *= kOdd;
  return static_cast<size_t>(mixed ^ (mixed >> 32));
}

uint32_t ContourMesh::vertexOn(const Edge& edge, const glm::dvec3& at) {
  const uint64_t next = uint64_t{sent_} + waiting_.size();
  if (next >= std::numeric_limits<int32_t>::max())
    throw Error(
        "the isosurface has more than 2^31 vertices; contour fewer cells, or give --voxels instead of "
        "--source");
  const auto [found, is_new] = vertices_.try_emplace(edge, static_cast<uint32_t>(next));
  if (is_new) waiting_.push_back({at});
  return found->second;
}

void ContourMesh::addTriangle(const std::array<uint32_t, 3>& corners) {
  const auto [a, b, c] = corners;
  if (a == b || b == c || c == a) return;
  const glm::dvec3 normal = glm::cross(at(b) - at(a), at(c) - at(a));
  for (const uint32_t corner : corners) waiting_[corner - sent_].normal += normal;
  sink_->addTriangle(corners);
}

void ContourMesh::send() {
  while (!waiting_.empty() && waiting_.front().complete) {
    const Vertex& vertex = waiting_.front();
    const double length = glm::length(vertex.normal);
    sink_->addVertex(vertex.at, length > 0 ? glm::vec3(vertex.normal / length) : glm::vec3(0, 0, 1));
    waiting_.pop_front();
    ++sent_;
  }
}

}  // namespace curvisplat
