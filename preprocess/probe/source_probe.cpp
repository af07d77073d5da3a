#include "preprocess/probe/source_probe.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <map>
#include <numeric>
#include <tuple>

#include "preprocess/gather/corner_gather.h"
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

/// `values`: [sample * ranges.size() + scalar], of a cell's corners or of the cell.
bool areInRanges(std::span<const float> values, std::span<const ValueRange> ranges) {
  for (size_t n = 0; n < values.size(); ++n) {
    const ValueRange& range = ranges[n % ranges.size()];
    if (!(values[n] >= range.lower && values[n] <= range.upper)) return false;
  }
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

  /// Calls use(lowest node, corners) for all cells of the box.
  template <typename Use>
  void forEachCell(Use use) const {
    const size_t ni = end_[0] - begin_[0], plane = ni * (end_[1] - begin_[1]);
    size_t row = 0;
    for (uint64_t k = begin_[2]; k + 1 < end_[2]; ++k, row += ni)
      for (uint64_t j = begin_[1]; j + 1 < end_[1]; ++j, row += ni)
        for (uint64_t i = begin_[0]; i + 1 < end_[0]; ++i) {
          const auto corners =
              cornersAt(nodes_.x.data(), nodes_.y.data(), nodes_.z.data(), row + i - begin_[0], ni, plane);
          use(std::array<uint64_t, 3>{i, j, k}, std::span<const glm::dvec3>(corners));
        }
  }

  /// The values at the point in the cell with this lowest node, if it is there.
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

 private:
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

/// The box around corners, and their mean.
struct CellBox {
  glm::dvec3 lower, upper, middle{0.0};

  explicit CellBox(std::span<const glm::dvec3> corners) : lower(corners[0]), upper(corners[0]) {
    for (const glm::dvec3& corner : corners) {
      lower = glm::min(lower, corner), upper = glm::max(upper, corner);
      middle += corner / static_cast<double>(corners.size());
    }
  }
};

/// Looks for points in the outermost cells of the blocks: a node that coincides with another one is in the cache once, and the cell with
/// the point may be at the other.
class BorderCells {
 public:
  BorderCells(const NodeReader& reader, std::span<const ValueRange> ranges,
              std::span<const glm::dvec3> points)
      : reader_(reader), ranges_(ranges), points_(points), by_x_(points) {}

  /// [point]
  std::vector<std::optional<SourceValues>> find() {
    found_.resize(points_.size());
    const std::vector<GridBlock>& blocks = reader_.source().description().blocks;
    for (uint32_t block = 0; block < blocks.size(); ++block) {
      const std::array<uint64_t, 3> size{blocks[block].ni, blocks[block].nj, blocks[block].nk};
      if (std::ranges::min(size) < 2) continue;
      for (size_t axis = 0; axis < 3; ++axis)
        for (const uint64_t first : {uint64_t{0}, size[axis] - 2}) {
          std::array<uint64_t, 3> begin{}, end = size;
          begin[axis] = first;
          end[axis] = first + 2;
          findInLayer(block, begin, end);
        }
    }
    return std::move(found_);
  }

 private:
  /// A layer of cells between nodes, some rows at a time.
  void findInLayer(uint32_t block, std::array<uint64_t, 3> begin, std::array<uint64_t, 3> end) {
    constexpr uint64_t kNodes = uint64_t{1} << 18;  // that are read at a time, if a row has fewer
    const uint64_t row = end[0] - begin[0], j_end = end[1], k_end = end[2];
    const uint64_t planes = std::clamp(kNodes / (row * (end[1] - begin[1])), uint64_t{2}, end[2] - begin[2]);
    const uint64_t rows = std::clamp(kNodes / (row * planes), uint64_t{2}, end[1] - begin[1]);
    for (uint64_t k = begin[2]; k + 1 < k_end; k += planes - 1)
      for (uint64_t j = begin[1]; j + 1 < j_end; j += rows - 1) {
        const NodesOfBox nodes(reader_, block, {begin[0], j, k},
                               {end[0], std::min(j + rows, j_end), std::min(k + planes, k_end)}, ranges_);
        nodes.forEachCell([&](const std::array<uint64_t, 3>& lowest, std::span<const glm::dvec3> corners) {
          const CellBox box(corners);
          by_x_.forEachIn(box.lower, box.upper, [&](size_t p) {
            if (!found_[p]) found_[p] = nodes.inCell(points_[p], lowest);
          });
        });
      }
  }

  const NodeReader& reader_;
  const std::span<const ValueRange> ranges_;
  const std::span<const glm::dvec3> points_;
  const PointsByX by_x_;
  std::vector<std::optional<SourceValues>> found_;
};

bool isOnFace(const NearSample& sample, const std::vector<GridBlock>& blocks) {
  const GridBlock& block = blocks.at(sample.block);
  const std::array<uint64_t, 3> size{block.ni, block.nj, block.nk};
  for (size_t axis = 0; axis < 3; ++axis)
    if (sample.at[axis] == 0 || sample.at[axis] + 1 >= size[axis]) return true;
  return false;
}

/// Answers the points that have a sample on a face of a block near them, and no cell.
void findAcrossSeams(const NodeReader& reader, std::span<const ValueRange> ranges,
                     std::span<const glm::dvec3> points, std::span<const std::vector<NearSample>> near,
                     std::vector<std::optional<SourceValues>>& found) {
  const std::vector<GridBlock>& blocks = reader.source().description().blocks;
  std::vector<size_t> numbers;
  std::vector<glm::dvec3> left;
  for (size_t p = 0; p < points.size(); ++p) {
    const auto isFace = [&](const NearSample& sample) { return isOnFace(sample, blocks); };
    if (found[p] || std::none_of(near[p].begin(), near[p].end(), isFace)) continue;
    numbers.push_back(p);
    left.push_back(points[p]);
  }
  if (left.empty()) return;
  auto answers = BorderCells(reader, ranges, left).find();
  for (size_t n = 0; n < left.size(); ++n) found[numbers[n]] = std::move(answers[n]);
}

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
  findAcrossSeams(reader, ranges, points, near, found);
  return found;
}

std::vector<std::optional<SourceValues>> probeMesh(const MeshSource& source,
                                                   std::span<const uint32_t> scalars,
                                                   std::span<const ValueRange> ranges,
                                                   std::span<const glm::dvec3> points,
                                                   const ScratchFiles& scratch) {
  const MeshReader reader(source, {scalars.begin(), scalars.end()}, std::nullopt);
  constexpr uint64_t kMemory = uint64_t{1} << 28;
  Progress progress;
  reader.prepare(kMemory, progress);
  const PointNumbers numbers(reader, kMemory, scratch, progress);
  CornerGather gather(reader, numbers, halfBesideChunks(kMemory, reader.largestChunk()), scratch, progress);
  const bool cells = reader.centring() == Centring::kCell;
  const PointsByX by_x(points);
  std::vector<std::optional<SourceValues>> found(points.size());
  gather.forEach([&](const GatheredCells& some) {
    for (size_t n = 0; n < some.size(); ++n) {
      if (some.shapes[n] == CellKind::kNone) continue;
      const CellView cell = some.view(n, cells ? 0 : scalars.size());
      const CellBox box(cell.corners);
      by_x.forEachIn(box.lower, box.upper, [&](size_t p) {
        if (found[p]) return;
        const auto weights = weightsInCell(cell.shape, cell.corners, cell.faces, points[p]);
        if (!weights) return;
        // Interpolated values are not compared: rounding takes those of a constant beyond its one value.
        const std::span<const float> of_cell(some.cell_values.data() + (cells ? n * scalars.size() : 0),
                                             cells ? scalars.size() : 0);
        if (!areInRanges(cells ? of_cell : cell.values, ranges)) return;
        SourceValues values{0, {some.numbers[n], 0, 0}, box.middle, {}, {}};
        if (cells) {
          values.sample.assign(of_cell.begin(), of_cell.end());
          values.values.assign(values.sample.begin(), values.sample.end());
        } else {
          const auto nearest =
              static_cast<size_t>(std::max_element(weights->begin(), weights->end()) - weights->begin());
          values.at[0] = some.cornersOfCell(n)[nearest];
          values.place = cell.corners[nearest];
          for (size_t v = 0; v < scalars.size(); ++v) {
            double value = 0;
            for (size_t c = 0; c < cell.corners.size(); ++c)
              value += (*weights)[c] * double{cell.values[c * scalars.size() + v]};
            values.values.push_back(value);
            values.sample.push_back(cell.values[nearest * scalars.size() + v]);
          }
        }
        found[p] = std::move(values);
      });
    }
  });
  return found;
}

}  // namespace curvisplat
