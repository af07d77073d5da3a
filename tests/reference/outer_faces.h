// Finds where rays meet the outer faces of a grid. A face is the bilinear patch of its four corners, as the
// trilinear map of its cell has it, so the outline of a marched picture is exact, and no part of a ray is too
// short to be found.
#pragma once

#include <array>
#include <cstdint>
#include <glm/vec3.hpp>
#include <vector>

namespace curvisplat {

class OuterFaces {
 public:
  using Face = std::array<glm::dvec3, 4>;  // corners, u fastest

  OuterFaces() = default;
  explicit OuterFaces(std::vector<Face> faces);

  /// Appends the distances at which the line meets a face, unordered. A crossing of an edge may be there
  /// twice; a face that contains the line is not met. Pure: any thread. `direction` has length 1.
  void crossings(const glm::dvec3& origin, const glm::dvec3& direction, std::vector<double>& distances) const;

 private:
  // A binary tree of boxes; children follow their parent.
  struct Box {
    glm::dvec3 lower{0.0}, upper{0.0};
    uint32_t skip = 0;            // the box after this one and all below it
    uint32_t begin = 0, end = 0;  // of faces_; empty unless this is a leaf
  };

  void build(uint32_t begin, uint32_t end, double margin);

  std::vector<Face> faces_;
  std::vector<Box> boxes_;
};

}  // namespace curvisplat
