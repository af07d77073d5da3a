#include "preprocess/contour/cell_contour.h"

#include <algorithm>
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
  for (size_t face = 0; face < cell.faces.size(); face += cell.faces[face] + 1) addFace(cell, face);
  addPolygons(cell);
}

/// Returns where the edge from corner a to corner b crosses the value: the same place, whichever cell asks.
CellContour::Crossing CellContour::crossingOf(const ContourCell& cell, uint32_t a, uint32_t b) {
  const bool enters = double{cell.values[b]} >= value_;
  const glm::dvec3 downwards = enters ? cell.at[a] - cell.at[b] : cell.at[b] - cell.at[a];
  if (cell.points[b] < cell.points[a]) std::swap(a, b);
  const double from = double{cell.values[a]} - value_, to = double{cell.values[b]} - value_;
  if (from == 0) return {mesh_->vertexOn({cell.points[a], cell.points[a]}, cell.at[a]), enters, downwards};
  if (to == 0) return {mesh_->vertexOn({cell.points[b], cell.points[b]}, cell.at[b]), enters, downwards};
  // Not glm::mix(): what both ends have in common stays exact.
  const glm::dvec3 at = cell.at[a] + from / (from - to) * (cell.at[b] - cell.at[a]);
  return {mesh_->vertexOn({cell.points[a], cell.points[b]}, at), enters, downwards};
}

/// Adds a line for each run of corners of a face that are not below the value. `face`: where it begins.
void CellContour::addFace(const ContourCell& cell, size_t face) {
  const std::span<const uint32_t> corners = cell.faces.subspan(face + 1, cell.faces[face]);
  crossings_.clear();
  for (size_t n = 0; n < corners.size(); ++n) {
    const uint32_t a = corners[n], b = corners[(n + 1) % corners.size()];
    if ((double{cell.values[a]} >= value_) != (double{cell.values[b]} >= value_))
      crossings_.push_back(crossingOf(cell, a, b));
  }
  for (size_t n = 0; n < crossings_.size(); ++n) {
    if (!crossings_[n].enters) continue;
    const Crossing& leaves = crossings_[(n + 1) % crossings_.size()];
    if (leaves.vertex != crossings_[n].vertex) lines_.push_back({crossings_[n], leaves, face});
  }
}

/// Whether the faces' corners run counter-clockwise as seen from outside, by the sign of the volume that they enclose.
bool CellContour::areFacesOutward(const ContourCell& cell) {
  double volume = 0;
  for (size_t face = 0; face < cell.faces.size(); face += cell.faces[face] + 1) {
    const std::span<const uint32_t> corners = cell.faces.subspan(face + 1, cell.faces[face]);
    const auto at = [&](size_t n) { return cell.at[corners[n % corners.size()]] - cell.at[0]; };
    glm::dvec3 area(0.0), middle(0.0);
    for (size_t n = 0; n < corners.size(); ++n) {
      area += glm::cross(at(n), at(n + 1));
      middle += at(n);
    }
    volume += glm::dot(area, middle) / static_cast<double>(corners.size());
  }
  return volume >= 0;
}

/// Joins lines that meet to polygons, from the end of one to the begin of the next.
void CellContour::addPolygons(const ContourCell& cell) {
  const bool outward = areFacesOutward(cell);
  for (Line& first : lines_) {
    if (first.used) continue;
    first.used = true;
    polygon_ = {{first.from, {first.face, first.face}}, {first.to, {first.face, first.face}}};
    bool is_open = false, is_turned = false;  // faces run in different senses
    while (!is_open && polygon_.back().at.vertex != polygon_.front().at.vertex) {
      is_open = true;
      for (Line& next : lines_) {
        const uint32_t end = polygon_.back().at.vertex;
        if (next.used || (next.from.vertex != end && next.to.vertex != end)) continue;
        next.used = true;
        is_turned = is_turned || next.from.vertex != end;
        polygon_.back().faces[1] = next.face;
        polygon_.push_back({next.from.vertex == end ? next.to : next.from, {next.face, next.face}});
        is_open = false;
        break;
      }
    }
    if (is_open) continue;
    polygon_.front().faces[1] = polygon_.back().faces[0];
    polygon_.pop_back();
    if (is_turned ? !facesDownwards() : !outward) std::reverse(polygon_.begin(), polygon_.end());
    addPolygon();
  }
}

/// Whether the polygon runs counter-clockwise as seen from smaller values, by the edges that it crosses.
bool CellContour::facesDownwards() const {
  const auto at = [&](size_t n) { return mesh_->at(polygon_[n % polygon_.size()].at.vertex); };
  glm::dvec3 normal(0.0), downwards(0.0);
  for (size_t n = 0; n < polygon_.size(); ++n) {
    normal += glm::cross(at(n) - at(0), at(n + 1) - at(0));
    downwards += polygon_[n].at.downwards;
  }
  return glm::dot(normal, downwards) >= 0;
}

/// Cuts the polygon into triangles: at its shortest diagonals first, but along faces last, where the other cell may have the same diagonal.
void CellContour::addPolygon() {
  const auto at = [&](size_t n) { return mesh_->at(polygon_[n % polygon_.size()].at.vertex); };
  const auto haveAFace = [](const Corner& a, const Corner& b) {
    return std::find_first_of(a.faces.begin(), a.faces.end(), b.faces.begin(), b.faces.end()) !=
           a.faces.end();
  };
  while (polygon_.size() > 3) {
    const size_t count = polygon_.size();
    size_t ear = 0;
    std::pair<bool, double> best{true, std::numeric_limits<double>::infinity()};  // along a face; length
    for (size_t n = 0; n < count; ++n) {
      const size_t before = (n + count - 1) % count, after = (n + 1) % count;
      const glm::dvec3 diagonal = at(before) - at(after);
      const std::pair<bool, double> here{haveAFace(polygon_[before], polygon_[after]),
                                         glm::dot(diagonal, diagonal)};
      if (here < best) ear = n, best = here;
    }
    mesh_->addTriangle({polygon_[(ear + count - 1) % count].at.vertex, polygon_[ear].at.vertex,
                        polygon_[(ear + 1) % count].at.vertex});
    polygon_.erase(polygon_.begin() + static_cast<std::ptrdiff_t>(ear));
  }
  if (polygon_.size() == 3)
    mesh_->addTriangle({polygon_[0].at.vertex, polygon_[1].at.vertex, polygon_[2].at.vertex});
}

}  // namespace curvisplat
