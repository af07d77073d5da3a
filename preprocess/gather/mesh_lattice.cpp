#include "preprocess/gather/mesh_lattice.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <span>
#include <utility>
#include <vector>

namespace curvisplat {
namespace {

constexpr size_t kBins = 4096;        // of the points along an axis
constexpr double kUniformPart = 0.5;  // of the lines; the others go where the points are

/// Positions and node-centred values of all points.
struct Points {
  std::array<std::vector<double>, 3> at;    // NaN: blanked
  std::vector<std::vector<float>> scalars;  // [scalar][point]; empty where cells have them
};

uint64_t pointBytes(const MeshReader& mesh) {
  const uint64_t values = mesh.centring() == Centring::kNode ? mesh.scalars() : 0;
  return mesh.points() * (3 * sizeof(double) + values * sizeof(float));
}

Points pointsOf(const MeshReader& mesh, Progress& progress) {
  Points points;
  for (std::vector<double>& axis : points.at) axis.reserve(mesh.points());
  points.scalars.resize(mesh.centring() == Centring::kNode ? mesh.scalars() : 0);
  for (std::vector<float>& values : points.scalars) values.reserve(mesh.points());
  mesh.forEachPoints([&](const LoadedPoints& loaded) {
    const MeshPoints& some = loaded.points;
    points.at[0].insert(points.at[0].end(), some.x.begin(), some.x.end());
    points.at[1].insert(points.at[1].end(), some.y.begin(), some.y.end());
    points.at[2].insert(points.at[2].end(), some.z.begin(), some.z.end());
    for (size_t n = 0; n < points.scalars.size(); ++n)
      points.scalars[n].insert(points.scalars[n].end(), some.scalars[n].begin(), some.scalars[n].end());
    progress.advance(some.x.size());
  });
  return points;
}

/// Coordinates of `count` lines along an axis. Between two of them lies an equal share of what is half of the points and half of
/// the length. Empty if the points have no extent.
std::vector<double> linesOf(const Points& points, size_t axis, size_t count) {
  const std::vector<double>& all = points.at[axis];
  double lower = std::numeric_limits<double>::infinity(), upper = -lower;
  for (size_t n = 0; n < all.size(); ++n) {
    if (std::isnan(points.at[0][n])) continue;
    lower = std::min(lower, all[n]);
    upper = std::max(upper, all[n]);
  }
  const double bin = (upper - lower) / kBins;
  if (!(bin > 0) || !std::isfinite(bin)) return {};
  std::vector<double> share(kBins, 0.0);
  double total = 0;
  for (size_t n = 0; n < all.size(); ++n) {
    if (std::isnan(points.at[0][n])) continue;
    ++share[std::min(kBins - 1, static_cast<size_t>((all[n] - lower) / bin))];
    ++total;
  }
  for (double& one : share) one = (1 - kUniformPart) * one / total + kUniformPart / kBins;
  std::vector<double> lines{lower};
  double below = 0;  // shares of the bins before
  for (size_t n = 0; n < kBins; below += share[n++])
    while (lines.size() + 1 < count) {
      const double wanted = static_cast<double>(lines.size()) / static_cast<double>(count - 1);
      if (wanted > below + share[n]) break;
      lines.push_back(lower + bin * (static_cast<double>(n) + (wanted - below) / share[n]));
    }
  lines.push_back(upper);
  return lines;
}

using Lines = std::array<std::vector<double>, 3>;

class Lattice final : public GridSource {
 public:
  Lattice(const MeshReader& mesh, Lines lines)
      : lines_(std::move(lines)), description_(mesh.source().description()) {
    description_.pieces.clear();
    description_.boundaries.clear();
    description_.flow.clear();
    description_.blocks = {{"block 1", lines_[0].size(), lines_[1].size(), lines_[2].size(), true}};
    std::vector<GridScalar> chosen;
    for (const uint32_t scalar : mesh.scalarIndices()) chosen.push_back(description_.scalars[scalar]);
    for (GridScalar& scalar : chosen) scalar.centring = Centring::kNode;
    description_.scalars = std::move(chosen);
    values_.resize(mesh.scalars(), std::vector<double>(nodes(), 0.0));
    weights_.resize(nodes(), 0.0);
  }

  const GridDescription& description() const override { return description_; }

  void read(uint32_t /*block*/, const NodeBox& box, std::span<const uint32_t> scalars,
            NodeArrays& out) const override {
    for (auto* values : {&out.x, &out.y, &out.z}) values->clear();
    out.blank.clear();
    out.scalars.resize(scalars.size());
    for (std::vector<float>& values : out.scalars) values.clear();
    for (uint64_t k = box.k0; k < box.k1; ++k)
      for (uint64_t j = box.j0; j < box.j1; ++j)
        for (uint64_t i = 0; i < lines_[0].size(); ++i) {
          const uint64_t node = numberOf(i, j, k);
          out.x.push_back(lines_[0][i]);
          out.y.push_back(lines_[1][j]);
          out.z.push_back(lines_[2][k]);
          out.blank.push_back(weights_[node] == 0);
          for (size_t n = 0; n < scalars.size(); ++n)
            out.scalars[n].push_back(
                weights_[node] == 0 ? 0 : static_cast<float>(values_[scalars[n]][node] / weights_[node]));
        }
  }

  /// The nodes in the box of a cell, or the one nearest to its middle; [first, last] along each axis.
  struct Nodes {
    std::array<uint64_t, 3> first{}, last{};
    double weight = 0;
  };
  Nodes nodesIn(const std::array<double, 3>& lower, const std::array<double, 3>& upper) const {
    Nodes found;
    double volume = 1;
    for (size_t axis = 0; axis < 3; ++axis) {
      const std::vector<double>& lines = lines_[axis];
      const auto first = std::lower_bound(lines.begin(), lines.end(), lower[axis]);
      const auto end = std::upper_bound(first, lines.end(), upper[axis]);
      found.first[axis] = static_cast<uint64_t>(first - lines.begin());
      found.last[axis] = static_cast<uint64_t>(end - lines.begin()) - 1;
      if (first == end) found.first[axis] = found.last[axis] = nearest(axis, (lower[axis] + upper[axis]) / 2);
      volume *= std::max((upper[axis] - lower[axis]) / (lines.back() - lines.front()), 1e-12);
    }
    found.weight = 1 / volume;
    return found;
  }
  void add(const Nodes& nodes, std::span<const double> values) {
    for (uint64_t k = nodes.first[2]; k <= nodes.last[2]; ++k)
      for (uint64_t j = nodes.first[1]; j <= nodes.last[1]; ++j)
        for (uint64_t i = nodes.first[0]; i <= nodes.last[0]; ++i) {
          const uint64_t node = numberOf(i, j, k);
          weights_[node] += nodes.weight;
          for (size_t n = 0; n < values.size(); ++n) values_[n][node] += nodes.weight * values[n];
        }
  }

 private:
  uint64_t nodes() const { return lines_[0].size() * lines_[1].size() * lines_[2].size(); }
  uint64_t numberOf(uint64_t i, uint64_t j, uint64_t k) const {
    return i + lines_[0].size() * (j + lines_[1].size() * k);
  }
  uint64_t nearest(size_t axis, double x) const {
    const std::vector<double>& lines = lines_[axis];
    const auto above = std::clamp<size_t>(
        static_cast<size_t>(std::lower_bound(lines.begin(), lines.end(), x) - lines.begin()), 1,
        lines.size() - 1);
    return x - lines[above - 1] < lines[above] - x ? above - 1 : above;
  }

  const Lines lines_;
  GridDescription description_;
  std::vector<std::vector<double>> values_;  // [scalar][node]: sums of weighted values
  std::vector<double> weights_;
};

/// Adds the drawn cells, whose corners are numbered from `first_point` on.
void addCells(const MeshCells& cells, uint64_t first_point, const Points& points, Lattice& lattice) {
  const bool of_points = !points.scalars.empty();
  std::vector<double> values(of_points ? points.scalars.size() : cells.scalars.size());
  for (size_t cell = 0; cell < cells.size(); ++cell) {
    const std::span<const uint64_t> corners = cells.cornersOfCell(cell);
    if (cells.shapes[cell] == CellKind::kNone || corners.empty()) continue;
    constexpr double kInfinity = std::numeric_limits<double>::infinity();
    std::array<double, 3> lower{kInfinity, kInfinity, kInfinity}, upper{-kInfinity, -kInfinity, -kInfinity};
    std::fill(values.begin(), values.end(), 0.0);
    bool blanked = false;
    for (const uint64_t corner : corners) {
      const uint64_t point = first_point + corner;
      blanked |= std::isnan(points.at[0][point]);
      for (size_t axis = 0; axis < 3; ++axis) {
        lower[axis] = std::min(lower[axis], points.at[axis][point]);
        upper[axis] = std::max(upper[axis], points.at[axis][point]);
      }
      if (!of_points) continue;
      for (size_t n = 0; n < values.size(); ++n)
        values[n] += static_cast<double>(points.scalars[n][point]) / static_cast<double>(corners.size());
    }
    if (blanked) continue;
    if (!of_points)
      for (size_t n = 0; n < values.size(); ++n) values[n] = static_cast<double>(cells.scalars[n][cell]);
    lattice.add(lattice.nodesIn(lower, upper), values);
  }
}

}  // namespace

std::unique_ptr<GridSource> latticeOf(const MeshReader& mesh, uint64_t nodes, uint64_t memory_bytes,
                                      Progress& progress) {
  const uint64_t needed = pointBytes(mesh);
  if (needed > memory_bytes) return nullptr;
  mesh.prepare(memory_bytes - needed, progress);
  progress.begin("sampling", mesh.points() + mesh.cells(), "points and cells");
  const Points points = pointsOf(mesh, progress);
  const auto count = std::max<size_t>(2, static_cast<size_t>(std::cbrt(static_cast<double>(nodes)) + 1e-9));
  Lines lines;
  for (size_t axis = 0; axis < 3; ++axis) {
    lines[axis] = linesOf(points, axis, count);
    if (lines[axis].empty()) return nullptr;
  }
  std::vector<uint64_t> first_points{0};  // [piece]
  for (const MeshPiece& piece : mesh.pieces()) first_points.push_back(first_points.back() + piece.points);
  auto lattice = std::make_unique<Lattice>(mesh, std::move(lines));
  mesh.forEachCells([&](const LoadedCells& loaded) {
    addCells(loaded.cells, first_points[loaded.range.piece], points, *lattice);
    progress.advance(loaded.cells.size());
  });
  return lattice;
}

}  // namespace curvisplat
