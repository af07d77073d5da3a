#include "tests/reference/grid_field.h"

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>
#include <limits>
#include <span>
#include <utility>

namespace curvisplat {
namespace {

constexpr double kOutside = 1e-9;  // of a cell: how far beyond its faces a point still counts as in it
constexpr uint64_t kCellsOfLeaf = 8;

glm::dvec3 positionOf(const NodeArrays& nodes, size_t n) {
  return {nodes.x[n], nodes.y[n], nodes.z[n]};
}

/// Trilinear weights of the eight corners, u fastest.
std::array<double, 8> weightsAt(const glm::dvec3& t) {
  const double u[2] = {1 - t.x, t.x}, v[2] = {1 - t.y, t.y}, w[2] = {1 - t.z, t.z};
  std::array<double, 8> weights;
  for (int corner = 0; corner < 8; ++corner)
    weights[corner] = u[corner & 1] * v[corner >> 1 & 1] * w[corner >> 2];
  return weights;
}

bool holds(const glm::dvec3& lower, const glm::dvec3& upper, const glm::dvec3& p) {
  return p.x >= lower.x && p.y >= lower.y && p.z >= lower.z && p.x <= upper.x && p.y <= upper.y &&
         p.z <= upper.z;
}

bool inUnitCube(const glm::dvec3& t) {
  for (int axis = 0; axis < 3; ++axis)
    if (!(t[axis] >= -kOutside && t[axis] <= 1 + kOutside)) return false;
  return true;
}

class GridProbe : public FieldProbe {
 public:
  explicit GridProbe(const GridField& field) : field_(field) {}

  std::optional<double> at(const glm::dvec3& world) override {
    if (!(inside_ && follow(world))) inside_ = field_.find(world, at_);
    if (!inside_) return std::nullopt;
    return field_.scalarAt(at_);
  }

  double cellLength(const glm::dvec3& direction) const override {
    const glm::dvec3 change = glm::inverse(at_.jacobian) * direction;
    const double fastest = std::max({std::abs(change.x), std::abs(change.y), std::abs(change.z)});
    return std::isfinite(fastest) && fastest > 0 ? 1 / fastest : 0.0;
  }

 private:
  /// Goes from cell to neighbouring cell.
  bool follow(const glm::dvec3& world) {
    constexpr int kMaxCells = 4;
    GridField::InCell to = at_;
    for (int n = 0; n < kMaxCells; ++n) {
      const auto search = field_.findInCell(world, to);
      if (search == GridField::Search::kFound) {
        at_ = to;
        return true;
      }
      if (search == GridField::Search::kFailed || !field_.stepTowards(to)) return false;
    }
    return false;
  }

  const GridField& field_;
  GridField::InCell at_;
  bool inside_ = false;
};

}  // namespace

GridField::GridField(const GridSource& source, uint32_t scalar) {
  read(source, scalar);
  std::vector<OuterFaces::Face> faces;
  for (uint32_t b = 0; b < blocks_.size(); ++b) {
    const Block& block = blocks_[b];
    if (std::min({block.ni, block.nj, block.nk}) < 2) continue;
    const size_t root = boxes_.size();
    if (!addBoxes(b, {0, 0, 0}, {block.ni - 1, block.nj - 1, block.nk - 1})) continue;
    lower_ = root == 0 ? boxes_[root].lower : glm::min(lower_, boxes_[root].lower);
    upper_ = root == 0 ? boxes_[root].upper : glm::max(upper_, boxes_[root].upper);
    addOuterFaces(b, faces);
  }
  outer_faces_ = OuterFaces(std::move(faces));
}

void GridField::read(const GridSource& source, uint32_t scalar) {
  const auto& blocks = source.description().blocks;
  of_cells_ = source.description().scalars[scalar].centring == Centring::kCell;
  range_ = {std::numeric_limits<double>::infinity(), -std::numeric_limits<double>::infinity()};
  for (uint32_t b = 0; b < blocks.size(); ++b) {
    Block& block = blocks_.emplace_back();
    block.ni = blocks[b].ni;
    block.nj = blocks[b].nj;
    block.nk = blocks[b].nk;
    source.read(b, {0, block.nj, 0, block.nk}, std::span(&scalar, 1), block.nodes);
    for (size_t n = 0; n < block.nodes.x.size(); ++n) {
      const double value = block.nodes.scalars[0][n];
      const glm::dvec3 p = positionOf(block.nodes, n);
      if (!std::isfinite(p.x + p.y + p.z) || (!of_cells_ && !std::isfinite(value))) block.nodes.blank[n] = 1;
      if (block.nodes.blank[n] || !std::isfinite(value)) continue;
      range_.first = std::min(range_.first, value);
      range_.second = std::max(range_.second, value);
    }
  }
}

bool GridField::crossings(const glm::dvec3& origin, const glm::dvec3& direction,
                          std::vector<double>& distances) const {
  outer_faces_.crossings(origin, direction, distances);
  return true;
}

void GridField::addOuterFaces(uint32_t block_number, std::vector<OuterFaces::Face>& faces) const {
  const Block& block = blocks_[block_number];
  const uint64_t cells[3] = {block.ni - 1, block.nj - 1, block.nk - 1};
  for (uint64_t k = 0; k < cells[2]; ++k)
    for (uint64_t j = 0; j < cells[1]; ++j)
      for (uint64_t i = 0; i < cells[0]; ++i) {
        const CellAddress cell{block_number, {i, j, k}};
        if (!isThere(cell)) continue;
        const std::array<size_t, 8> corners = cornersOf(cell);
        for (int axis = 0; axis < 3; ++axis)
          for (const bool upper : {false, true}) {
            CellAddress neighbour = cell;
            neighbour.index[axis] += upper ? 1 : ~uint64_t{0};  // below 0 it wraps
            if (neighbour.index[axis] < cells[axis] && isThere(neighbour)) continue;
            const int u = 1 << (axis + 1) % 3, v = 1 << (axis + 2) % 3, first = upper ? 1 << axis : 0;
            faces.push_back({positionOf(block.nodes, corners[first]),
                             positionOf(block.nodes, corners[first | u]),
                             positionOf(block.nodes, corners[first | v]),
                             positionOf(block.nodes, corners[first | u | v])});
          }
      }
}

std::unique_ptr<FieldProbe> GridField::probe() const {
  return std::make_unique<GridProbe>(*this);
}

std::array<size_t, 8> GridField::cornersOf(const CellAddress& cell) const {
  const Block& block = blocks_[cell.block];
  const size_t first = block.at(cell.index[0], cell.index[1], cell.index[2]);
  const size_t row = block.ni, plane = block.ni * block.nj;
  return {first,         first + 1,         first + row,         first + row + 1,
          first + plane, first + plane + 1, first + plane + row, first + plane + row + 1};
}

bool GridField::isThere(const CellAddress& cell) const {
  const NodeArrays& nodes = blocks_[cell.block].nodes;
  const std::array<size_t, 8> corners = cornersOf(cell);
  if (of_cells_ && !std::isfinite(nodes.scalars[0][corners[0]])) return false;
  return std::none_of(corners.begin(), corners.end(), [&](size_t n) { return nodes.blank[n] != 0; });
}

bool GridField::addBoxes(uint32_t block, const std::array<uint64_t, 3>& begin,
                         const std::array<uint64_t, 3>& end) {
  std::array<uint64_t, 3> size;
  for (int axis = 0; axis < 3; ++axis) size[axis] = end[axis] - begin[axis];
  const size_t self = boxes_.size();
  boxes_.push_back({});
  Box box;
  box.begin = begin;
  box.end = end;
  box.block = block;
  bool any = false;
  const auto include = [&](const glm::dvec3& lower, const glm::dvec3& upper) {
    box.lower = any ? glm::min(box.lower, lower) : lower;
    box.upper = any ? glm::max(box.upper, upper) : upper;
    any = true;
  };

  if (size[0] * size[1] * size[2] <= kCellsOfLeaf) {
    box.leaf = true;
    for (uint64_t k = begin[2]; k < end[2]; ++k)
      for (uint64_t j = begin[1]; j < end[1]; ++j)
        for (uint64_t i = begin[0]; i < end[0]; ++i) {
          const CellAddress cell{block, {i, j, k}};
          if (!isThere(cell)) continue;
          for (const size_t n : cornersOf(cell)) {
            const glm::dvec3 p = positionOf(blocks_[block].nodes, n);
            include(p, p);
          }
        }
  } else {
    const size_t longest = std::max_element(size.begin(), size.end()) - size.begin();
    std::array<uint64_t, 3> middle_end = end, middle_begin = begin;
    middle_end[longest] = middle_begin[longest] = begin[longest] + size[longest] / 2;
    for (const bool upper_half : {false, true}) {
      const size_t child = boxes_.size();
      if (addBoxes(block, upper_half ? middle_begin : begin, upper_half ? end : middle_end))
        include(boxes_[child].lower, boxes_[child].upper);
    }
  }
  if (!any) {
    boxes_.resize(self);
    return false;
  }
  // Points on a face count, and rounding must not take them out.
  const glm::dvec3 margin(1e-12 * glm::length(box.upper - box.lower));
  box.lower -= margin;
  box.upper += margin;
  box.skip = static_cast<uint32_t>(boxes_.size());
  boxes_[self] = box;
  return true;
}

GridField::Search GridField::findInCell(const glm::dvec3& world, InCell& at) const {
  const NodeArrays& nodes = blocks_[at.cell.block].nodes;
  std::array<glm::dvec3, 8> p;
  const std::array<size_t, 8> corners = cornersOf(at.cell);
  for (int corner = 0; corner < 8; ++corner) p[corner] = positionOf(nodes, corners[corner]) - world;

  constexpr int kMaxSteps = 24;
  constexpr double kConverged = 1e-6;  // of a cell; the step squares what is left
  glm::dvec3 t = at.uvw;
  for (int n = 0; n < kMaxSteps; ++n) {
    const glm::dvec3 s = 1.0 - t;
    // Along u, then v, then w.
    const glm::dvec3 a00 = s.x * p[0] + t.x * p[1], a10 = s.x * p[2] + t.x * p[3],
                     a01 = s.x * p[4] + t.x * p[5], a11 = s.x * p[6] + t.x * p[7];
    const glm::dvec3 b0 = s.y * a00 + t.y * a10, b1 = s.y * a01 + t.y * a11;
    const glm::dvec3 off = s.z * b0 + t.z * b1;
    at.jacobian[0] =
        s.z * (s.y * (p[1] - p[0]) + t.y * (p[3] - p[2])) + t.z * (s.y * (p[5] - p[4]) + t.y * (p[7] - p[6]));
    at.jacobian[1] = s.z * (a10 - a00) + t.z * (a11 - a01);
    at.jacobian[2] = b1 - b0;
    const glm::dvec3 across = glm::cross(at.jacobian[1], at.jacobian[2]);
    const double determinant = glm::dot(at.jacobian[0], across);
    if (!(std::abs(determinant) > 0)) {
      // A collapsed edge or face: a little towards the cell's middle the map is regular.
      t += 1e-6 * (glm::dvec3(0.5) - t);
      continue;
    }
    const glm::dvec3 step =
        glm::dvec3(glm::dot(off, across), glm::dot(off, glm::cross(at.jacobian[2], at.jacobian[0])),
                   glm::dot(off, glm::cross(at.jacobian[0], at.jacobian[1]))) /
        determinant;
    const double length = std::max({std::abs(step.x), std::abs(step.y), std::abs(step.z)});
    t -= length > 1 ? step / length : step;
    if (std::max({std::abs(t.x), std::abs(t.y), std::abs(t.z)}) > 8) break;  // nowhere near
    if (length < kConverged) {
      at.uvw = t;
      return inUnitCube(t) ? Search::kFound : Search::kOutside;
    }
  }
  at.uvw = t;
  const bool far = std::max({std::abs(t.x), std::abs(t.y), std::abs(t.z)}) > 2;
  return far ? Search::kOutside : Search::kFailed;
}

bool GridField::findFrom(const glm::dvec3& world, InCell& at) const {
  // A bent cell's map may have several solutions, or lead Newton's method astray: other starts find it.
  static constexpr double kStarts[5][3] = {
      {0.5, 0.5, 0.5}, {0.1, 0.1, 0.1}, {0.9, 0.9, 0.1}, {0.9, 0.1, 0.9}, {0.1, 0.9, 0.9}};
  for (const auto& start : kStarts) {
    at.uvw = {start[0], start[1], start[2]};
    const Search search = findInCell(world, at);
    if (search == Search::kFound) return true;
    // From the middle to a place outside: the point is in another cell, unless this one is badly bent.
    if (search == Search::kOutside && !inUnitCube(glm::mix(glm::dvec3(0.5), at.uvw, 0.8))) return false;
  }
  return false;
}

bool GridField::find(const glm::dvec3& world, InCell& at) const {
  for (size_t n = 0; n < boxes_.size();) {
    const Box& box = boxes_[n];
    if (!holds(box.lower, box.upper, world)) {
      n = box.skip;
      continue;
    }
    ++n;
    if (!box.leaf) continue;
    for (uint64_t k = box.begin[2]; k < box.end[2]; ++k)
      for (uint64_t j = box.begin[1]; j < box.end[1]; ++j)
        for (uint64_t i = box.begin[0]; i < box.end[0]; ++i) {
          at.cell = {box.block, {i, j, k}};
          if (isThere(at.cell) && findFrom(world, at)) return true;
        }
  }
  return false;
}

bool GridField::stepTowards(InCell& at) const {
  int farthest = -1;
  double distance = 0;
  for (int axis = 0; axis < 3; ++axis) {
    const double out = std::max(-at.uvw[axis], at.uvw[axis] - 1);
    if (out > distance) {
      distance = out;
      farthest = axis;
    }
  }
  if (farthest < 0) return false;
  const Block& block = blocks_[at.cell.block];
  const uint64_t nodes[3] = {block.ni, block.nj, block.nk};
  const bool up = at.uvw[farthest] > 1;
  uint64_t& index = at.cell.index[farthest];
  if (up ? index + 2 >= nodes[farthest] : index == 0) return false;
  index = up ? index + 1 : index - 1;
  if (!isThere(at.cell)) return false;
  at.uvw[farthest] += up ? -1 : 1;
  at.uvw = glm::clamp(at.uvw, 0.0, 1.0);
  return true;
}

double GridField::scalarAt(const InCell& at) const {
  const auto& values = blocks_[at.cell.block].nodes.scalars[0];
  const std::array<size_t, 8> corners = cornersOf(at.cell);
  if (of_cells_) return values[corners[0]];
  const auto weights = weightsAt(at.uvw);
  double sum = 0;
  for (int corner = 0; corner < 8; ++corner) sum += weights[corner] * values[corners[corner]];
  return sum;
}

}  // namespace curvisplat
