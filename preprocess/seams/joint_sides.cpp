#include "preprocess/seams/joint_sides.h"

#include <glm/geometric.hpp>
#include <glm/mat3x3.hpp>
#include <glm/vec3.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <span>

#include "preprocess/shape/shape.h"
#include "preprocess/splats/face_layers.h"
#include "preprocess/splats/node_splats.h"
#include "stream/model/border_code.h"

namespace curvisplat {
namespace {

constexpr double kAlong = 0.7;           // cosine of directions that are about the same
constexpr double kMinGrowth = 1.0 / 64;  // less growth becomes none
constexpr double kTowards = 0.5;         // cosine
constexpr size_t kFace = 2;              // of a row: the cell at the face, of a node on it
constexpr double kFaceOfHalf = 0.5;      // from the middle of a half cell, in its length

/// Up to three axes at right angles, with the growth along each.
class GrownAxes {
 public:
  /// `axis`: unit length. Takes out what it has of those before; adds nothing if too little is left.
  void add(const glm::dvec3& axis, double growth);
  uint32_t code() const { return count_ > 0 ? packGrowthCode(axes_, growth_) : kNoGrowth; }

 private:
  std::array<glm::dvec3, 3> axes_{};
  std::array<double, 3> growth_{};
  size_t count_ = 0;
};

void GrownAxes::add(const glm::dvec3& axis, double growth) {
  glm::dvec3 left = axis;
  for (size_t n = 0; n < count_; ++n) left -= glm::dot(left, axes_[n]) * axes_[n];
  const double length = glm::length(left);
  if (count_ == axes_.size() || std::abs(growth) < kMinGrowth || !(length > kAlong)) return;
  axes_[count_] = left / length;
  growth_[count_++] = growth;
}

/// The code of a growth whose axes become in_frame(axis), of unit length, in another frame.
template <typename InFrame>
uint32_t growthAlong(const CellGrowth& growth, const InFrame& in_frame) {
  GrownAxes axes;
  for (size_t n = 0; n < 3; ++n)
    if (growth.growth[n] != 0)
      axes.add(in_frame(glm::dvec3(growth.axis[n])), static_cast<double>(growth.growth[n]));
  return axes.code();
}

/// How a splat changes along one axis of the lattice.
struct AxisChange {
  double factor = 1;  // the length's
  double shift = 0;   // along the axis, in the splat's length before
  double growth = 0;  // afterwards
};

/// Lengthens a node's splat along axes of the lattice, and skews and shifts it there: collects changes along
/// up to three axes, and makes them. Throws nothing.
class Reshape {
 public:
  /// `axis`: unit length, in the splat's frame; what it has of the axes before is taken out. Returns false,
  /// and adds nothing, if too little is left.
  bool add(const glm::dvec3& axis, const AxisChange& change);
  /// Changes the splat, its codes and lines, and the scalars, whose gradients stay. Its growth is kept along
  /// axes that were not added.
  void apply(NodeSplat& node, std::span<SplatScalar> values) const;

 private:
  std::array<glm::dvec3, 3> axes_{};
  std::array<AxisChange, 3> changes_{};
  size_t count_ = 0;
};

/// Changes A to A M, and shifts the splat, both in its frame. Returns the rotation from the old frame's
/// directions to the new one's.
glm::dmat3 change(const glm::dmat3& m, const glm::dvec3& shift, Splat& splat, std::span<SplatScalar> values) {
  const glm::dmat3 a = splat.factor();
  const CellShape shape = shapeFromJacobian(a * m, 0);
  splat.position += a * shift;
  splat.axis = shape.axis;
  splat.shear = shape.shear;
  for (SplatScalar& value : values) {
    value.mean += glm::dot(value.slope, shift);
    value.slope = shape.rotation * (m * value.slope);
  }
  return shape.rotation;
}

LayeredBorder rotated(const LayeredBorder& border, const glm::dmat3& rotation) {
  if (border.code == kNoBorder) return border;
  const InwardAxes inward = inwardAxes(border.code);
  const auto axis = [&](int n) { return rotation * glm::dvec3(inward.axis[static_cast<size_t>(n)]); };
  if (inward.behind) return {packLayerCode(axis(0), static_cast<double>(inward.distance)), border.layers};
  std::array<glm::dvec3, 3> ends{};
  for (int n = 0; n < inward.count; ++n) ends[static_cast<size_t>(n)] = axis(n);
  const std::span<const glm::dvec3> of_ends(ends.data(), static_cast<size_t>(inward.count));
  if (border.layers == 0) return {packBorderCode(of_ends, inward.faces), 0};
  std::array<LayerAxis, 3> layers{};
  size_t count = 0;
  for (int n = inward.count; n < 3; ++n)
    if (const int of_lattice = latticeAxis(border.layers, n); of_lattice >= 0)
      layers[count++] = {axis(n), static_cast<uint8_t>(of_lattice), static_cast<double>(layerDistance(0))};
  return layeredBorder(of_ends, {layers.data(), count});
}

bool Reshape::add(const glm::dvec3& axis, const AxisChange& change) {
  glm::dvec3 left = axis;
  for (size_t n = 0; n < count_; ++n) left -= glm::dot(left, axes_[n]) * axes_[n];
  const double length = glm::length(left);
  if (count_ == axes_.size() || !(length > kAlong)) return false;
  axes_[count_] = left / length;
  changes_[count_++] = change;
  return true;
}

void Reshape::apply(NodeSplat& node, std::span<SplatScalar> values) const {
  if (count_ == 0) return;
  glm::dmat3 m(1.0);
  glm::dvec3 shift(0.0);
  for (size_t n = 0; n < count_; ++n) {
    m += (changes_[n].factor - 1) * glm::outerProduct(axes_[n], axes_[n]);
    shift += changes_[n].shift * axes_[n];
  }
  const glm::dmat3 rotation = change(m, shift, node.splat, values);

  GrownAxes grown;
  for (size_t n = 0; n < count_; ++n) grown.add(rotation * axes_[n], changes_[n].growth);
  const CellGrowth before = cellGrowth(node.growth_code);
  for (size_t n = 0; n < 3; ++n) {
    const glm::dvec3 axis(before.axis[n]);
    const bool is_changed =
        std::any_of(axes_.begin(), axes_.begin() + static_cast<ptrdiff_t>(count_),
                    [&](const glm::dvec3& changed) { return std::abs(glm::dot(changed, axis)) > kAlong; });
    if (before.growth[n] != 0 && !is_changed)
      grown.add(rotation * axis, static_cast<double>(before.growth[n]));
  }
  node.growth_code = grown.code();
  const LayeredBorder border = rotated({node.border_code, node.layers}, rotation);
  node.border_code = border.code;
  node.layers = border.layers;
  for (JointLine& line : node.lines)
    if (line.isThere()) line.setInward(rotation * line.inward());
}

}  // namespace

bool leaveOneFace(const NodeSplat& a, const glm::dvec3& inward_of_a, const NodeSplat& b,
                  const glm::dvec3& inward_of_b) {
  constexpr double kSameFace = -0.9999;  // cosine of normals, in the frame of one of the cells
  const JointLine *of_a = a.lineAlong(inward_of_a), *of_b = b.lineAlong(inward_of_b);
  if (of_a == nullptr || of_b == nullptr) return false;
  const auto seen_in = [](const NodeSplat& cell, const glm::dvec3& inward, const NodeSplat& other,
                          const glm::dvec3& inward_of_other) {
    const glm::dvec3 normal = glm::transpose(cell.splat.factor()) * gradientOf(other.splat, inward_of_other);
    return glm::dot(normal, inward) / glm::length(normal);
  };
  const glm::dvec3 p = of_a->exactInward(), q = of_b->exactInward();
  return seen_in(a, p, b, q) < kSameFace && seen_in(b, q, a, p) < kSameFace;
}

bool leadApart(const NodeSplat& a, const glm::dvec3& inward_of_a, const NodeSplat& b,
               const glm::dvec3& inward_of_b) {
  constexpr double kApart = -0.1;  // cosine
  const JointLine *of_a = a.lineAlong(inward_of_a), *of_b = b.lineAlong(inward_of_b);
  const glm::dvec3 p = of_a != nullptr ? of_a->exactInward() : inward_of_a;
  const glm::dvec3 q = of_b != nullptr ? of_b->exactInward() : inward_of_b;
  const glm::dvec3 q_in_a = inFrameOf(a.splat, b.splat.factor() * q);
  const glm::dvec3 p_in_b = inFrameOf(b.splat, a.splat.factor() * p);
  return !(glm::dot(p, q_in_a) > kApart * glm::length(q_in_a)) &&
         !(glm::dot(q, p_in_b) > kApart * glm::length(p_in_b));
}

std::vector<JointSide> sidesOf(std::span<const NodeSplat* const> parts, std::span<const size_t> group,
                               JointFrames frames) {
  std::vector<JointSide> sides;
  for (size_t n = 0; n < parts.size(); ++n)
    for (size_t m = 0; m < parts.size(); ++m) {
      if (m == n || group[m] != group[n]) continue;
      const InwardAxes of_n = inwardAxes(parts[n]->border_code), of_m = inwardAxes(parts[m]->border_code);
      forEachOpposite(*parts[n], *parts[m], frames, [&](int a, int b, double) {
        const glm::dvec3 inward(of_n.axis[static_cast<size_t>(a)]), other(of_m.axis[static_cast<size_t>(b)]);
        const JointLine *own = parts[n]->lineAlong(inward), *beyond = parts[m]->lineAlong(other);
        const bool is_known = std::any_of(sides.begin(), sides.end(), [&](const JointSide& side) {
          return side.part == n && side.direction == a;
        });
        if (is_known || own == nullptr || beyond == nullptr) return;
        const CellRow here = own->row(), there = beyond->row();
        const CellRow row{there[4], there[3], own->unit() + beyond->unit(), here[3], here[4]};
        const NodeSplat& part = *parts[n];
        if (frames == JointFrames::kRows) {
          const glm::dvec3 exact = own->exactInward();
          sides.push_back({n, a, exact, row, own->unit() / glm::length(part.splat.factor() * exact)});
        } else {
          const double stretch = stretchAtBorder(static_cast<double>(own->stretch(part.fit).factor));
          sides.push_back({n, a, inward, row, 1 / (fittedFactor(part, inward) * stretch)});
        }
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
    reshape.add(side.inward, {side.unstretch, kFaceOfHalf * (side.unstretch - 1), 0});
  }
  reshape.apply(whole, values);
  splat = whole.splat;
}

void stretchWhole(const NodeSplat& part, std::span<const JointSide> sides,
                  const std::function<glm::dvec3(const glm::dvec3&)>& in_merged, NodeSplat& merged,
                  std::span<SplatScalar> values) {
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
