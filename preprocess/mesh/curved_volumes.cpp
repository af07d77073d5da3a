#include "preprocess/mesh/curved_volumes.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/vec4.hpp>
#include <map>
#include <numeric>
#include <tuple>
#include <utility>

#include "preprocess/mesh/curved_cells.h"
#include "stream/base/mutex.h"

namespace curvisplat {
namespace {

using NodePlace = std::array<uint8_t, 3>;

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

/// Returns what is interpolated at a node: its place, or in a rational cell that times its weight, and the weight.
template <typename Value>
Value valueAt(std::span<const glm::dvec3> nodes, std::span<const double> weights, size_t n) {
  if constexpr (Value::length() == 3)
    return nodes[n];
  else
    return {nodes[n] * weights[n], weights[n]};
}

/// The determinant of the slopes: [value, slopes along the axes].
double determinant(const std::array<glm::dvec3, 4>& at) {
  return glm::dot(at[1], glm::cross(at[2], at[3]));
}
double determinant(const std::array<glm::dvec4, 4>& at) {
  std::array<glm::dvec3, 4> places{};
  places[0] = glm::dvec3(at[0]) / at[0].w;
  for (size_t n = 1; n < 4; ++n) places[n] = (glm::dvec3(at[n]) - places[0] * at[n].w) / at[0].w;
  return determinant(places);
}

class HexahedronVolumes final : public CurvedVolumes {
 public:
  explicit HexahedronVolumes(CellCurve curve)
      : orders_(ordersOf(curve)), places_(nodesOf(CellKind::kHexahedron, curve)) {
    for (size_t axis = 0; axis < 3; ++axis)
      for (size_t part = 0; part < orders_[axis]; ++part)
        for (const double at : kAt)
          for (int n = 0; n <= orders_[axis]; ++n)
            basis_[axis].push_back(lagrange(n, orders_[axis], static_cast<double>(part) + at));
  }

  void measure(std::span<const glm::dvec3> nodes, std::span<const double> weights,
               std::span<double> out) const override {
    if (weights.empty())
      measureBy<glm::dvec3>(nodes, weights, out);
    else
      measureBy<glm::dvec4>(nodes, weights, out);
  }

 private:
  template <typename Value>
  void measureBy(std::span<const glm::dvec3> nodes, std::span<const double> weights,
                 std::span<double> out) const {
    std::array<size_t, 3> along{}, points{};
    for (size_t axis = 0; axis < 3; ++axis) {
      along[axis] = orders_[axis] + size_t{1};
      points[axis] = kPoints * orders_[axis];
    }
    std::vector<Value> lattice(along[0] * along[1] * along[2]);
    for (size_t n = 0; n < places_.size(); ++n)
      lattice[(places_[n][2] * along[1] + places_[n][1]) * along[0] + places_[n][0]] =
          valueAt<Value>(nodes, weights, n);
    // Interpolates along i, then j, then k: [value or slope of each axis so far].
    std::vector<std::array<Value, 2>> rows(points[0] * along[1] * along[2]);  // [k][j][point]
    for (size_t row = 0; row < along[1] * along[2]; ++row)
      for (size_t u = 0; u < points[0]; ++u) {
        auto& sum = rows[row * points[0] + u];
        sum = {Value(0.0), Value(0.0)};
        for (size_t n = 0; n < along[0]; ++n)
          for (size_t d = 0; d < 2; ++d)
            sum[d] += basis_[0][u * along[0] + n][d] * lattice[row * along[0] + n];
      }
    std::vector<std::array<Value, 3>> planes(points[0] * points[1] *
                                             along[2]);  // [k][point][point]: value, slopes
    for (size_t k = 0; k < along[2]; ++k)
      for (size_t v = 0; v < points[1]; ++v)
        for (size_t u = 0; u < points[0]; ++u) {
          auto& sum = planes[(k * points[1] + v) * points[0] + u];
          sum = {Value(0.0), Value(0.0), Value(0.0)};
          for (size_t n = 0; n < along[1]; ++n) {
            const auto& row = rows[(k * along[1] + n) * points[0] + u];
            const auto& [value, slope] = basis_[1][v * along[1] + n];
            sum[0] += value * row[0];
            sum[1] += value * row[1];
            sum[2] += slope * row[0];
          }
        }
    std::fill(out.begin(), out.end(), 0.0);
    for (size_t w = 0; w < points[2]; ++w)
      for (size_t v = 0; v < points[1]; ++v)
        for (size_t u = 0; u < points[0]; ++u) {
          std::array<Value, 4> at{Value(0.0), Value(0.0), Value(0.0), Value(0.0)};  // value, slopes
          for (size_t n = 0; n < along[2]; ++n) {
            const auto& plane = planes[(n * points[1] + v) * points[0] + u];
            const auto& [value, slope] = basis_[2][w * along[2] + n];
            at[0] += value * plane[0];
            at[1] += value * plane[1];
            at[2] += value * plane[2];
            at[3] += slope * plane[0];
          }
          const double weight = kWeights[u % kPoints] * kWeights[v % kPoints] * kWeights[w % kPoints];
          out[((w / kPoints) * orders_[1] + v / kPoints) * orders_[0] + u / kPoints] +=
              weight * determinant(at);
        }
    for (double& volume : out) volume = std::abs(volume);
  }

  const std::array<uint8_t, 3> orders_;
  const std::vector<NodePlace> places_;
  std::array<std::vector<std::array<double, 2>>, 3> basis_;  // [axis][point][node]: value, slope
};

/// A node's polynomial: its value, and its slopes along i, j and k in units of the lattice.
std::array<double, 4> polynomialOf(CellKind shape, CellCurve curve, const NodePlace& node,
                                   const glm::dvec3& at) {
  const int order = curve.order;
  if (shape == CellKind::kHexahedron) {
    std::array<std::array<double, 2>, 3> along;
    for (size_t axis = 0; axis < 3; ++axis)
      along[axis] = lagrange(node[axis], order, at[static_cast<int>(axis)]);
    return {along[0][0] * along[1][0] * along[2][0], along[0][1] * along[1][0] * along[2][0],
            along[0][0] * along[1][1] * along[2][0], along[0][0] * along[1][0] * along[2][1]};
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
  if (shape != CellKind::kWedge) return {all, slopes.x, slopes.y, slopes.z};
  const auto along = lagrange(node[2], curve.layers, at.z);
  return {all * along[0], slopes.x * along[0], slopes.y * along[0], all * along[1]};
}

/// A point of a rule for tetrahedra: the weights of the corners there, and its share of the volume.
struct RulePoint {
  std::array<double, 4> at{};
  double share = 0;
};

/// The middle, and where a corner weighs 1/2 and the others 1/6: exact for degree 3.
std::vector<RulePoint> fivePoints() {
  std::vector<RulePoint> rule{{{0.25, 0.25, 0.25, 0.25}, -4.0 / 5}};
  for (size_t corner = 0; corner < 4; ++corner) {
    RulePoint point{{1.0 / 6, 1.0 / 6, 1.0 / 6, 1.0 / 6}, 9.0 / 20};
    point.at[corner] = 0.5;
    rule.push_back(point);
  }
  return rule;
}

/// Gauss' points of a cube that is drawn together to a tetrahedron, for what is rational: exact for degree 5.
std::vector<RulePoint> conicalPoints() {
  constexpr std::array<double, 4> kPlaces{0.06943184420297371, 0.33000947820757187, 0.6699905217924281,
                                          0.9305681557970263},
      kShares{0.17392742256872692, 0.32607257743127305, 0.32607257743127305, 0.17392742256872692};
  std::vector<RulePoint> rule;
  for (size_t i = 0; i < 4; ++i)
    for (size_t j = 0; j < 4; ++j)
      for (size_t k = 0; k < 4; ++k) {
        const double u = 1 - kPlaces[i], v = 1 - kPlaces[j];
        const double b = kPlaces[j] * u, c = kPlaces[k] * u * v;
        rule.push_back({{kPlaces[i], b, c, 1 - kPlaces[i] - b - c},
                        6 * u * u * v * kShares[i] * kShares[j] * kShares[k]});
      }
  return rule;
}

/// The parts' tetrahedra, and the polynomials at a rule's points in each.
class TabulatedVolumes final : public CurvedVolumes {
 public:
  TabulatedVolumes(CellKind shape, CellCurve curve, std::vector<RulePoint> rule)
      : rule_(std::move(rule)),
        corners_(cornersOf(shape)),
        nodes_(nodesOf(shape, curve).size()),
        complete_(curve.complete) {
    CellCurve whole = curve;
    whole.complete = true;
    places_ = nodesOf(shape, whole);
    parts_ = partsOf(shape, curve).size();
    if (!complete_) addCentres(shape);
    addParts(partsOf(shape, curve), shape, whole);
    if (!complete_)
      addParts(partsOf(shape, whole), shape, whole);  // the polyhedron is what the corners leave
  }

  static size_t numbersFor(CellKind shape, CellCurve curve, size_t points) {
    return partsOf(shape, curve).size() * 3 * points * 4 * nodesOf(shape, curve).size();
  }

  void measure(std::span<const glm::dvec3> nodes, std::span<const double> weights,
               std::span<double> out) const override {
    if (weights.empty())
      measureBy<glm::dvec3>(nodes, weights, out);
    else
      measureBy<glm::dvec4>(nodes, weights, out);
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

  template <typename Value>
  void measureBy(std::span<const glm::dvec3> nodes, std::span<const double> weights,
                 std::span<double> out) const {
    std::vector<Value> all;  // hexahedra may have more nodes
    for (size_t n = 0; n < nodes_; ++n) all.push_back(valueAt<Value>(nodes, weights, n));
    all.resize(places_.size());
    for (const Centre& centre : centres_)
      for (const auto& [node, weight] : centre.of) all[centre.node] += weight * all[node];
    double whole = 0, cut = 0;
    std::fill(out.begin(), out.end(), 0.0);
    for (size_t n = 0; n < tetrahedra_.size(); ++n) {
      const double volume = volumeOf<Value>(n, std::span<const Value>(all));
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

  template <typename Value>
  double volumeOf(size_t tetrahedron, std::span<const Value> nodes) const {
    double sum = 0;
    for (size_t point = 0; point < rule_.size(); ++point) {
      const auto polynomials =
          std::span(polynomials_)
              .subspan((tetrahedron * rule_.size() + point) * places_.size(), places_.size());
      std::array<Value, 4> at{Value(0.0), Value(0.0), Value(0.0), Value(0.0)};
      for (size_t n = 0; n < nodes.size(); ++n)
        for (size_t d = Value::length() == 3 ? 1 : 0; d < 4; ++d) at[d] += polynomials[n][d] * nodes[n];
      sum += rule_[point].share * determinant(at);
    }
    return sum * tetrahedra_[tetrahedron].volume;
  }

  /// The nodes that a complete cell has besides, at the middles of its quadrangles and of a hexahedron: the polynomial has
  /// there what the corners and the middles of the edges say.
  void addCentres(CellKind shape) {
    for (size_t node = nodes_; node < places_.size(); ++node) {
      Centre centre{node, {}};
      const NodePlace& at = places_[node];
      const bool body = shape == CellKind::kHexahedron && at == NodePlace{1, 1, 1};
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
          const NodePlace& place = places_[corners[of[n]]];
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
    for (const RulePoint& point : rule_) {
      glm::dvec3 place(0.0);
      for (size_t n = 0; n < at.size(); ++n) place += point.at[n] * at[n];
      for (const NodePlace& node : places_) polynomials_.push_back(polynomialOf(shape, whole, node, place));
    }
  }

  const std::vector<RulePoint> rule_;
  const size_t corners_, nodes_;
  const bool complete_;
  std::vector<NodePlace> places_;  // of the complete cell
  size_t parts_ = 0, own_tetrahedra_ = 0;
  std::vector<Centre> centres_;
  std::vector<Tetrahedron> tetrahedra_;
  std::vector<std::array<double, 4>> polynomials_;  // [tetrahedron][point][node]: value, slopes
};

}  // namespace

const CurvedVolumes* volumesOf(CellKind shape, CellCurve curve, bool rational) {
  constexpr size_t kMaxNumbers = size_t{1} << 20;
  static Mutex mutex;
  static std::map<std::tuple<CellKind, CellCurve, bool>, std::unique_ptr<const CurvedVolumes>> known;
  const MutexLock lock(mutex);
  const auto [found, is_new] = known.try_emplace({shape, curve, rational});
  if (!is_new || shape == CellKind::kPyramid) return found->second.get();
  std::vector<RulePoint> rule = rational ? conicalPoints() : fivePoints();
  if (shape == CellKind::kHexahedron && curve.complete)
    found->second = std::make_unique<const HexahedronVolumes>(curve);
  else if (TabulatedVolumes::numbersFor(shape, curve, rule.size()) <= kMaxNumbers)
    found->second = std::make_unique<const TabulatedVolumes>(shape, curve, std::move(rule));
  return found->second.get();
}

}  // namespace curvisplat
