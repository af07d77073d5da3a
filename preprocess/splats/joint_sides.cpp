#include "preprocess/splats/joint_sides.h"

#include <algorithm>
#include <glm/geometric.hpp>

#include "preprocess/splats/opposite_halves.h"
#include "preprocess/splats/reshape.h"
#include "preprocess/splats/several_layers.h"
#include "preprocess/splats/shape.h"

namespace curvisplat {
namespace {

constexpr double kTowards = 0.5;     // cosine
constexpr size_t kFace = 2;          // of a row: the cell at the face, of a node on it
constexpr double kFaceOfHalf = 0.5;  // from the middle of a half cell, in its length

}  // namespace

std::vector<JointSide> sidesOf(std::span<const NodeSplat* const> parts, std::span<const size_t> group) {
  std::vector<JointSide> sides;
  for (size_t n = 0; n < parts.size(); ++n)
    for (size_t m = 0; m < parts.size(); ++m) {
      if (m == n || group[m] != group[n]) continue;
      const InwardAxes of_n = inwardAxes(parts[n]->border_code), of_m = inwardAxes(parts[m]->border_code);
      forEachOpposite(*parts[n], *parts[m], [&](int a, int b, double) {
        const glm::dvec3 inward(of_n.axis[static_cast<size_t>(a)]), other(of_m.axis[static_cast<size_t>(b)]);
        const JointLine *own = parts[n]->lineAlong(inward), *beyond = parts[m]->lineAlong(other);
        const bool is_known = std::any_of(sides.begin(), sides.end(), [&](const JointSide& side) {
          return side.part == n && side.direction == a;
        });
        if (is_known || own == nullptr || beyond == nullptr) return;
        const CellRow here = own->row(), there = beyond->row();
        sides.push_back({n, a, inward, {there[4], there[3], own->unit() + beyond->unit(), here[3], here[4]}});
      });
    }
  return sides;
}

double fittedFactor(const NodeSplat& half, const glm::dvec3& inward) {
  const JointLine* const line = half.fits_layers ? half.lineAlong(inward) : nullptr;
  return line != nullptr ? fitAtFace(*line).factor : 1;
}

void unstretchHalves(const NodeSplat& half, std::span<const JointSide> sides, Splat& splat,
                     std::span<SplatScalar> values) {
  NodeSplat whole = half;
  Reshape reshape;
  for (const JointSide& side : sides) {
    const Stretch stretch = half.lineAlong(side.inward)->stretch(half.fit);
    const double factor =
        1 / (fittedFactor(half, side.inward) * stretchAtBorder(static_cast<double>(stretch.factor)));
    reshape.add(side.inward, {factor, kFaceOfHalf * (factor - 1), 0});
  }
  reshape.apply(whole, values);
  splat = whole.splat;
}

void stretchWhole(const NodeSplat& part, std::span<const JointSide> sides, NodeSplat& merged,
                  std::span<SplatScalar> values) {
  const auto in_merged = [&](const glm::dvec3& direction) {
    return glm::normalize(inFrameOf(merged.splat, part.splat.factor() * direction));
  };
  for (JointLine& line : merged.lines)
    if (line.isThere()) line.setInward(in_merged(line.inward()));
  merged.growth_code = growthAlong(cellGrowth(part.growth_code), in_merged);
  Reshape reshape;
  for (const JointSide& side : sides) {
    const Stretch stretch = stretchOfRow(side.row, part.fit);
    reshape.add(in_merged(side.inward),
                {static_cast<double>(stretch.factor), static_cast<double>(stretch.drift),
                 static_cast<double>(stretch.growth)});
  }
  reshape.apply(merged, values);
}

std::optional<JointLine> lineBehind(std::span<const NodeSplat* const> parts, std::span<const JointSide> sides,
                                    const NodeSplat& behind, const JointLine& line) {
  const JointSide* nearest = nullptr;
  double most = kTowards;
  for (const JointSide& side : sides) {
    const Splat& splat = parts[side.part]->splat;
    const glm::dvec3 to_behind = glm::normalize(inFrameOf(splat, behind.splat.position - splat.position));
    const double along = glm::dot(to_behind, side.inward);
    if (!(along > most)) continue;
    most = along;
    nearest = &side;
  }
  if (nearest == nullptr) return std::nullopt;
  const CellRow own = line.row();
  JointLine joined({nearest->row[1], nearest->row[kFace], own[2], own[3], own[4]}, line.unit());
  joined.setInward(line.inward());
  return joined;
}

void goOnAcross(size_t axis, const JointLine& joined, NodeSplat& behind, std::span<SplatScalar> values) {
  const JointLine own = behind.lines[axis];
  if (!own.isThere() || !joined.isThere()) return;
  const Stretch before = own.stretch(behind.fit), after = joined.stretch(behind.fit);
  const LayerFit fit = behind.fits_layers ? fitBehindFace(own) : LayerFit();
  const double factor = static_cast<double>(before.factor) * fit.factor;
  Reshape reshape;
  reshape.add(own.inward(), {static_cast<double>(after.factor) / factor,
                             (static_cast<double>(after.drift - before.drift) - fit.drift) / factor,
                             static_cast<double>(after.growth)});
  reshape.apply(behind, values);
  behind.lines[axis] = {};
}

}  // namespace curvisplat
