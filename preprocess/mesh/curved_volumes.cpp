#include "preprocess/mesh/curved_volumes.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <map>
#include <numeric>
#include <tuple>

#include "preprocess/mesh/curved_cells.h"
#include "stream/base/mutex.h"

namespace curvisplat {
namespace {

using Place = std::array<uint8_t, 3>;

constexpr size_t kPoints = 3;  // along a part and an axis
constexpr std::array<double, kPoints> kAt{0.11270166537925831, 0.5, 0.88729833462074169},
    kWeights{5.0 / 18, 8.0 / 18, 5.0 / 18};

/// Lagrange's polynomial of node `n` of 0 ... order at x in [0, order], and its derivative.
std::array<double, 2> lagrange(int n, int order, double x) {
  double value = 1, slope = 0;
  for (int other = 0; other <= order; ++other) {
    if (other == n) continue;
    const double factor = (x - other) / (n - other);
    slope = slope * factor + value / (n - other);
    value *= factor;
  }
  return {value, slope};
}

class HexahedronVolumes final : public CurvedVolumes {
 public:
  explicit HexahedronVolumes(CellCurve curve)
      : order_(curve.order), places_(nodesOf(CellKind::kHexahedron, curve)) {
    for (size_t part = 0; part < order_; ++part)
      for (const double at : kAt)
        for (size_t n = 0; n <= order_; ++n)
          basis_.push_back(
              lagrange(static_cast<int>(n), static_cast<int>(order_), static_cast<double>(part) + at));
  }

  void measure(std::span<const glm::dvec3> nodes, std::span<double> out) const override {
    const size_t along = order_ + 1, points = kPoints * order_;
    std::vector<glm::dvec3> lattice(along * along * along);
    for (size_t n = 0; n < nodes.size(); ++n)
      lattice[(places_[n][2] * along + places_[n][1]) * along + places_[n][0]] = nodes[n];
    // Interpolates along i, then j, then k: [value or slope of each axis so far].
    std::vector<std::array<glm::dvec3, 2>> rows(points * along * along);  // [k][j][point]
    for (size_t row = 0; row < along * along; ++row)
      for (size_t u = 0; u < points; ++u) {
        auto& sum = rows[row * points + u];
        sum = {glm::dvec3(0.0), glm::dvec3(0.0)};
        for (size_t n = 0; n < along; ++n)
          for (size_t d = 0; d < 2; ++d) sum[d] += basis_[u * along + n][d] * lattice[row * along + n];
      }
    std::vector<std::array<glm::dvec3, 3>> planes(points * points *
                                                  along);  // [k][point][point]: value, slopes
    for (size_t k = 0; k < along; ++k)
      for (size_t v = 0; v < points; ++v)
        for (size_t u = 0; u < points; ++u) {
          auto& sum = planes[(k * points + v) * points + u];
          sum = {glm::dvec3(0.0), glm::dvec3(0.0), glm::dvec3(0.0)};
          for (size_t n = 0; n < along; ++n) {
            const auto& row = rows[(k * along + n) * points + u];
            const auto& [value, slope] = basis_[v * along + n];
            sum[0] += value * row[0];
            sum[1] += value * row[1];
            sum[2] += slope * row[0];
          }
        }
    std::fill(out.begin(), out.end(), 0.0);
    for (size_t w = 0; w < points; ++w)
      for (size_t v = 0; v < points; ++v)
        for (size_t u = 0; u < points; ++u) {
          std::array<glm::dvec3, 3> slopes{glm::dvec3(0.0), glm::dvec3(0.0), glm::dvec3(0.0)};
          for (size_t n = 0; n < along; ++n) {
            const auto& plane = planes[(n * points + v) * points + u];
            const auto& [value, slope] = basis_[w * along + n];
            slopes[0] += value * plane[1];
            slopes[1] += value * plane[2];
            slopes[2] += slope * plane[0];
          }
          const double weight = kWeights[u % kPoints] * kWeights[v % kPoints] * kWeights[w % kPoints];
          out[((w / kPoints) * order_ + v / kPoints) * order_ + u / kPoints] +=
              weight * glm::dot(slopes[0], glm::cross(slopes[1], slopes[2]));
        }
    for (double& volume : out) volume = std::abs(volume);
  }

 private:
  const size_t order_;
  const std::vector<Place> places_;
  std::vector<std::array<double, 2>> basis_;  // [point][node]: value, slope
};

/// The slopes of a node's polynomial along i, j and k, in units of the lattice.
glm::dvec3 slopesOf(CellKind shape, CellCurve curve, const Place& node, const glm::dvec3& at) {
  const int order = curve.order;
  if (shape == CellKind::kHexahedron) {
    std::array<std::array<double, 2>, 3> along;
    for (size_t axis = 0; axis < 3; ++axis)
      along[axis] = lagrange(node[axis], order, at[static_cast<int>(axis)]);
    return {along[0][1] * along[1][0] * along[2][0], along[0][0] * along[1][1] * along[2][0],
            along[0][0] * along[1][0] * along[2][1]};
  }
  // A simplex has a product of one polynomial for each barycentric coordinate, zero at the nodes below its
  // own.
  const size_t axes = shape == CellKind::kWedge ? 2 : 3;
  std::array<double, 4> value{1, 1, 1, 1}, slope{};
  double rest = order;
  int rest_node = order;
  for (size_t axis = 0; axis < axes; ++axis) {
    rest -= at[static_cast<int>(axis)];
    rest_node -= node[axis];
  }
  for (size_t n = 0; n <= axes; ++n) {
    const double x = n < axes ? at[static_cast<int>(n)] : rest;
    const int of = n < axes ? node[n] : rest_node;
    for (int below = 0; below < of; ++below) {
      const double factor = (x - below) / (below + 1);
      slope[n] = slope[n] * factor + value[n] / (below + 1);
      value[n] *= factor;
    }
  }
  glm::dvec3 slopes(0.0);
  double all = 1;
  for (size_t n = 0; n <= axes; ++n) all *= value[n];
  for (size_t axis = 0; axis < axes; ++axis) {
    double own = slope[axis], last = slope[axes];
    for (size_t n = 0; n <= axes; ++n) {
      if (n != axis) own *= value[n];
      if (n != axes) last *= value[n];
    }
    slopes[static_cast<int>(axis)] = own - last;
  }
  if (shape != CellKind::kWedge) return slopes;
  const auto along = lagrange(node[2], curve.layers, at.z);
  return {slopes.x * along[0], slopes.y * along[0], all * along[1]};
}

/// The parts' tetrahedra, and the slopes at five points in each.
class TabulatedVolumes final : public CurvedVolumes {
 public:
  TabulatedVolumes(CellKind shape, CellCurve curve)
      : corners_(cornersOf(shape)), nodes_(nodesOf(shape, curve).size()), complete_(curve.complete) {
    CellCurve whole = curve;
    whole.complete = true;
    places_ = nodesOf(shape, whole);
    parts_ = partsOf(shape, curve).size();
    if (!complete_) addCentres(shape);
    addParts(partsOf(shape, curve), shape, whole);
    if (!complete_)
      addParts(partsOf(shape, whole), shape, whole);  // the polyhedron is what the corners leave
  }

  static size_t numbersFor(CellKind shape, CellCurve curve) {
    return partsOf(shape, curve).size() * 15 * 3 * nodesOf(shape, curve).size();
  }

  void measure(std::span<const glm::dvec3> nodes, std::span<double> out) const override {
    std::vector<glm::dvec3> all(nodes.begin(),
                                nodes.begin() + static_cast<ptrdiff_t>(nodes_));  // hexahedra may have more
    all.resize(places_.size());
    for (const Centre& centre : centres_)
      for (const auto& [node, weight] : centre.of) all[centre.node] += weight * nodes[node];
    std::vector<double> volumes(complete_ ? parts_ : 0);
    double whole = 0, cut = 0;
    std::fill(out.begin(), out.end(), 0.0);
    for (size_t n = 0; n < tetrahedra_.size(); ++n) {
      const double volume = volumeOf(n, all);
      if (n < own_tetrahedra_) {
        out[tetrahedra_[n].part] += volume;
        cut += volume;
      } else {
        whole += volume;
      }
    }
    if (!complete_) out[parts_ - 1] = whole - cut;
    for (double& volume : out) volume = std::abs(volume);
  }

 private:
  struct Centre {
    size_t node;
    std::vector<std::pair<size_t, double>> of;
  };
  struct Tetrahedron {
    size_t part;
    double volume;  // in the lattice
  };

  double volumeOf(size_t tetrahedron, std::span<const glm::dvec3> nodes) const {
    constexpr std::array<double, 5> kOfPoint{-4.0 / 5, 9.0 / 20, 9.0 / 20, 9.0 / 20, 9.0 / 20};
    double sum = 0;
    for (size_t point = 0; point < kOfPoint.size(); ++point) {
      const std::span<const glm::dvec3> slopes = std::span(slopes_).subspan(
          (tetrahedron * kOfPoint.size() + point) * places_.size(), places_.size());
      std::array<glm::dvec3, 3> along{glm::dvec3(0.0), glm::dvec3(0.0), glm::dvec3(0.0)};
      for (size_t n = 0; n < nodes.size(); ++n)
        for (int axis = 0; axis < 3; ++axis) along[static_cast<size_t>(axis)] += slopes[n][axis] * nodes[n];
      sum += kOfPoint[point] * glm::dot(along[0], glm::cross(along[1], along[2]));
    }
    return sum * tetrahedra_[tetrahedron].volume;
  }

  /// The nodes that a complete cell has besides, at the middles of its quadrangles and of a hexahedron: the polynomial has
  /// there what the corners and the middles of the edges say.
  void addCentres(CellKind shape) {
    for (size_t node = nodes_; node < places_.size(); ++node) {
      Centre centre{node, {}};
      const Place& at = places_[node];
      const bool body = shape == CellKind::kHexahedron && at == Place{1, 1, 1};
      for (size_t n = 0; n < nodes_; ++n) {
        bool on_face = true;
        for (size_t axis = 0; axis < 3; ++axis) on_face &= at[axis] == 1 || at[axis] == places_[n][axis];
        // The slanted side of a wedge.
        if (shape == CellKind::kWedge && at[0] + at[1] == 2) on_face = places_[n][0] + places_[n][1] == 2;
        if (body || on_face) centre.of.emplace_back(n, n < corners_ ? -0.25 : body ? 0.25 : 0.5);
      }
      centres_.push_back(std::move(centre));
    }
  }

  void addParts(const CellParts& parts, CellKind shape, CellCurve whole) {
    std::vector<uint64_t> numbers(places_.size());
    std::iota(numbers.begin(), numbers.end(), uint64_t{0});
    MeshCells cells;
    for (size_t part = 0; part < parts.size(); ++part) {
      cells.clear();
      parts.append(part, numbers, cells);
      const auto corners = cells.cornersOfCell(0);
      const auto add = [&](std::array<size_t, 4> of) {
        std::array<glm::dvec3, 4> at;
        for (size_t n = 0; n < 4; ++n) {
          const Place& place = places_[corners[of[n]]];
          at[n] = {place[0], place[1], place[2]};
        }
        addTetrahedron(part, at, shape, whole);
      };
      if (cells.shapes[0] == CellKind::kTetrahedron) add({0, 1, 2, 3});
      if (cells.shapes[0] == CellKind::kWedge)
        for (const auto& of : {std::array<size_t, 4>{0, 1, 2, 3}, {1, 2, 3, 4}, {2, 3, 4, 5}}) add(of);
      if (cells.shapes[0] == CellKind::kHexahedron)
        for (const auto& of : {std::array<size_t, 4>{0, 1, 2, 6},
                               {0, 2, 3, 6},
                               {0, 3, 7, 6},
                               {0, 7, 4, 6},
                               {0, 4, 5, 6},
                               {0, 5, 1, 6}})
          add(of);
    }
    if (own_tetrahedra_ == 0) own_tetrahedra_ = tetrahedra_.size();
  }

  void addTetrahedron(size_t part, const std::array<glm::dvec3, 4>& at, CellKind shape, CellCurve whole) {
    tetrahedra_.push_back(
        {part, std::abs(glm::dot(at[1] - at[0], glm::cross(at[2] - at[0], at[3] - at[0]))) / 6});
    const glm::dvec3 middle = (at[0] + at[1] + at[2] + at[3]) / 4.0;
    for (size_t point = 0; point < 5; ++point) {
      // The middle, and where a corner weighs 1/2 and the others 1/6.
      const glm::dvec3 place = point == 0 ? middle : middle + (at[point - 1] - middle) / 3.0;
      for (const Place& node : places_) slopes_.push_back(slopesOf(shape, whole, node, place));
    }
  }

  const size_t corners_, nodes_;
  const bool complete_;
  std::vector<Place> places_;  // of the complete cell
  size_t parts_ = 0, own_tetrahedra_ = 0;
  std::vector<Centre> centres_;
  std::vector<Tetrahedron> tetrahedra_;
  std::vector<glm::dvec3> slopes_;  // [tetrahedron][point][node]
};

}  // namespace

const CurvedVolumes* volumesOf(CellKind shape, CellCurve curve) {
  constexpr size_t kMaxNumbers = size_t{1} << 20;
  static Mutex mutex;
  static std::map<std::tuple<CellKind, uint8_t, uint8_t, bool>, std::unique_ptr<const CurvedVolumes>> known;
  const MutexLock lock(mutex);
  const auto [found, is_new] = known.try_emplace({shape, curve.order, curve.layers, curve.complete});
  if (!is_new || shape == CellKind::kPyramid) return found->second.get();
  if (shape == CellKind::kHexahedron && curve.complete)
    found->second = std::make_unique<const HexahedronVolumes>(curve);
  else if (TabulatedVolumes::numbersFor(shape, curve) <= kMaxNumbers)
    found->second = std::make_unique<const TabulatedVolumes>(shape, curve);
  return found->second.get();
}

}  // namespace curvisplat
