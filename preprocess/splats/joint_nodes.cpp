#include "preprocess/splats/joint_nodes.h"

#include <algorithm>
#include <array>
#include <glm/geometric.hpp>
#include <numeric>
#include <utility>

#include "preprocess/splats/shape.h"
#include "stream/model/border_code.h"
#include "stream/model/layers_code.h"

namespace curvisplat {
namespace {

// Where more nodes meet than this, the grid has collapsed (a pole), and all of them are merged.
constexpr size_t kMaxParts = 64;
constexpr double kOpposite = -0.5;  // cosine of two directions, in the frame of a cell

/// How thick a cell is at right angles to the face that q leaves inwards.
double thickness(const Splat& splat, const glm::dvec3& q) {
  return 1 / glm::length(gradientOf(splat, q));
}

bool isUnlike(double a, double b) {
  return std::max(a, b) > kMaxJointRatio * std::min(a, b);
}

/// How two parts of one point lie to one another.
enum class Neighbourhood {
  kLike,      // on two sides of a face, and about as thick
  kUnlike,    // on two sides of a face, and one much thicker
  kDiagonal,  // on two sides of several faces
  kOther,     // of no face
};

Neighbourhood neighbourhood(const NodeSplat& a, const NodeSplat& b) {
  const InwardAxes of_a = inwardAxes(a.border_code), of_b = inwardAxes(b.border_code);
  int opposite = 0;
  bool unlike = false;
  for (int n = 0; n < of_a.count; ++n)
    for (int m = 0; m < of_b.count; ++m) {
      const glm::dvec3 inward(of_a.axis[static_cast<size_t>(n)]), other(of_b.axis[static_cast<size_t>(m)]);
      const glm::dvec3 seen = inFrameOf(a.splat, b.splat.factor() * other);
      if (glm::dot(inward, seen) > kOpposite * glm::length(seen)) continue;
      ++opposite;
      if (!of_a.hasFace(n) || !of_b.hasFace(m)) continue;
      // Directions are coded to 0.01 of the cell, which is many times a thin cell's thickness: a joint across
      // such cells would look unlike. Weights are exact, and halves of one face differ in them as in thickness.
      unlike |= isUnlike(thickness(a.splat, inward), thickness(b.splat, other)) &&
                isUnlike(a.splat.weight, b.splat.weight);
    }
  if (opposite == 0) return Neighbourhood::kOther;
  if (opposite > 1) return Neighbourhood::kDiagonal;
  return unlike ? Neighbourhood::kUnlike : Neighbourhood::kLike;
}

/// The group of each part, numbered by its first part: parts on two sides of an unlike joint are in two. All zero if no
/// joint is unlike.
std::vector<size_t> groupsAtJoints(std::span<const SplatWithValues> parts) {
  std::vector<size_t> group(parts.size());
  std::iota(group.begin(), group.end(), size_t{0});
  bool any_unlike = false;
  for (size_t a = 0; a < parts.size(); ++a)
    for (size_t b = a + 1; b < parts.size(); ++b) {
      const Neighbourhood lie = neighbourhood(parts[a].splat, parts[b].splat);
      any_unlike |= lie == Neighbourhood::kUnlike;
      if (lie == Neighbourhood::kUnlike || lie == Neighbourhood::kDiagonal) continue;
      const size_t to = std::min(group[a], group[b]), from = std::max(group[a], group[b]);
      std::replace(group.begin(), group.end(), from, to);
    }
  if (!any_unlike) std::fill(group.begin(), group.end(), size_t{0});
  return group;
}

}  // namespace

MergedParts::MergedParts(const NodeSplat& first, std::span<const SplatScalar> values)
    : origin_(first.node_position),
      lowest_{first, {values.begin(), values.end()}},
      merger_(values.size()),
      bend_(values.size()) {
  add(first, values);
}

void MergedParts::add(const NodeSplat& part, std::span<const SplatScalar> values) {
  nodes_.push_back(part.node);
  merger_.add(part.splat.position, part.splat, values);
  bend_.add(part.splat, part.splat.position - origin_, values);
  borders_.add(part.splat, part.border_code);
  growth_.add(part);
  if (part.node < lowest_.splat.node) lowest_.splat = part;
}

/// Its probes tell of them; those of the other parts tell the same of the same faces.
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
  merger_.finish(merged.splat.splat, merged.values);
  bend_.correct(merged.values);
  const LayeredBorder border = borders_.of(merged.splat.splat, layersOfLowest());
  merged.splat.border_code = border.code;
  merged.splat.layers = border.layers;
  merged.splat.regular = false;
  const JointGrowth::Found growth = growth_.of(merged.splat.splat, lowest_.splat);
  merged.splat.growth_code = growth.code;
  merged.splat.splat.position += merged.splat.splat.factor() * growth.drift;
  for (SplatScalar& value : merged.values) value.mean += glm::dot(value.slope, growth.drift);
  return merged;
}

void JointNodes::add(const NodeSplat& splat, std::span<const SplatScalar> values) {
  if (splat.behind_face) {
    behind_.push_back({splat, {values.begin(), values.end()}});
  } else if (merged_) {
    merged_->add(splat, values);
  } else {
    parts_.push_back({splat, {values.begin(), values.end()}});
    if (parts_.size() > kMaxParts) mergeAll();
  }
}

void JointNodes::mergeAll() {
  merged_ = groups().front();
  parts_.clear();
}

std::vector<MergedParts> JointNodes::groups() const {
  if (merged_) return {*merged_};
  std::vector<size_t> group(parts_.size(), 0);
  if (unlike_ == UnlikeHalves::kApart && parts_.size() <= kMaxParts) group = groupsAtJoints(parts_);
  std::vector<MergedParts> groups;
  std::vector<size_t> place(parts_.size());  // in `groups`, of the group that begins with a part
  for (size_t n = 0; n < parts_.size(); ++n) {
    const SplatWithValues& part = parts_[n];
    if (group[n] == n) {
      place[n] = groups.size();
      groups.emplace_back(part.splat, part.values);
    } else {
      groups[place[group[n]]].add(part.splat, part.values);
    }
  }
  return groups;
}

void JointNodes::finish(const Sink& sink) {
  std::vector<SplatWithValues> merged;
  if (parts_.size() == 1) {
    merged = std::move(parts_);
    sink(merged[0].splat, merged[0].values, {&merged[0].splat.node, 1});
  } else {
    for (const MergedParts& group : groups()) {
      merged.push_back(group.finish());
      sink(merged.back().splat, merged.back().values, group.nodes());
    }
  }
  for (SplatWithValues& behind : behind_) {
    const bool open = std::any_of(merged.begin(), merged.end(), [&](const SplatWithValues& face) {
      return isOpen(face.splat.splat, face.splat.border_code, behind.splat.splat);
    });
    if (!open) behind.splat.border_code = kNoBorder;
    sink(behind.splat, behind.values, {});
  }
}

}  // namespace curvisplat
