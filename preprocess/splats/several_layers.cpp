#include "preprocess/splats/several_layers.h"

#include <algorithm>
#include <cmath>

#include "stream/model/layers_code.h"

namespace curvisplat {
namespace {

/// What counts of x, by the row of a cell one away from the face.
double excessOf(const CellRow& row) {
  constexpr double kLeft = 0.08, kFaded = 0.12, kMost = 0.25;
  const Stretch stretch = stretchOfRow(row, StretchFit::kSteep);
  const auto squared = [&](size_t n) { return row[n] * row[n]; };
  // extentsOnLine() has shortened the cell at the face by the steady growth.
  const double growth = std::sqrt(steadyGrowth(squared(2), squared(3), squared(4)));
  const double last_step = row[1] / (0.5 + 0.5 / growth);
  const double to_face = 0.5 * (1 + last_step / row[2]) + static_cast<double>(stretch.drift);
  const double x = std::log(static_cast<double>(stretch.factor * layerDistance(stretch.growth)) / to_face);
  if (!(x > kLeft)) return 0;
  return std::min({(x - kLeft) * kFaded / (kFaded - kLeft), x, kMost});
}

/// The row of the cell one away from the face, of the line of the half cell at it. Its last cell is not known: steps from node to node
/// go on as they did.
CellRow rowOfNext(const JointLine& line) {
  const CellRow row = line.row();
  const double first = 2 * line.unit(), second = 2 * row[3] - first, third = 2 * row[4] - second;
  const double last = second > 0 && third > 0 ? 0.5 * third * (1 + third / second) : row[4];
  return {row[1], row[2], row[3], row[4], last};
}

}  // namespace

LayerFit fitBehindFace(const JointLine& line) {
  const double x = excessOf(line.row());
  return {std::exp(-0.34 * x), 1.25 * x, 0.13 * x};
}

LayerFit fitAtFace(const JointLine& line) {
  const double x = excessOf(rowOfNext(line));
  return {std::exp(-0.4 * x), x, 0};
}

bool fitToLayers(const CellAtFaces& at, const CellOnLattice& cell) {
  const auto way = [&](int axis) { return at.inwards[axis] != 0 ? at.inwards[axis] : at.layers[axis]; };
  if ((way(0) != 0) + (way(1) != 0) + (way(2) != 0) < 2) return false;
  for (int axis = 0; axis < 3; ++axis) {
    if (!at.lines[axis].isThere()) continue;
    // By the rounded row: it is all that there is to undo it by, where the face turns out to be a joint (joint_sides.cpp).
    const bool is_half = at.inwards[axis] != 0;
    const LayerFit fit = is_half ? fitAtFace(at.lines[axis]) : fitBehindFace(at.lines[axis]);
    cell.stretch[axis] *= fit.factor;
    const auto growth = static_cast<float>(way(axis) * fit.growth);
    cell.growth[axis] = std::clamp(cell.growth[axis] + growth, -kLargestGrowth, kLargestGrowth);
    cell.middle[axis] = is_half ? cell.middle[axis] * fit.factor : cell.middle[axis] + way(axis) * fit.drift;
  }
  return true;
}

}  // namespace curvisplat
