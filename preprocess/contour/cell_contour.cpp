#include "preprocess/contour/cell_contour.h"

#include <algorithm>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <limits>
#include <utility>

namespace curvisplat {

void CellContour::add(const ContourCell& cell) {
  const auto isAbove = [&](float value) { return double{value} >= value_; };
  const bool first = isAbove(cell.values[0]);
  if (std::all_of(cell.values.begin(), cell.values.end(),
                  [&](float value) { return isAbove(value) == first; }))
    return;
  lines_.clear();
  for (size_t face = 0; face < cell.faces.size(); face += cell.faces[face] + 1)
    addFace(cell, cell.faces.subspan(face + 1, cell.faces[face]));
  addPolygons();
}

/// Where the edge from corner a to corner b crosses the value: the same place, whichever cell asks.
CellContour::Crossing CellContour::crossingOf(const ContourCell& cell, uint32_t a, uint32_t b) {
  const bool enters = double{cell.values[b]} >= value_;
  const glm::dvec3 downwards = enters ? cell.at[a] - cell.at[b] : cell.at[b] - cell.at[a];
  if (cell.points[b] < cell.points[a]) std::swap(a, b);
  const double from = double{cell.values[a]} - value_, to = double{cell.values[b]} - value_;
  if (from == 0) return {mesh_->vertexOn({cell.points[a], cell.points[a]}, cell.at[a]), enters, downwards};
  if (to == 0) return {mesh_->vertexOn({cell.points[b], cell.points[b]}, cell.at[b]), enters, downwards};
  const glm::dvec3 at = glm::mix(cell.at[a], cell.at[b], from / (from - to));
  return {mesh_->vertexOn({cell.points[a], cell.points[b]}, at), enters, downwards};
}

/// Adds a line for each run of corners that are not below the value.
void CellContour::addFace(const ContourCell& cell, std::span<const uint32_t> corners) {
  crossings_.clear();
  for (size_t n = 0; n < corners.size(); ++n) {
    const uint32_t a = corners[n], b = corners[(n + 1) % corners.size()];
    if ((double{cell.values[a]} >= value_) != (double{cell.values[b]} >= value_))
      crossings_.push_back(crossingOf(cell, a, b));
  }
  for (size_t n = 0; n < crossings_.size(); ++n) {
    if (!crossings_[n].enters) continue;
    const Crossing& leaves = crossings_[(n + 1) % crossings_.size()];
    if (leaves.vertex != crossings_[n].vertex) lines_.push_back({crossings_[n], leaves});
  }
}

/// Joins lines that meet to polygons.
void CellContour::addPolygons() {
  for (Line& first : lines_) {
    if (first.used) continue;
    first.used = true;
    polygon_.assign({first.from, first.to});
    bool is_open = false;
    while (!is_open && polygon_.back().vertex != polygon_.front().vertex) {
      is_open = true;
      for (Line& next : lines_) {
        if (next.used) continue;
        const uint32_t end = polygon_.back().vertex;
        if (next.from.vertex != end && next.to.vertex != end) continue;
        next.used = true;
        polygon_.push_back(next.from.vertex == end ? next.to : next.from);
        is_open = false;
        break;
      }
    }
    if (is_open) continue;
    polygon_.pop_back();
    addPolygon();
  }
}

/// Turns the polygon towards smaller values, and cuts it into triangles, at its shortest diagonals first.
void CellContour::addPolygon() {
  const auto at = [&](size_t n) { return mesh_->at(polygon_[n % polygon_.size()].vertex); };
  glm::dvec3 normal(0.0), downwards(0.0);
  for (size_t n = 0; n < polygon_.size(); ++n) {
    normal += glm::cross(at(n) - at(0), at(n + 1) - at(0));
    downwards += polygon_[n].downwards;
  }
  if (glm::dot(normal, downwards) < 0) std::reverse(polygon_.begin(), polygon_.end());
  while (polygon_.size() > 3) {
    const size_t count = polygon_.size();
    size_t ear = 0;
    double shortest = std::numeric_limits<double>::infinity();
    for (size_t n = 0; n < count; ++n) {
      const glm::dvec3 diagonal = at(n + count - 1) - at(n + 1);
      const double length = glm::dot(diagonal, diagonal);
      if (length < shortest) ear = n, shortest = length;
    }
    mesh_->addTriangle({polygon_[(ear + count - 1) % count].vertex, polygon_[ear].vertex,
                        polygon_[(ear + 1) % count].vertex});
    polygon_.erase(polygon_.begin() + static_cast<std::ptrdiff_t>(ear));
  }
  if (polygon_.size() == 3) mesh_->addTriangle({polygon_[0].vertex, polygon_[1].vertex, polygon_[2].vertex});
}

}  // namespace curvisplat
