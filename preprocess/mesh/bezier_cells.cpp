#include "preprocess/mesh/bezier_cells.h"

#include <array>
#include <cmath>
#include <initializer_list>
#include <map>
#include <memory>
#include <utility>

#include "preprocess/mesh/curved_cells.h"
#include "stream/base/mutex.h"

namespace curvisplat {
namespace {

using LatticePlace = std::array<uint8_t, 3>;

double factorial(int n) {
  return n < 2 ? 1 : n * factorial(n - 1);
}

/// Bernstein's polynomial of a control point at a node, over a simplex of these axes.
double bernstein(const std::vector<size_t>& axes, int order, const LatticePlace& control,
                 const LatticePlace& node) {
  int rest = order, rest_of_node = order;
  double value = factorial(order);
  const auto multiply = [&](int power, int part) {
    value *= std::pow(static_cast<double>(part) / order, power) / factorial(power);
  };
  for (const size_t axis : axes) {
    rest -= control[axis];
    rest_of_node -= node[axis];
    multiply(control[axis], node[axis]);
  }
  multiply(rest, rest_of_node);
  return value;
}

}  // namespace

BezierCell::BezierCell(CellKind shape, CellCurve curve) {
  const std::vector<LatticePlace> places = nodesOf(shape, curve);
  const std::array<uint8_t, 3> orders = ordersOf(curve);
  nodes_ = places.size();
  const auto addPass = [&](const std::vector<size_t>& axes) {
    Pass& pass = passes_.emplace_back();
    for (const LatticePlace& node : places) {
      for (size_t n = 0; n < places.size(); ++n) {
        LatticePlace elsewhere = places[n];
        for (const size_t axis : axes) elsewhere[axis] = node[axis];
        if (elsewhere != node) continue;
        if (const double weight = bernstein(axes, orders[axes[0]], places[n], node); weight != 0)
          pass.shares.push_back({static_cast<uint16_t>(n), weight});
      }
      pass.begin.push_back(pass.shares.size());
    }
  };
  if (shape == CellKind::kHexahedron) {
    for (size_t axis = 0; axis < 3; ++axis) addPass({axis});
  } else if (shape == CellKind::kWedge) {
    addPass({0, 1});
    addPass({2});
  } else {
    addPass({0, 1, 2});
  }
}

void BezierCell::evaluate(std::vector<double>& values, size_t components) const {
  std::vector<double> sums;
  for (const Pass& pass : passes_) {
    sums.assign(nodes_ * components, 0);
    for (size_t node = 0; node < nodes_; ++node)
      for (size_t n = pass.begin[node]; n < pass.begin[node + 1]; ++n)
        for (size_t c = 0; c < components; ++c)
          sums[node * components + c] +=
              pass.shares[n].weight * values[pass.shares[n].control * components + c];
    values.swap(sums);
  }
}

const BezierCell& bezierOf(CellKind shape, CellCurve curve) {
  static Mutex mutex;
  static std::map<std::pair<CellKind, CellCurve>, std::unique_ptr<const BezierCell>> known;
  const MutexLock lock(mutex);
  auto& cell = known[{shape, curve}];
  if (!cell) cell = std::make_unique<const BezierCell>(shape, curve);
  return *cell;
}

}  // namespace curvisplat
