#include "preprocess/mesh/cell_nodes.h"

#include <algorithm>

#include "preprocess/mesh/bezier_cells.h"

namespace curvisplat {

CellNodes::CellNodes(const MeshSource& source, uint32_t piece, const MeshCells& cells,
                     std::span<const uint32_t> scalars, std::optional<uint32_t> rational)
    : scalars_(scalars.size()), is_rational_(rational.has_value()) {
  std::vector<uint32_t> all(scalars.begin(), scalars.end());
  if (rational) all.push_back(*rational);
  for (const auto& [cell, curve] : cells.curved) {
    const std::span<const uint64_t> nodes = cells.cornersOfCell(cell);
    if (curve.order > 0) numbers_.insert(numbers_.end(), nodes.begin(), nodes.end());
  }
  std::sort(numbers_.begin(), numbers_.end());
  numbers_.erase(std::unique(numbers_.begin(), numbers_.end()), numbers_.end());
  MeshPoints points;
  for (size_t from = 0; from < numbers_.size();) {
    size_t to = from + 1;
    while (to < numbers_.size() && numbers_[to] - numbers_[to - 1] < kMaxGap &&
           numbers_[to] - numbers_[from] < kMaxRun)
      ++to;
    const uint64_t first = numbers_[from];
    source.readPoints(piece, first, numbers_[to - 1] - first + 1, all, points);
    for (; from < to; ++from) {
      const size_t n = numbers_[from] - first;
      places_.emplace_back(points.x[n], points.y[n], points.z[n]);
      hidden_.push_back(points.hidden[n]);
      for (const std::vector<float>& of_scalar : points.scalars) values_.push_back(of_scalar[n]);
    }
  }
}

NodesOfCell CellNodes::asStored(std::span<const uint64_t> nodes) const {
  NodesOfCell out;
  const size_t stride = scalars_ + (is_rational_ ? 1 : 0);
  for (const uint64_t node : nodes) {
    const auto n =
        static_cast<size_t>(std::lower_bound(numbers_.begin(), numbers_.end(), node) - numbers_.begin());
    out.places.push_back(places_[n]);
    out.hidden |= hidden_[n] != 0;
    for (size_t scalar = 0; scalar < scalars_; ++scalar) out.values.push_back(values_[n * stride + scalar]);
    if (is_rational_) out.weights.push_back(values_[n * stride + scalars_]);
  }
  return out;
}

NodesOfCell CellNodes::of(CellKind shape, CellCurve curve, std::span<const uint64_t> nodes) const {
  NodesOfCell out = asStored(nodes);
  if (!curve.bezier) {
    out.weights.clear();
    return out;
  }
  const size_t components = 4 + scalars_;
  std::vector<double> values;
  for (size_t n = 0; n < nodes.size(); ++n) {
    const double weight = is_rational_ ? out.weights[n] : 1;
    for (int axis = 0; axis < 3; ++axis) values.push_back(weight * out.places[n][axis]);
    values.push_back(weight);
    for (size_t scalar = 0; scalar < scalars_; ++scalar)
      values.push_back(weight * out.values[n * scalars_ + scalar]);
  }
  bezierOf(shape, curve).evaluate(values, components);
  for (size_t n = 0; n < nodes.size(); ++n) {
    const auto of_node = std::span(values).subspan(n * components, components);
    const double weight = of_node[3];
    out.places[n] = glm::dvec3(of_node[0], of_node[1], of_node[2]) / weight;
    if (is_rational_) out.weights[n] = weight;
    for (size_t scalar = 0; scalar < scalars_; ++scalar)
      out.values[n * scalars_ + scalar] = of_node[4 + scalar] / weight;
  }
  return out;
}

}  // namespace curvisplat
