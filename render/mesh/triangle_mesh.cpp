#include "render/mesh/triangle_mesh.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <glm/geometric.hpp>
#include <numbers>
#include <utility>

namespace curvisplat {
namespace {

constexpr double kSharpAngleDegrees = 40;
constexpr double kSliver = 1e-6;  // height over length

uint64_t hashOf(const glm::dvec3& p) {
  uint64_t hash = 0;
  for (int axis = 0; axis < 3; ++axis) {
    hash ^= std::bit_cast<uint64_t>(p[axis] + 0.0);  // -0 becomes 0
    hash *= 0x9e3779b97f4a7c15u;
    hash ^= hash >> 29;
  }
  return hash;
}

/// The first position that equals each position.
std::vector<uint32_t> firstEqual(const std::vector<glm::dvec3>& positions) {
  const size_t slots = std::bit_ceil(2 * positions.size() + 1);
  constexpr uint32_t kFree = ~uint32_t{0};
  std::vector<uint32_t> table(slots, kFree), first(positions.size());
  for (uint32_t n = 0; n < positions.size(); ++n) {
    size_t slot = hashOf(positions[n]) & (slots - 1);
    while (table[slot] != kFree && positions[table[slot]] != positions[n]) slot = (slot + 1) & (slots - 1);
    if (table[slot] == kFree) table[slot] = n;
    first[n] = table[slot];
  }
  return first;
}

/// The corners of triangles at every vertex.
struct Corners {
  std::vector<uint32_t> begins;   // [vertices + 1]
  std::vector<uint32_t> corners;  // 3 triangle + corner

  Corners(size_t vertices, const std::vector<std::array<uint32_t, 3>>& triangles)
      : begins(vertices + 2), corners(3 * triangles.size()) {
    for (const auto& triangle : triangles)
      for (const uint32_t vertex : triangle) ++begins[vertex + 2];
    for (size_t n = 2; n < begins.size(); ++n) begins[n] += begins[n - 1];
    for (uint32_t n = 0; n < triangles.size(); ++n)
      for (uint32_t corner = 0; corner < 3; ++corner)
        corners[begins[triangles[n][corner] + 1]++] = 3 * n + corner;
  }
};

float angleBetween(const glm::vec3& a, const glm::vec3& b) {
  const float lengths = glm::length(a) * glm::length(b);
  return lengths > 0 ? std::acos(std::clamp(glm::dot(a, b) / lengths, -1.0f, 1.0f)) : 0.0f;
}

/// Gives a normal to every vertex; one whose triangles meet at an edge is doubled.
void computeNormals(TriangleMesh& mesh) {
  const size_t vertices = mesh.positions.size();
  std::vector<glm::vec3> of_triangle;
  of_triangle.reserve(mesh.triangles.size());
  for (const auto& [a, b, c] : mesh.triangles) {
    const glm::dvec3 n = glm::cross(glm::dvec3(mesh.positions[b]) - glm::dvec3(mesh.positions[a]),
                                    glm::dvec3(mesh.positions[c]) - glm::dvec3(mesh.positions[a]));
    const glm::dvec3 ab(mesh.positions[b] - mesh.positions[a]), ac(mesh.positions[c] - mesh.positions[a]);
    const double length = glm::length(n), longest2 = std::max(glm::dot(ab, ab), glm::dot(ac, ac));
    // A sliver's normal is rounding error.
    of_triangle.emplace_back(length > kSliver * longest2 ? n / length : glm::dvec3(0.0));
  }
  mesh.normals.assign(vertices, glm::vec3(0.0f));
  Corners at(vertices, mesh.triangles);
  const auto sharp = static_cast<float>(std::cos(kSharpAngleDegrees * std::numbers::pi / 180));
  struct Group {
    glm::vec3 first, sum;
    uint32_t vertex;
  };
  std::vector<Group> groups;
  for (uint32_t vertex = 0; vertex < vertices; ++vertex) {
    groups.clear();
    for (uint32_t n = at.begins[vertex]; n < at.begins[vertex + 1]; ++n) {
      const uint32_t triangle = at.corners[n] / 3, corner = at.corners[n] % 3;
      auto& corners = mesh.triangles[triangle];
      glm::vec3 normal = of_triangle[triangle];
      if (normal == glm::vec3(0.0f)) continue;
      // Triangles of a file may face either way: |cos| decides, and the sum follows the first.
      auto group = std::find_if(groups.begin(), groups.end(),
                                [&](const Group& g) { return std::abs(glm::dot(g.first, normal)) >= sharp; });
      if (group == groups.end()) {
        const auto added = groups.empty() ? vertex : static_cast<uint32_t>(mesh.positions.size());
        if (!groups.empty()) {
          mesh.positions.push_back(mesh.positions[vertex]);
          for (auto* const scalars : {&mesh.scalars, &mesh.opacity_scalars})
            if (!scalars->empty()) scalars->push_back((*scalars)[vertex]);
        }
        groups.push_back({normal, glm::vec3(0.0f), added});
        group = groups.end() - 1;
      }
      if (glm::dot(group->first, normal) < 0) normal = -normal;
      const glm::vec3 here = mesh.positions[vertex];
      const uint32_t next = corners[(corner + 1) % 3], last = corners[(corner + 2) % 3];
      group->sum += angleBetween(mesh.positions[next] - here, mesh.positions[last] - here) * normal;
      corners[corner] = group->vertex;
    }
    mesh.normals.resize(mesh.positions.size(), glm::vec3(0.0f));
    for (const Group& group : groups) {
      const float length = glm::length(group.sum);
      if (length > 0) mesh.normals[group.vertex] = group.sum / length;
    }
  }
}

}  // namespace

uint64_t TriangleMesh::bytes() const {
  return positions.size() * sizeof(positions[0]) + triangles.size() * sizeof(triangles[0]) +
         normals.size() * sizeof(normals[0]) + (scalars.size() + opacity_scalars.size()) * sizeof(float);
}

TriangleMesh meshOf(RawMesh raw) {
  TriangleMesh mesh;
  if (raw.positions.empty()) return mesh;
  glm::dvec3 lower = raw.positions.front(), upper = lower;
  for (const glm::dvec3& p : raw.positions)
    for (int axis = 0; axis < 3; ++axis) {
      lower[axis] = std::min(lower[axis], p[axis]);
      upper[axis] = std::max(upper[axis], p[axis]);
    }
  mesh.origin = 0.5 * lower + 0.5 * upper;

  const std::vector<uint32_t> first = firstEqual(raw.positions);
  std::vector<uint32_t> number(raw.positions.size());
  for (uint32_t n = 0; n < first.size(); ++n) {
    if (first[n] != n) {
      number[n] = number[first[n]];
      continue;
    }
    number[n] = static_cast<uint32_t>(mesh.positions.size());
    mesh.positions.emplace_back(raw.positions[n] - mesh.origin);
    if (!raw.scalars.empty()) mesh.scalars.push_back(raw.scalars[n]);
    if (!raw.opacity_scalars.empty()) mesh.opacity_scalars.push_back(raw.opacity_scalars[n]);
  }
  raw.positions = {};
  mesh.triangles.reserve(raw.triangles.size());
  for (const auto& corners : raw.triangles) {
    const std::array<uint32_t, 3> merged{number[corners[0]], number[corners[1]], number[corners[2]]};
    if (merged[0] != merged[1] && merged[1] != merged[2] && merged[2] != merged[0])
      mesh.triangles.push_back(merged);
  }
  computeNormals(mesh);
  return mesh;
}

}  // namespace curvisplat
