#include "preprocess/seams/joined_rows.h"

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <utility>

#include "preprocess/shape/shape.h"
#include "preprocess/splats/inner_nodes.h"

namespace curvisplat {

void JoinedRows::clear() {
  parts_ = lines_ = 0;
  fits_ = true;
  line_ = {};
  across_ = glm::dmat3(0.0);
  weight_ = 0;
  offset_ = plain_offset_ = glm::dvec3(0.0);
  std::fill(scalars_.begin(), scalars_.end(), ScalarSums());
}

std::pair<size_t, size_t> JoinedRows::lineAlong(const glm::dvec3& normal) {
  constexpr double kAlong = 0.7;  // cosine
  if (parts_ == 0 && lines_ < kMaxLines) {
    line_[lines_].normal = normal;
    return {lines_++, 0};
  }
  size_t found = 0;
  for (size_t n = 1; n < lines_; ++n)
    if (std::abs(glm::dot(line_[n].normal, normal)) > std::abs(glm::dot(line_[found].normal, normal)))
      found = n;
  const double along = lines_ > 0 ? glm::dot(line_[found].normal, normal) : 0.0;
  if (!(std::abs(along) > kAlong)) fits_ = false;
  return {found, along < 0};
}

void JoinedRows::add(const Part& part, std::span<const JointSide> sides) {
  const Splat& splat = part.node.splat;
  const glm::dmat3 a = splat.factor();
  if (parts_ > 0 && sides.size() != lines_) fits_ = false;
  if (sides.empty() || sides.size() > kMaxLines) fits_ = false;
  if (!fits_) return;

  // The columns that are not cut: all but the sides'.
  glm::dmat3 uncut(1.0);
  for (const JointSide& side : sides) uncut -= glm::outerProduct(side.inward, side.inward);
  const glm::dmat3 across = a * uncut;
  across_ += across * glm::transpose(across);
  const double weight = splat.weight;
  weight_ += weight;
  offset_ += weight * part.offset;
  plain_offset_ += part.offset;
  for (size_t v = 0; v < scalars_.size(); ++v) {
    ScalarSums& sums = scalars_[v];
    sums.across += across * (uncut * part.values[v].slope);
    const double mean = part.unstretched[v].mean;
    sums.mean += weight * mean;
    sums.plain_mean += mean;
    if (parts_ == 0) sums.least = sums.most = mean;
    sums.least = std::min(sums.least, mean);
    sums.most = std::max(sums.most, mean);
  }
  for (const JointSide& side : sides) {
    const auto [line, half] = lineAlong(glm::normalize(gradientOf(splat, side.inward)));
    Half& to = line_[line].halves[half];
    ++to.count;
    to.column += side.unstretch * (a * side.inward);
    for (size_t v = 0; v < scalars_.size(); ++v) {
      ScalarSums& sums = scalars_[v];
      const double change = side.unstretch * glm::dot(part.values[v].slope, side.inward);
      sums.change[line][half] += change;
      // The part's mean is half of that away from the node's value.
      const double at_node = part.unstretched[v].mean - 0.5 * change;
      sums.least = std::min(sums.least, at_node);
      sums.most = std::max(sums.most, at_node);
    }
  }
  ++parts_;
}

bool JoinedRows::goOn() const {
  if (!fits_ || lines_ == 0 || parts_ != size_t{1} << lines_) return false;
  return std::all_of(line_.begin(), line_.begin() + static_cast<ptrdiff_t>(lines_),
                     [&](const Line& line) { return line.halves[0].count == line.halves[1].count; });
}

void JoinedRows::finish(const glm::dvec3& node, Splat& splat, std::span<SplatScalar> values) const {
  const auto parts = static_cast<double>(parts_);
  glm::dmat3 s = across_ / parts;
  glm::dvec3 aside(0.0), bend(0.0);
  std::array<double, kMaxLines> share{};  // of the length, of the other half
  for (size_t n = 0; n < lines_; ++n) {
    const glm::dvec3 column = line_[n].column();
    s += glm::outerProduct(column, column);
    const std::array<Half, 2>& halves = line_[n].halves;
    const glm::dvec3 one = halves[0].column / halves[0].count, other = halves[1].column / halves[1].count;
    const double length = glm::length(one) + glm::length(other);
    share[n] = length > 0 ? glm::length(other) / length : 0.5;
    aside += 0.5 * (share[n] * one + (1 - share[n]) * other);
    bend += 2.0 * (one + other);
  }
  splat.weight = weight_;
  splat.position = node + (weight_ > 0 ? offset_ / weight_ : plain_offset_ / parts);
  const double size = glm::length(s[0]) + glm::length(s[1]) + glm::length(s[2]);
  setShape(splat, {s[0].x, s[0].y, s[1].y, s[0].z, s[1].z, s[2].z}, std::sqrt(size) * kAxisFloor);
  const glm::dvec3 bent = glm::abs(inFrameOf(splat, bend));
  const double follows = kMaxBend / std::max(kMaxBend, std::max(std::max(bent.x, bent.y), bent.z));
  const glm::dvec3 aside_in_cells = follows * inFrameOf(splat, aside);
  for (size_t v = 0; v < scalars_.size(); ++v) {
    const ScalarSums& sums = scalars_[v];
    glm::dvec3 h = sums.across / parts;
    double eighth = 0;  // of the scalar's second differences, where halves are equally long
    for (size_t n = 0; n < lines_; ++n) {
      const double one = sums.change[n][0] / line_[n].halves[0].count,
                   other = sums.change[n][1] / line_[n].halves[1].count;
      h += (one - other) * line_[n].column();
      eighth += 0.5 * (share[n] * one + (1 - share[n]) * other);
    }
    SplatScalar& value = values[v];
    value.slope = inFrameOf(splat, h);
    value.variance = 0;
    // Whole cells' means follow the slope to their middles, and a tenth of the rest of the bend (node_splats.h).
    const double mean = weight_ > 0 ? sums.mean / weight_ : sums.plain_mean / parts;
    value.mean = std::clamp(mean - (1 - 8 * kBend) * (eighth - glm::dot(value.slope, aside_in_cells)),
                            sums.least, sums.most);
  }
}

glm::dvec3 JoinedRows::inFrame(const Splat& whole, const Splat& part, std::span<const JointSide> sides,
                               const glm::dvec3& direction) const {
  glm::dvec3 uncut = direction, sum(0.0);
  for (const JointSide& side : sides) {
    const double along = glm::dot(side.inward, direction);
    uncut -= along * side.inward;
    const glm::dvec3 normal = gradientOf(part, side.inward);
    size_t found = 0;
    for (size_t n = 1; n < lines_; ++n)
      if (std::abs(glm::dot(line_[n].normal, normal)) > std::abs(glm::dot(line_[found].normal, normal)))
        found = n;
    const glm::dvec3 column = line_[found].column();
    sum += along * (glm::dot(line_[found].normal, normal) < 0 ? -1.0 : 1.0) * inFrameOf(whole, column);
  }
  return glm::normalize(sum + inFrameOf(whole, part.factor() * uncut));
}

}  // namespace curvisplat
