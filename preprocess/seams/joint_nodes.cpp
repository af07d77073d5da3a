#include "preprocess/seams/joint_nodes.h"

#include <glm/geometric.hpp>

#include <algorithm>
#include <array>
#include <numeric>
#include <utility>

#include "preprocess/seams/joint_sides.h"
#include "preprocess/shape/shape.h"
#include "preprocess/splats/node_splats.h"
#include "stream/model/border_code.h"

namespace curvisplat {
namespace {

constexpr double kSimilar = 0.5;    // cosine: of one direction
constexpr double kOpposite = -0.5;  // of two that close one another
constexpr double kMinSine = 0.1;    // what must be left of a direction at right angles to the others

}  // namespace

bool isOpen(const Splat& face, uint32_t border_code, const Splat& behind) {
  const InwardAxes inward = inwardAxes(border_code);
  const glm::dvec3 direction = glm::normalize(inFrameOf(face, behind.position - face.position));
  for (int a = 0; a < inward.count; ++a)
    if (inward.hasFace(a) && glm::dot(glm::dvec3(inward.axis[static_cast<size_t>(a)]), direction) > kSimilar)
      return true;
  return false;
}

void OpenBorders::add(const NodeSplat& part, uint32_t closed, JointFrames frames) {
  const InwardAxes inward = inwardAxes(part.border_code);
  for (int a = 0; a < inward.count; ++a) {
    const glm::dvec3 axis(inward.axis[static_cast<size_t>(a)]);
    const JointLine* const line = frames == JointFrames::kRows ? part.lineAlong(axis) : nullptr;
    inward_.push_back({part.splat.factor() * (line != nullptr ? line->exactInward() : axis), parts_,
                       inward.hasFace(a), (closed >> a & 1) != 0, line != nullptr});
  }
  ++parts_;
}

LayeredBorder OpenBorders::of(const Splat& merged, std::span<const Layer> layers) const {
  std::vector<glm::dvec3> directions;
  for (const Inward& inward : inward_) directions.push_back(glm::normalize(inFrameOf(merged, inward.along)));

  struct Open {
    glm::dvec3 along;  // sum of similar directions
    bool face;
  };
  std::vector<Open> open;
  for (size_t n = 0; n < directions.size(); ++n) {
    const glm::dvec3& direction = directions[n];
    bool closed = inward_[n].closed;
    for (size_t m = 0; m < directions.size(); ++m)
      closed |= inward_[m].part != inward_[n].part && !(inward_[m].has_line && inward_[n].has_line) &&
                glm::dot(directions[m], direction) < kOpposite;
    if (closed) continue;
    const auto same = std::find_if(open.begin(), open.end(), [&](const Open& other) {
      return glm::dot(glm::normalize(other.along), direction) > kSimilar;
    });
    if (same == open.end()) {
      open.push_back({direction, inward_[n].face});
    } else {
      same->along += direction;
      same->face &= inward_[n].face;
    }
  }

  std::array<glm::dvec3, 3> axes;
  size_t count = 0;
  uint32_t faces = 0;
  for (const Open& border : open) {
    glm::dvec3 axis = glm::normalize(border.along);
    for (size_t n = 0; n < count; ++n) axis -= glm::dot(axis, axes[n]) * axes[n];
    if (count == 3 || glm::length(axis) <= kMinSine) continue;
    if (border.face) faces |= 1u << count;
    axes[count++] = glm::normalize(axis);
  }
  if (faces != (1u << count) - 1) return {packBorderCode({axes.data(), count}, faces), 0};
  std::array<LayerAxis, 3> behind{};
  size_t behind_count = 0;
  for (const Layer& layer : layers) {
    glm::dvec3 axis = glm::normalize(inFrameOf(merged, layer.inward));
    if (std::any_of(directions.begin(), directions.end(), [&](const glm::dvec3& direction) {
          return std::abs(glm::dot(direction, axis)) > kSimilar;
        }))
      continue;
    for (size_t n = 0; n < count; ++n) axis -= glm::dot(axis, axes[n]) * axes[n];
    for (size_t n = 0; n < behind_count; ++n) axis -= glm::dot(axis, behind[n].inward) * behind[n].inward;
    if (count + behind_count == 3 || !(glm::length(axis) > kSimilar)) continue;
    axis = glm::normalize(axis);
    behind[behind_count++] = {axis, layer.axis,
                              glm::dot(axis, inFrameOf(merged, merged.position - layer.face))};
  }
  return layeredBorder({axes.data(), count}, {behind.data(), behind_count});
}

void BendOfParts::add(const Splat& splat, const glm::dvec3& offset, std::span<const SplatScalar> values) {
  weight_ += splat.weight;
  middle_ += splat.weight * offset;
  for (size_t v = 0; v < sums_.size(); ++v) {
    const glm::dvec3 gradient = gradientOf(splat, values[v].slope);
    sums_[v].along += splat.weight * glm::dot(gradient, offset);
    sums_[v].gradient += splat.weight * gradient;
  }
}

void BendOfParts::correct(std::span<SplatScalar> merged) const {
  if (!(weight_ > 0)) return;
  for (size_t v = 0; v < sums_.size(); ++v) {
    // Two halves, with a scalar's second difference b: b / 8, and b² / 192 is what they add to the variance.
    const double eighth = (sums_[v].along - glm::dot(sums_[v].gradient, middle_) / weight_) / weight_;
    merged[v].mean -= (1 - 8 * kBend) * eighth;
    merged[v].variance = std::max(0.0, merged[v].variance - eighth * eighth / 3);
  }
}

namespace {

// The number of nodes at a point beyond which the grid has collapsed (a pole), and all of them are merged.
constexpr size_t kMaxParts = 64;
constexpr double kStraight = -0.9;  // cosine of halves on about one line

/// How thick a cell is at right angles to the face that q leaves inwards, before it was fitted to faces.
double thickness(const NodeSplat& half, const glm::dvec3& q) {
  return 1 / (glm::length(gradientOf(half.splat, q)) * fittedFactor(half, q));
}

bool isUnlike(double a, double b, double most) {
  return std::max(a, b) > most * std::min(a, b);
}

/// How two parts of one point lie to one another.
enum class Neighbourhood {
  kLike,      // on two sides of a face, and about as thick
  kUnlike,    // on two sides of a face, and one much thicker
  kDiagonal,  // on two sides of several faces
  kOther,     // of no face
};

Neighbourhood neighbourhood(const NodeSplat& a, const NodeSplat& b, JointFrames frames) {
  const InwardAxes of_a = inwardAxes(a.border_code), of_b = inwardAxes(b.border_code);
  int opposite = 0;
  bool unlike = false;
  forEachOpposite(a, b, frames, [&](int n, int m, double cosine) {
    ++opposite;
    if (!of_a.hasFace(n) || !of_b.hasFace(m)) return;
    const double most = cosine < kStraight ? kMaxJointRatio : kMaxKinkedRatio;
    const glm::dvec3 inward(of_a.axis[static_cast<size_t>(n)]), other(of_b.axis[static_cast<size_t>(m)]);
    // Directions are coded to 0.01 of the cell, which is many times a thin cell's thickness: a joint across
    // such cells would look unlike. Weights are exact, and halves of one face differ in them as in
    // thickness.
    unlike |= isUnlike(thickness(a, inward), thickness(b, other), most) &&
              isUnlike(a.splat.weight, b.splat.weight, most);
  });
  if (opposite == 0) return Neighbourhood::kOther;
  if (opposite > 1) return Neighbourhood::kDiagonal;
  return unlike ? Neighbourhood::kUnlike : Neighbourhood::kLike;
}

/// The group of each part, numbered by its first part: parts on two sides of an unlike joint, or of a thin wall, are in
/// two. All zero if there is no such joint.
std::vector<size_t> groupsAtJoints(std::span<const NodeSplat> parts, std::span<const uint32_t> wall_sides,
                                   JointFrames frames) {
  std::vector<size_t> group(parts.size());
  std::iota(group.begin(), group.end(), size_t{0});
  bool any_unlike = false;
  for (size_t a = 0; a < parts.size(); ++a)
    for (size_t b = a + 1; b < parts.size(); ++b) {
      Neighbourhood lie = neighbourhood(parts[a], parts[b], frames);
      if (lie == Neighbourhood::kLike && wall_sides[a] != wall_sides[b]) lie = Neighbourhood::kUnlike;
      any_unlike |= lie == Neighbourhood::kUnlike;
      if (lie == Neighbourhood::kUnlike || lie == Neighbourhood::kDiagonal) continue;
      const size_t to = std::min(group[a], group[b]), from = std::max(group[a], group[b]);
      std::replace(group.begin(), group.end(), from, to);
    }
  if (!any_unlike) std::fill(group.begin(), group.end(), size_t{0});
  return group;
}

/// Makes a splat of the layer behind a seam. A probe gives only its line, to the splat that waits for it
/// (seams.h).
void goOnBehind(std::span<const NodeSplat* const> parts, std::span<const JointSide> sides, NodeSplat& behind,
                std::span<SplatScalar> values) {
  for (size_t axis = 0; axis < behind.lines.size(); ++axis) {
    JointLine& line = behind.lines[axis];
    if (!line.isThere() || (behind.is_probe && axis != behind.layers)) continue;
    const std::optional<JointLine> joined = lineBehind(parts, sides, behind, line);
    if (behind.is_probe)
      line = joined.value_or(JointLine());
    else if (joined)
      goOnAcross(axis, *joined, behind, values);
  }
}

}  // namespace

void MergedParts::begin(const NodeSplat& first, std::span<const SplatScalar> values,
                        std::span<const JointSide> sides) {
  origin_ = first.node_position;
  lowest_.splat = first;
  lowest_.values.assign(values.begin(), values.end());
  merger_.clear();
  bend_.clear();
  borders_.clear();
  rows_.clear();
  sides_.clear();
  nodes_.clear();
  add(first, values, sides);
}

void MergedParts::add(const NodeSplat& part, std::span<const SplatScalar> values,
                      std::span<const JointSide> sides) {
  nodes_.push_back(part.node);
  Splat half = part.splat;
  values_of_half_.assign(values.begin(), values.end());
  if (!sides.empty()) unstretchHalves(part, sides, half, values_of_half_);
  merger_.add(half.position, half, values_of_half_);
  bend_.add(half, half.position - origin_, values_of_half_);
  uint32_t closed = 0;
  if (frames_ == JointFrames::kRows) {
    for (const JointSide& side : sides) closed |= 1u << side.direction;
    rows_.add({part, half.position - origin_, values, values_of_half_}, sides);
  }
  borders_.add(part, closed, sides.empty() ? JointFrames::kCells : frames_);
  if (part.node > lowest_.splat.node) return;
  lowest_.splat = part;
  sides_.assign(sides.begin(), sides.end());
}

/// The layers of the lowest part, from its probes; those of the other parts tell the same of the same faces.
std::vector<OpenBorders::Layer> MergedParts::layersOfLowest() const {
  const NodeSplat& lowest = lowest_.splat;
  const InwardAxes inward = inwardAxes(lowest.border_code);
  std::vector<OpenBorders::Layer> layers;
  for (int n = 0; n < 3; ++n) {
    const int axis = latticeAxis(lowest.layers, n);
    if (axis < 0) continue;
    const glm::dvec3 along = lowest.splat.factor() * glm::dvec3(inward.axis[static_cast<size_t>(n)]);
    layers.push_back({along, lowest.splat.position - static_cast<double>(layerDistance(0)) * along,
                      static_cast<uint8_t>(axis)});
  }
  return layers;
}

SplatWithValues MergedParts::finish() const {
  SplatWithValues merged = lowest_;
  if (nodes_.size() == 1) return merged;
  const bool goes_on = frames_ == JointFrames::kRows && rows_.goOn();
  if (goes_on) {
    rows_.finish(origin_, merged.splat.splat, merged.values);
  } else {
    merger_.finish(merged.splat.splat, merged.values);
    bend_.correct(merged.values);
  }
  const LayeredBorder border = borders_.of(merged.splat.splat, layersOfLowest());
  merged.splat.border_code = border.code;
  merged.splat.layers = border.layers;
  merged.splat.regular = false;
  const Splat whole = merged.splat.splat;
  const auto in_merged = [&](const glm::dvec3& direction) {
    return goes_on ? rows_.inFrame(whole, lowest_.splat.splat, sides_, direction)
                   : glm::normalize(inFrameOf(whole, lowest_.splat.splat.factor() * direction));
  };
  stretchWhole(lowest_.splat, sides_, in_merged, merged.splat, merged.values);
  return merged;
}

void JointNodes::add(const NodeSplat& splat, std::span<const SplatScalar> values, uint32_t wall_side) {
  if (splat.behind_face) {
    behind_.add(splat, values);
  } else if (all_merged_) {
    groups_.front().add(splat, values, {});
  } else {
    parts_.add(splat, values);
    wall_sides_.push_back(wall_side);
    if (parts_.size() > kMaxParts) mergeAll();
  }
}

MergedParts& JointNodes::nextGroup() {
  if (group_count_ == groups_.size()) groups_.emplace_back(variables_, framesOf(unlike_));
  return groups_[group_count_++];
}

void JointNodes::mergeAll() {
  MergedParts& merged = nextGroup();
  merged.begin(parts_.splat(0), parts_.values(0), {});
  for (size_t n = 1; n < parts_.size(); ++n) merged.add(parts_.splat(n), parts_.values(n), {});
  parts_.clear();
  all_merged_ = true;
}

/// `sides`: by part.
void JointNodes::mergeGroups(std::span<const size_t> group, std::span<const JointSide> sides) {
  std::vector<size_t> place(parts_.size());  // in `groups_`, of the group that begins with a part
  for (size_t n = 0; n < parts_.size(); ++n) {
    const auto of_part =
        std::equal_range(sides.begin(), sides.end(), JointSide{n},
                         [](const JointSide& a, const JointSide& b) { return a.part < b.part; });
    const std::span<const JointSide> own(of_part.first, of_part.second);
    if (group[n] == n) {
      place[n] = group_count_;
      nextGroup().begin(parts_.splat(n), parts_.values(n), own);
    } else {
      groups_[place[group[n]]].add(parts_.splat(n), parts_.values(n), own);
    }
  }
}

void JointNodes::finish(const Sink& sink) {
  if (!all_merged_ && parts_.size() == 1) {
    // Most points have one part, which stays as it is.
    const uint64_t node = parts_.splat(0).node;
    sink(parts_.splat(0), parts_.values(0), {&node, 1});
    if (behind_.size() > 0) {
      faces_.push_back(parts_.splat(0));
      const NodeSplat* const part = &faces_.front();
      finishBehind({&part, 1}, {}, sink);
    }
  } else {
    finishSeveral(sink);
  }
  clear();
}

bool JointNodes::joinsHalves() const {
  const std::span<const NodeSplat> parts = parts_.splats();
  for (size_t a = 0; a < parts.size(); ++a)
    for (size_t b = a + 1; b < parts.size(); ++b)
      if (neighbourhood(parts[a], parts[b], framesOf(unlike_)) == Neighbourhood::kLike) return true;
  return false;
}

std::vector<uint64_t> JointNodes::nodes() const {
  std::vector<uint64_t> nodes;
  for (const NodeSplat& part : parts_.splats()) nodes.push_back(part.node);
  return nodes;
}

void JointNodes::clear() {
  parts_.clear();
  wall_sides_.clear();
  behind_.clear();
  faces_.clear();
  all_merged_ = false;
  group_count_ = 0;
}

void JointNodes::finishSeveral(const Sink& sink) {
  std::vector<const NodeSplat*> parts;
  for (const NodeSplat& part : parts_.splats()) parts.push_back(&part);
  std::vector<size_t> group(parts_.size(), 0);
  const JointFrames frames = framesOf(unlike_);
  if (unlike_ != UnlikeHalves::kMerged) group = groupsAtJoints(parts_.splats(), wall_sides_, frames);
  const std::vector<JointSide> sides = sidesOf(parts, group, frames);
  if (!all_merged_) mergeGroups(group, sides);
  for (size_t n = 0; n < group_count_; ++n) {
    const SplatWithValues merged = groups_[n].finish();
    faces_.push_back(merged.splat);
    sink(merged.splat, merged.values, groups_[n].nodes());
  }
  finishBehind(parts, sides, sink);
}

void JointNodes::finishBehind(std::span<const NodeSplat* const> parts, std::span<const JointSide> sides,
                              const Sink& sink) {
  for (size_t n = 0; n < behind_.size(); ++n) {
    NodeSplat& behind = behind_.splat(n);
    const bool open = std::any_of(faces_.begin(), faces_.end(), [&](const NodeSplat& face) {
      return isOpen(face.splat, face.border_code, behind.splat);
    });
    if (!open) {
      behind.border_code = kNoBorder;
      goOnBehind(parts, sides, behind, behind_.values(n));
    }
    sink(behind, behind_.values(n), {});
  }
}

}  // namespace curvisplat
