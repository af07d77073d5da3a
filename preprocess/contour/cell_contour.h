// The isosurface within a cell of any shape: on each face, lines that cut off the corners at or above the value; around the cell, polygons
// of such lines, cut into triangles.
#pragma once

#include <array>
#include <cstdint>
#include <glm/vec3.hpp>
#include <span>
#include <vector>

#include "preprocess/contour/contour_mesh.h"

namespace curvisplat {

/// A cell and the values at its corners.
struct ContourCell {
  std::span<const uint64_t> points;  // [corner] the number of its point
  std::span<const glm::dvec3> at;    // [corner]
  std::span<const float> values;     // [corner]
  std::span<const uint32_t> faces;   // facesOf()
};

class CellContour {
 public:
  CellContour(double value, ContourMesh& mesh) : value_(value), mesh_(&mesh) {}

  /// Adds the triangles of a cell; none if its corners are all on one side. Faces whose lines do not meet, as those of a damaged
  /// polyhedron, have none.
  void add(const ContourCell& cell);

 private:
  struct Crossing {
    uint32_t vertex;
    bool enters;           // what lies above the value
    glm::dvec3 downwards;  // along the edge
  };
  struct Line {
    Crossing from, to;
    size_t face = 0;
    bool used = false;
  };
  struct Corner {
    Crossing at;
    std::array<size_t, 2> faces{};  // of the lines that meet there
  };

  Crossing crossingOf(const ContourCell& cell, uint32_t a, uint32_t b);
  void addFace(const ContourCell& cell, size_t face);
  static bool areFacesOutward(const ContourCell& cell);
  void addPolygons(const ContourCell& cell);
  bool facesDownwards() const;
  void addPolygon();

  const double value_;
  ContourMesh* mesh_;
  // Scratch memory.
  std::vector<Crossing> crossings_;  // of a face
  std::vector<Line> lines_;          // of the cell
  std::vector<Corner> polygon_;
};

}  // namespace curvisplat
