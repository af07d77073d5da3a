#include "preprocess/splats/stretch.h"

#include <glm/geometric.hpp>

#include <algorithm>
#include <numbers>

#include "stream/base/vector_clones.h"

namespace curvisplat {

namespace {

constexpr size_t kAtOnce = 64;

/// The squared extents, times four, of the cells of up to kAtOnce nodes, and of the two before and after each on its line: as
/// CellLengths::squared() finds them, in loops that become vector instructions.
struct ExtentsAround {
  double of[5][kAtOnce];  // [steps + 2][node]

  [[gnu::always_inline]] inline ExtentsAround(const NodeRow& row, size_t first, size_t count) {
    const ptrdiff_t at = row.at + static_cast<ptrdiff_t>(first);
    const double *const x = row.nodes.x + at, *const y = row.nodes.y + at, *const z = row.nodes.z + at;
    const ptrdiff_t last = static_cast<ptrdiff_t>(count), along = row.stride;
    double normal[3][kAtOnce], area[kAtOnce];
    const ptrdiff_t p = row.across[0], q = row.across[1];
    for (ptrdiff_t n = 0; n < last; ++n) {
      const double px = x[n + p] - x[n - p], py = y[n + p] - y[n - p], pz = z[n + p] - z[n - p];
      const double qx = x[n + q] - x[n - q], qy = y[n + q] - y[n - q], qz = z[n + q] - z[n - q];
      const double nx = py * qz - qy * pz, ny = pz * qx - qz * px, nz = px * qy - qx * py;
      normal[0][n] = nx;
      normal[1][n] = ny;
      normal[2][n] = nz;
      area[n] = nx * nx + ny * ny + nz * nz;
    }
    for (ptrdiff_t steps = 0; steps < 5; ++steps) {
      const ptrdiff_t from = (steps - 3) * along, to = (steps - 1) * along;
      for (ptrdiff_t n = 0; n < last; ++n) {
        const double wx = x[n + to] - x[n + from], wy = y[n + to] - y[n + from], wz = z[n + to] - z[n + from];
        const double volume = wx * normal[0][n] + wy * normal[1][n] + wz * normal[2][n];
        const double across = volume * volume / (area[n] > 0 ? area[n] : 1);
        of[steps][n] = area[n] > 0 ? across : wx * wx + wy * wy + wz * wz;
      }
    }
  }
};

/// stretchNodes() of up to kAtOnce nodes. Returns whether any cell may have terms for steep growth.
template <StretchFit kFit>
[[gnu::always_inline]] inline bool stretchSome(const ExtentsAround& extents, size_t count,
                                               const StretchRow& out) {
  constexpr double kGentle =
      5.3;  // of squared extents that are two cells apart: e to twice the slope is less
  const auto& [before2, before, own, after, after2] = extents.of;
  int any_steep = 0;
  for (size_t n = 0; n < count; ++n) {
    const Stretch found = stretchOf(before2[n], before[n], own[n], after[n], after2[n], kFit);
    out.factor[n] = found.factor;
    out.growth[n] = found.growth;
    out.drift[n] = found.drift;
    any_steep |=
        static_cast<int>(after[n] > kGentle * before[n]) | static_cast<int>(before[n] > kGentle * after[n]);
  }
  return any_steep != 0;
}

}  // namespace

CURVISPLAT_VECTOR_CLONES void stretchNodes(const NodeRow& row, const StretchRow& out, StretchFit fit) {
  for (size_t done = 0; done < row.count; done += kAtOnce) {
    const size_t some = std::min(kAtOnce, row.count - done);
    const ExtentsAround extents(row, done, some);
    const StretchRow of_some{out.factor + done, out.growth + done, out.drift + done};
    // The terms for steep growth are zero in most rows, and take time.
    if (stretchSome<StretchFit::kGentle>(extents, some, of_some) && fit == StretchFit::kSteep)
      stretchSome<StretchFit::kSteep>(extents, some, of_some);
  }
}

namespace {

/// The squared extents of nodes near one end of a line, times four as above.
class LineEnd {
 public:
  /// `inwards`: the stride from the end node into the line, which has at least two nodes; `samples` of them
  /// are known.
  LineEnd(const CellLengths& cells, ptrdiff_t end, ptrdiff_t inwards, int samples)
      : cells_(cells), end_(end), inwards_(inwards) {
    // The end node's extent is of one side only. On a steady line, whose neighbours are g times as far apart
    // from step to step, it is (1 + 1/g)/2 as long.
    own_ = 4 * cells_.squared(end_, end_ + inwards_);
    if (samples <= kStretchReach) return;
    growth_ = steadyGrowth(inner(1), inner(2), inner(3));
    const double half = 0.5 * (1 + 1 / std::sqrt(growth_));
    own_ *= half * half;
  }

  /// The squared extent of the end node itself.
  double own() const { return own_; }
  /// The squared extent of the sample that would be `steps` beyond the end node, from that of its mirror
  /// image.
  double beyond(int steps, double mirrored) const {
    double shrunk = mirrored;
    for (int n = 0; n < 2 * steps; ++n) shrunk /= growth_;
    return shrunk;
  }

 private:
  double inner(ptrdiff_t steps) const {
    return cells_.squared(end_ + (steps - 1) * inwards_, end_ + (steps + 1) * inwards_);
  }

  const CellLengths& cells_;
  ptrdiff_t end_, inwards_;
  double growth_ = 1, own_ = 0;
};

}  // namespace

SquaredExtents extentsOnLine(const CellLengths& cells, ptrdiff_t at, ptrdiff_t stride, int before,
                             int after) {
  before = std::min(before, kStretchReach);
  after = std::min(after, kStretchReach);
  if (before + after == 0) return {};
  if (before + after == 1) {
    const double own = 4 * cells.squared(at, at + (after - before) * stride);
    return {own, own, own, own, own};
  }
  const int samples = before + 1 + after;
  const LineEnd first(cells, at - before * stride, stride, samples);
  const LineEnd last(cells, at + after * stride, -stride, samples);
  // A line is reflected at either end as often as it takes; where there are `kStretchReach` samples on a
  // side, its end is out of sight.
  const auto extent = [&](int steps, const auto& self) -> double {
    if (steps < -before) return first.beyond(-before - steps, self(-2 * before - steps, self));
    if (steps > after) return last.beyond(steps - after, self(2 * after - steps, self));
    if (steps == -before && before < kStretchReach) return first.own();
    if (steps == after && after < kStretchReach) return last.own();
    return cells.squared(at + (steps - 1) * stride, at + (steps + 1) * stride);
  };
  const double before2 = extent(-2, extent), near_before = extent(-1, extent);
  const double near_after = extent(1, extent), after2 = extent(2, extent);
  return {before2, near_before, extent(0, extent), near_after, after2};
}

namespace {

constexpr double kMax = 127;

int8_t rounded(double x) {
  return static_cast<int8_t>(std::clamp(std::round(x), -kMax, kMax));
}

bool isUsable(double x) {
  return x > 0 && std::isfinite(x);
}

/// rounded(log2(ratio()) / step). std::log2() is slow, and needed only where the quotient is close to the
/// middle between two integers.
template <typename Ratio>
int8_t roundedLogarithm(double squared_ratio, double step, const Ratio& ratio) {
  constexpr double kSmallest = 1e-30, kLargest = 1e30;  // well within what a float can hold
  constexpr double kClose = 0.01;     // in steps: more than 50 times halfLogarithm()'s error
  constexpr int kMaxSteps = 1 << 12;  // for ratios in this range
  if (squared_ratio > kSmallest && squared_ratio < kLargest) {
    const double per_step = 1 / (std::numbers::ln2 * step);
    const double steps = per_step * static_cast<double>(halfLogarithm(static_cast<float>(squared_ratio)));
    const double shifted = steps + (kMaxSteps + 0.5);
    const int nearest = static_cast<int>(shifted);
    if (const double part = shifted - nearest; part > kClose && part < 1 - kClose) {
      constexpr int kMaxRounded = static_cast<int>(kMax);
      return static_cast<int8_t>(std::clamp(nearest - kMaxSteps, -kMaxRounded, kMaxRounded));
    }
  }
  return rounded(std::log2(ratio()) / step);
}

}  // namespace

JointLine::JointLine(const CellRow& row, double unit) : unit_(static_cast<float>(unit)) {
  if (!isUsable(unit_) || !std::all_of(row.begin(), row.end(), isUsable)) {
    unit_ = 0;
    return;
  }
  for (size_t n = 0; n < row.size(); ++n) {
    const double ratio = row[n] / unit_;
    logarithms_[n] = roundedLogarithm(ratio * ratio, kStep, [&] { return ratio; });
  }
}

JointLine JointLine::ofExtents(const SquaredExtents& extents, double unit) {
  JointLine line;
  const auto rounded_unit = static_cast<float>(unit);
  if (!isUsable(rounded_unit) || !std::all_of(extents.begin(), extents.end(), isUsable)) return line;
  line.unit_ = rounded_unit;
  const double per_unit = 0.25 / (line.unit() * line.unit());
  for (size_t n = 0; n < extents.size(); ++n) {
    if (n > 0 && extents[n] == extents[n - 1]) {  // as on lines of two nodes, and in even cells
      line.logarithms_[n] = line.logarithms_[n - 1];
      continue;
    }
    const auto ratio = [&] { return 0.5 * std::sqrt(extents[n]) / line.unit(); };
    line.logarithms_[n] = roundedLogarithm(extents[n] * per_unit, kStep, ratio);
  }
  return line;
}

CellRow JointLine::row() const {
  CellRow row;
  for (size_t n = 0; n < row.size(); ++n) row[n] = unit_ * std::exp2(kStep * logarithms_[n]);
  return row;
}

glm::dvec3 JointLine::inward() const {
  return glm::normalize(glm::dvec3(inward_[0], inward_[1], inward_[2]));
}

glm::dvec3 JointLine::exactInward() const {
  return glm::normalize(glm::dvec3(exact_inward_[0], exact_inward_[1], exact_inward_[2]));
}

void JointLine::setInward(const glm::dvec3& unit_vector) {
  for (int n = 0; n < 3; ++n) {
    inward_[static_cast<size_t>(n)] = rounded(kMax * unit_vector[n]);
    exact_inward_[static_cast<size_t>(n)] = static_cast<float>(unit_vector[n]);
  }
}

}  // namespace curvisplat
