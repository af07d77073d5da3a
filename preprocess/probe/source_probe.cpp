#include "preprocess/probe/source_probe.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <map>
#include <numeric>
#include <tuple>

#include "preprocess/gather/mesh_reader.h"
#include "preprocess/grid/hexahedron.h"
#include "preprocess/grid/node_reader.h"
#include "preprocess/probe/point_in_cell.h"

namespace curvisplat {
namespace {

constexpr uint64_t kTile = 8;  // samples along an axis whose points are answered by one read
constexpr uint64_t kAround = 3;

bool isInRanges(const std::vector<std::vector<float>>& values, size_t sample,
                std::span<const ValueRange> ranges) {
  for (size_t v = 0; v < values.size(); ++v)
    if (!(values[v][sample] >= ranges[v].lower && values[v][sample] <= ranges[v].upper)) return false;
  return true;
}

/// A box of a block's nodes, read.
class NodesOfBox {
 public:
  NodesOfBox(const NodeReader& reader, uint32_t block, const std::array<uint64_t, 3>& begin,
             const std::array<uint64_t, 3>& end, std::span<const ValueRange> ranges)
      : block_(block), begin_(begin), end_(end), cells_(reader.centring() == Centring::kCell) {
    reader.read(block, {begin[1], end[1], begin[2], end[2], begin[0], end[0]}, nodes_);
    for (size_t n = 0; n < nodes_.x.size(); ++n) {
      const bool has_value = isInRanges(nodes_.scalars, n, ranges);
      if (cells_)
        nodes_.blank[n] |= has_value ? 0 : kNoValue;
      else if (!has_value)
        nodes_.blank[n] = 1;
    }
  }

  /// Looks for the point in the cells around a sample, the nearest first.
  std::optional<SourceValues> at(const glm::dvec3& point, const std::array<uint64_t, 3>& sample) const {
    std::optional<SourceValues> found;
    for (uint64_t away = 0; !found && away <= kAround; ++away) {
      std::array<uint64_t, 3> from, to;
      for (size_t axis = 0; axis < 3; ++axis) {
        from[axis] = std::max(sample[axis] - std::min(sample[axis], away), begin_[axis]);
        to[axis] = std::min(sample[axis] + away + 1, end_[axis] - 1);
      }
      for (uint64_t k = from[2]; k < to[2]; ++k)
        for (uint64_t j = from[1]; j < to[1]; ++j)
          for (uint64_t i = from[0]; i < to[0] && !found; ++i) found = inCell(point, {i, j, k});
    }
    return found;
  }

 private:
  std::optional<SourceValues> inCell(const glm::dvec3& point, const std::array<uint64_t, 3>& lowest) const {
    const size_t ni = end_[0] - begin_[0], plane = ni * (end_[1] - begin_[1]);
    const size_t cell =
        (lowest[0] - begin_[0]) + (lowest[1] - begin_[1]) * ni + (lowest[2] - begin_[2]) * plane;
    const uint8_t marks = cornerMarks(nodes_.blank.data(), cell, ni, plane);
    if (cells_ ? (marks & kNoNode) != 0 || nodes_.blank[cell] != 0 : marks != 0) return std::nullopt;
    const auto corners = cornersAt(nodes_.x.data(), nodes_.y.data(), nodes_.z.data(), cell, ni, plane);
    const auto weights = weightsInHexahedron(corners, point);
    if (!weights) return std::nullopt;
    SourceValues found{block_, lowest, {}, {}, {}};
    const auto elementOf = [&](size_t c) { return cell + (c & 1) + (c >> 1 & 1) * ni + (c >> 2) * plane; };
    const auto largest =
        static_cast<size_t>(std::max_element(weights->begin(), weights->end()) - weights->begin());
    if (cells_) {
      found.place = Hexahedron(corners).centre;
    } else {
      for (size_t axis = 0; axis < 3; ++axis) found.at[axis] += largest >> axis & 1;
      found.place = corners[largest];
    }
    for (const std::vector<float>& values : nodes_.scalars) {
      found.sample.push_back(values[cells_ ? cell : elementOf(largest)]);
      double value = cells_ ? double{values[cell]} : 0.0;
      for (size_t c = 0; c < 8 && !cells_; ++c) value += (*weights)[c] * double{values[elementOf(c)]};
      found.values.push_back(value);
    }
    return found;
  }

  uint32_t block_;
  std::array<uint64_t, 3> begin_, end_;
  bool cells_;
  NodeArrays nodes_;
};

/// A point and a sample near it, to be answered with others of the same tile.
struct Question {
  size_t point, number;  // of the sample among the point's
};
using Tile = std::tuple<uint32_t, uint64_t, uint64_t, uint64_t>;  // block, k, j, i

/// The points' order by x, for cells that look for those in their box.
class PointsByX {
 public:
  explicit PointsByX(std::span<const glm::dvec3> points) : points_(points), order_(points.size()) {
    std::iota(order_.begin(), order_.end(), size_t{0});
    std::sort(order_.begin(), order_.end(), [&](size_t a, size_t b) { return points[a].x < points[b].x; });
  }
  template <typename Use>
  void forEachIn(const glm::dvec3& lower, const glm::dvec3& upper, Use use) const {
    auto at = std::lower_bound(order_.begin(), order_.end(), lower.x,
                               [&](size_t p, double x) { return points_[p].x < x; });
    for (; at != order_.end() && points_[*at].x <= upper.x; ++at) {
      const glm::dvec3& point = points_[*at];
      if (point.y >= lower.y && point.y <= upper.y && point.z >= lower.z && point.z <= upper.z) use(*at);
    }
  }

 private:
  std::span<const glm::dvec3> points_;
  std::vector<size_t> order_;
};

}  // namespace

std::vector<std::optional<SourceValues>> probeGrid(const GridSource& source,
                                                   std::span<const uint32_t> scalars,
                                                   std::span<const ValueRange> ranges,
                                                   std::span<const glm::dvec3> points,
                                                   std::span<const std::vector<NearSample>> near) {
  const NodeReader reader(source, {scalars.begin(), scalars.end()}, std::nullopt);
  std::map<Tile, std::vector<Question>> tiles;
  for (size_t p = 0; p < points.size(); ++p)
    for (size_t n = 0; n < near[p].size(); ++n) {
      const auto& at = near[p][n].at;
      tiles[{near[p][n].block, at[2] / kTile, at[1] / kTile, at[0] / kTile}].push_back({p, n});
    }
  std::vector<std::optional<SourceValues>> found(points.size());
  std::vector<size_t> number(points.size());  // of the sample that answered
  for (const auto& [tile, questions] : tiles) {
    const auto& [block, tk, tj, ti] = tile;
    const GridBlock& of = source.description().blocks.at(block);
    std::array<uint64_t, 3> begin{ti * kTile, tj * kTile, tk * kTile}, end;
    const std::array<uint64_t, 3> size{of.ni, of.nj, of.nk};
    for (size_t axis = 0; axis < 3; ++axis) {
      end[axis] = std::min(begin[axis] + kTile + kAround + 1, size[axis]);
      begin[axis] -= std::min(begin[axis], kAround);
    }
    const NodesOfBox nodes(reader, block, begin, end, ranges);
    for (const Question& question : questions) {
      if (found[question.point] && number[question.point] < question.number) continue;
      auto here = nodes.at(points[question.point], near[question.point][question.number].at);
      if (!here) continue;
      found[question.point] = std::move(here);
      number[question.point] = question.number;
    }
  }
  return found;
}

std::vector<std::optional<SourceValues>> probeMesh(const MeshSource& source,
                                                   std::span<const uint32_t> scalars,
                                                   std::span<const ValueRange> ranges,
                                                   std::span<const glm::dvec3> points) {
  const MeshReader reader(source, {scalars.begin(), scalars.end()}, std::nullopt);
  constexpr uint64_t kMemory = uint64_t{1} << 28;
  reader.prepare(kMemory, Progress());
  const bool cells = reader.centring() == Centring::kCell;
  std::vector<glm::dvec3> places;
  places.reserve(reader.points());
  std::vector<std::vector<float>> at_points(scalars.size());
  reader.forEachPoints([&](const LoadedPoints& loaded) {
    const MeshPoints& read = loaded.points;
    for (size_t n = 0; n < read.x.size(); ++n) places.emplace_back(read.x[n], read.y[n], read.z[n]);
    for (size_t v = 0; v < read.scalars.size(); ++v)
      at_points[v].insert(at_points[v].end(), read.scalars[v].begin(), read.scalars[v].end());
  });
  std::vector<uint64_t> first_point{0};
  for (const MeshPiece& piece : reader.pieces()) first_point.push_back(first_point.back() + piece.points);

  const PointsByX by_x(points);
  std::vector<std::optional<SourceValues>> found(points.size());
  std::vector<glm::dvec3> corners;
  reader.forEachCells([&](const LoadedCells& loaded) {
    const MeshCells& chunk = loaded.cells;
    const uint32_t piece = loaded.range.piece;
    for (size_t n = 0; n < chunk.size(); ++n) {
      if (chunk.shapes[n] == CellKind::kNone) continue;
      corners.clear();
      for (const uint64_t point : chunk.cornersOfCell(n))
        corners.push_back(places[first_point[piece] + point]);
      glm::dvec3 lower = corners[0], upper = corners[0], middle(0.0);
      for (const glm::dvec3& corner : corners) {
        lower = glm::min(lower, corner), upper = glm::max(upper, corner);
        middle += corner / static_cast<double>(corners.size());
      }
      by_x.forEachIn(lower, upper, [&](size_t p) {
        if (found[p]) return;
        const auto weights = weightsInCell(chunk.shapes[n], corners, chunk.facesOfCell(n), points[p]);
        if (!weights) return;
        SourceValues values{0, {loaded.range.number + n, 0, 0}, middle, {}, {}};
        if (cells) {
          for (const auto& of_scalar : chunk.scalars) values.sample.push_back(of_scalar[n]);
          values.values.assign(values.sample.begin(), values.sample.end());
        } else {
          const auto of_cell = chunk.cornersOfCell(n);
          const auto nearest =
              static_cast<size_t>(std::max_element(weights->begin(), weights->end()) - weights->begin());
          values.at[0] = first_point[piece] + of_cell[nearest];
          values.place = corners[nearest];
          for (const std::vector<float>& of_scalar : at_points) {
            const float* const of_piece = of_scalar.data() + first_point[piece];
            double value = 0;
            for (size_t c = 0; c < of_cell.size(); ++c) value += (*weights)[c] * double{of_piece[of_cell[c]]};
            values.values.push_back(value);
            values.sample.push_back(of_piece[of_cell[nearest]]);
          }
        }
        for (size_t v = 0; v < scalars.size(); ++v)
          if (!(values.values[v] >= ranges[v].lower && values.values[v] <= ranges[v].upper)) return;
        found[p] = std::move(values);
      });
    }
  });
  return found;
}

}  // namespace curvisplat
