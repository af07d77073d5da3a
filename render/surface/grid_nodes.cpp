#include "render/surface/grid_nodes.h"

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <limits>
#include <utility>

#include "stream/model/border_code.h"
#include "stream/model/kernel.h"

namespace curvisplat {
namespace {

// The numbers by which nodes become splats (preprocess/splats/node_splats.h): half the kernel's variance, and how far a bent row counts,
// in cells.
constexpr double kBend = 0.5 * kKernelSigma * kKernelSigma, kMaxBend = 4;
constexpr int kUnbendSteps = 3;

constexpr float kNoValue = std::numeric_limits<float>::quiet_NaN();

/// A splat's node, as far as the splat alone tells: its place and value, but for neighbours', and the scalar's slope in space.
struct FoundNode {
  glm::dvec3 at;
  double value;
  glm::vec3 slope;
};

/// The splat of a whole cell, in place of that of a part.
struct Whole {
  size_t node;
  glm::vec3 at;
  float value;
};

/// `is_part`: the splat is a part of the node's cell, whose border code does not tell where the node is.
FoundNode nodeOf(const SplatGeometry& g, const SplatVariable& v, size_t n, bool is_part) {
  const double a0 = g.axis0[n], a1 = g.axis1[n], a2 = g.axis2[n];
  const double l10 = g.shear10[n], l20 = g.shear20[n], l21 = g.shear21[n];
  const glm::dvec3 w(v.slope0[n], v.slope1[n], v.slope2[n]);
  FoundNode node{{g.x[n], g.y[n], g.z[n]}, v.mean[n], glm::vec3(0.0f)};
  const double z = w.z / a2, y = w.y / a1 - l21 * z, x = w.x / a0 - l10 * y - l20 * z;  // A⁻ᵀ w
  const glm::vec3 slope(x, y, z);
  if (std::isfinite(slope.x) && std::isfinite(slope.y) && std::isfinite(slope.z)) node.slope = slope;
  if (is_part) return node;
  const InwardAxes inward = inwardAxes(g.border_code[n]);
  if (inward.behind || inward.plate || inward.ratio > 0) return node;
  glm::dvec3 q(0.0);
  for (int axis = 0; axis < inward.count; ++axis) q += glm::dvec3(inward.axis[static_cast<size_t>(axis)]);
  q *= 0.5;
  node.at -= glm::dvec3(a0 * q.x, a0 * l10 * q.x + a1 * q.y, a0 * l20 * q.x + a1 * l21 * q.y + a2 * q.z);
  node.value -= glm::dot(w, q);
  return node;
}

/// The neighbours of a node along an axis; the node itself where there is none.
struct AlongAxis {
  glm::dvec3 before, after;
  bool whole;
};

/// The way that a node's splat was moved, and what its mean was corrected for, from where splats are around it.
struct Moved {
  glm::dvec3 shift{0.0}, bend{0.0};
};

/// The largest component of J⁻¹-like A⁻¹ v, where A is the lower triangle with A Aᵀ = J Jᵀ; 0 where a cell is collapsed.
double largestInFrame(const std::array<glm::dvec3, 3>& columns, const glm::dvec3& v) {
  glm::dvec3 rows[3];
  for (int r = 0; r < 3; ++r) rows[r] = {columns[0][r], columns[1][r], columns[2][r]};
  const double a00 = glm::length(rows[0]);
  const glm::dvec3 e0 = rows[0] / a00;
  const double a10 = glm::dot(rows[1], e0), a20 = glm::dot(rows[2], e0);
  const glm::dvec3 rest = rows[1] - a10 * e0;
  const double a11 = glm::length(rest);
  const glm::dvec3 e1 = rest / a11;
  const double a21 = glm::dot(rows[2], e1), a22 = glm::length(rows[2] - a20 * e0 - a21 * e1);
  const double u0 = v.x / a00, u1 = (v.y - a10 * u0) / a11, u2 = (v.z - a20 * u0 - a21 * u1) / a22;
  const double largest = std::max({std::abs(u0), std::abs(u1), std::abs(u2)});
  return std::isfinite(largest) ? largest : 0;
}

Moved movedBy(const glm::dvec3& here, const std::array<AlongAxis, 3>& axes) {
  Moved moved;
  std::array<glm::dvec3, 3> columns;
  for (size_t n = 0; n < 3; ++n) {
    const AlongAxis& axis = axes[n];
    columns[n] = 0.5 * (axis.after - axis.before);
    if (!axis.whole) continue;
    const glm::dvec3 to_before = here - axis.before, to_after = axis.after - here;
    const double a = glm::length(to_before), b = glm::length(to_after);
    if (!(a + b > 0)) continue;
    const double share = a / (a + b);
    moved.shift += 0.5 * (b - a) / (a + b) * columns[n] + 0.25 * (share * to_after - (1 - share) * to_before);
    moved.bend += to_after - to_before;
  }
  if (moved.bend != glm::dvec3(0.0)) {
    const double bent = largestInFrame(columns, moved.bend);
    moved.bend *= kMaxBend / std::max(kMaxBend, bent);
  }
  return moved;
}

/// The nodes without a splat of their own that are not blanked.
uint64_t joinedNodes(const Manifest& manifest) {
  return manifest.nodes - manifest.blanked_nodes - manifest.splats;
}

}  // namespace

bool GridNodes::canBeOf(const Manifest& manifest) {
  if (manifest.cells || !manifest.hasDualCells() || manifest.overlap == kOverlapOwner) return false;
  if (manifest.nodes > kMaxNodes || manifest.blanked_nodes > manifest.nodes) return false;
  if (manifest.splats > manifest.nodes - manifest.blanked_nodes) return false;
  uint64_t nodes = 0;
  for (const BlockInfo& block : manifest.blocks) {
    if (std::min({block.ni, block.nj, block.nk}) < 2) return false;
    if (std::max({block.ni, block.nj, block.nk}) > kMaxNodes) return false;
    if (block.ni * block.nj > kMaxNodes || block.ni * block.nj * block.nk > kMaxNodes) return false;
    nodes += block.ni * block.nj * block.nk;
  }
  return !manifest.blocks.empty() && nodes == manifest.nodes;
}

GridNodes::Bytes GridNodes::bytes(const Manifest& manifest, bool two_scalars) {
  const uint64_t joined = sizeof(JoinedNode) * joinedNodes(manifest);
  const uint64_t marks = manifest.blanked_nodes > 0 ? manifest.nodes : 0;
  // Where nodes share a splat, their gradients need to know whose (NodeGradients).
  const uint64_t shared = joined > 0 ? sizeof(uint32_t) * manifest.nodes + joined : 0;
  const uint64_t kept = manifest.nodes * sizeof(float) * (two_scalars ? 5 : 4) + joined + marks;
  uint64_t more = manifest.nodes * 3 * sizeof(float);
  uint64_t of_plane = 0, largest = 0;
  for (const BlockInfo& block : manifest.blocks) {
    of_plane = std::max(of_plane, block.ni * block.nj);
    largest = std::max(largest, block.ni * block.nj * block.nk);
    if (joined > 0) more += joinBytes({{block.ni, block.nj, block.nk}, 0});
  }
  if (manifest.blanked_nodes > 0) more += 2 * sizeof(Whole) * largest;  // as their array doubles
  return {kept + more + 2 * sizeof(glm::vec3) * of_plane, kept, shared};
}

void GridNodes::Slopes::resize(size_t count) {
  for (std::vector<float>* part : {&x, &y, &z}) part->resize(count);
}

GridNodes::GridNodes(const CacheReader& cache, size_t variable, std::optional<size_t> other, bool keep_going,
                     const std::function<void()>& throw_if_stopped)
    : origin_(0.5 * (cache.manifest().lower + cache.manifest().upper)),
      has_parts_(cache.manifest().hasFeature(kCellOctants)),
      keep_going_(keep_going) {
  size_t first = 0;
  for (const BlockInfo& block : cache.manifest().blocks) {
    blocks_.push_back({{block.ni, block.nj, block.nk}, first});
    first += blocks_.back().nodes();
  }
  for (std::vector<float>* part : {&x_, &y_, &z_, &value_}) part->resize(first);
  if (other) {
    read(cache, *other, throw_if_stopped);
    other_ = value_;
  }
  read(cache, variable, throw_if_stopped);
  slopes_ = {};
}

void GridNodes::read(const CacheReader& cache, size_t variable, const Stop& throw_if_stopped) {
  const Manifest& manifest = cache.manifest();
  slopes_.resize(value_.size());
  readLeaves(cache, variable, throw_if_stopped);
  if (!complete_ || !join(manifest, throw_if_stopped)) return;
  if (manifest.blanked_nodes > 0 && !hasBlanks()) {
    markBlanks();
    readLeaves(cache, variable, throw_if_stopped);
    if (!complete_ || !join(manifest, throw_if_stopped)) return;
  }
  const VariableInfo& info = manifest.variables[variable];
  const auto least = static_cast<float>(info.min), most = static_cast<float>(info.max);
  if (hasBlanks() && has_parts_)
    for (const Block& block : blocks_) completeParts(block);
  for (const Block& block : blocks_) moveToNodes(block);
  for (const Block& block : blocks_) unbend(block, least, most);
  copyToJoined();
}

void GridNodes::readLeaves(const CacheReader& cache, size_t variable, const Stop& throw_if_stopped) {
  std::fill(value_.begin(), value_.end(), kNoValue);
  SplatGeometry geometry;
  SplatVariable values;
  std::vector<NodeRun> runs;
  for (uint32_t brick = 0; brick < cache.bricks().size(); ++brick) {
    if (!cache.bricks()[brick].isLeaf()) continue;
    throw_if_stopped();
    try {
      cache.readGeometry(brick, geometry, &runs);
      cache.readVariable(brick, variable, values);
      addLeaf(cache, brick, geometry, values, runs);
    } catch (const DamagedBrick& error) {
      if (!keep_going_) throw;
      damaged_.emplace(brick, error.what());
    }
  }
  complete_ = damaged_.empty();
}

/// Gives nodes that share a splat its place, value and slope. Returns false if they are not found.
bool GridNodes::join(const Manifest& manifest, const Stop& throw_if_stopped) {
  if (joined_.empty()) {
    std::vector<uint8_t> is_there(value_.size());
    for (size_t node = 0; node < value_.size(); ++node) is_there[node] = !std::isnan(value_[node]);
    complete_ = static_cast<uint64_t>(std::count(is_there.begin(), is_there.end(), 1)) == manifest.splats;
    if (!complete_) return false;
    auto joined = findJoinedNodes(
        blocks_, is_there, joinedNodes(manifest), [&](size_t node) { return glm::dvec3(position(node)); },
        throw_if_stopped);
    complete_ = joined.has_value();
    if (joined) joined_ = *std::move(joined);
  }
  copyToJoined();
  return complete_;
}

void GridNodes::copyToJoined() {
  for (const auto& [node, same] : joined_)
    for (std::vector<float>* part : {&x_, &y_, &z_, &value_, &slopes_.x, &slopes_.y, &slopes_.z})
      (*part)[node] = (*part)[same];
}

void GridNodes::markBlanks() {
  marks_.resize(value_.size());
  for (size_t node = 0; node < value_.size(); ++node) marks_[node] = std::isnan(value_[node]) ? kBlank : 0;
  for (const auto& [node, same] : joined_) marks_[node] = marks_[same] = kShared;
}

GridNodes::OfAxes GridNodes::neighbours(const Block& block, size_t node, const Index& index) const {
  OfAxes of_axes;
  for (size_t axis = 0; axis < 3; ++axis) {
    const size_t stride = block.stride(axis);
    of_axes[axis] = {index[axis] > 0 && !isBlank(node - stride) ? node - stride : node,
                     index[axis] + 1 < block.size[axis] && !isBlank(node + stride) ? node + stride : node};
  }
  return of_axes;
}

GridNodes::OfAxes GridNodes::neighbours(const Block& block, size_t node) const {
  Index index;
  for (size_t axis = 0; axis < 3; ++axis)
    index[axis] = (node - block.first) / block.stride(axis) % block.size[axis];
  return neighbours(block, node, index);
}

/// The middle of what is left of a node's cell beside cells with a blanked corner, in cells from the middle of it all; none if nothing is
/// missing. As preprocess/splats/node_splats.cpp has it: along an axis with one neighbour, both halves are towards that one. Where blocks
/// meet, the splat has parts of several cells; it is taken for a whole one.
std::optional<glm::dvec3> GridNodes::middleOfPart(const Block& block, size_t node) const {
  if (!has_parts_ || !hasBlanks() || marks_[node] != 0) return std::nullopt;
  const OfAxes axes = neighbours(block, node);
  glm::dvec3 sum(0.0);
  int left = 0;
  for (unsigned octant = 0; octant < 8; ++octant) {
    std::array<size_t, 3> step{};  // wraps around below the node
    glm::dvec3 at;
    for (size_t axis = 0; axis < 3; ++axis) {
      const bool is_below = (octant >> axis & 1) != 0;
      const auto& [before, after] = axes[axis];
      step[axis] = ((is_below && before != node) || after == node ? before : after) - node;
      at[static_cast<int>(axis)] = is_below ? -0.25 : 0.25;
    }
    const auto& [i, j, k] = step;
    if (isBlank(node + i + j) || isBlank(node + i + k) || isBlank(node + j + k) || isBlank(node + i + j + k))
      continue;
    sum += at;
    ++left;
  }
  if (left == 0 || left == 8) return std::nullopt;
  return sum / static_cast<double>(left);
}

void GridNodes::addLeaf(const CacheReader& cache, uint32_t brick, const SplatGeometry& geometry,
                        const SplatVariable& values, const std::vector<NodeRun>& runs) {
  const glm::dvec3 lowest = cache.manifest().root.cellMin(cache.bricks()[brick].cell) - origin_;
  size_t splat = 0;
  for (const NodeRun& run : runs) {
    const bool is_inside = run.block < blocks_.size() && run.i < blocks_[run.block].size[0] &&
                           run.count <= blocks_[run.block].size[0] - run.i &&
                           run.j < blocks_[run.block].size[1] && run.k < blocks_[run.block].size[2] &&
                           run.count <= geometry.size() - splat;
    if (!is_inside)
      throw DamagedBrick("{}: brick {}: has nodes outside of the grid; the file is damaged: convert again",
                         cache.geometryPath().string(), brick);
    const Block& block = blocks_[run.block];
    size_t node = block.first + static_cast<size_t>((run.k * block.size[1] + run.j) * block.size[0] + run.i);
    for (uint64_t n = 0; n < run.count; ++n, ++node, ++splat) {
      const FoundNode found = nodeOf(geometry, values, splat, middleOfPart(block, node).has_value());
      x_[node] = static_cast<float>(lowest.x + found.at.x);
      y_[node] = static_cast<float>(lowest.y + found.at.y);
      z_[node] = static_cast<float>(lowest.z + found.at.z);
      value_[node] = static_cast<float>(found.value);
      slopes_.x[node] = found.slope.x;
      slopes_.y[node] = found.slope.y;
      slopes_.z[node] = found.slope.z;
    }
  }
}

/// Moves what is left of cells beside blanked ones to where the splats of the whole cells would be: along axes with one neighbour at the
/// node, else in the cell's middle. All are found before any is moved, so that their order does not matter.
void GridNodes::completeParts(const Block& block) {
  std::vector<Whole> found;
  forNodes(block, [&](size_t node, const OfAxes& axes) {
    const auto middle = middleOfPart(block, node);
    if (!middle) return;
    const glm::dvec3 at(position(node));
    glm::dvec3 whole = at;
    double of_node = 1;
    for (int n = 0; n < 3; ++n) {
      const auto& [before, after] = axes[static_cast<size_t>(n)];
      if (before != node && after != node) {
        whole -= 0.5 * (*middle)[n] * glm::dvec3(position(after) - position(before));
      } else if (before != after) {
        // A quarter of the way to the neighbour.
        whole -= 0.25 * glm::dvec3(position(before != node ? before : after));
        of_node -= 0.25;
      }
    }
    whole /= of_node;
    const double value =
        value_[node] + glm::dot(glm::dvec3(slopes_.x[node], slopes_.y[node], slopes_.z[node]), whole - at);
    found.push_back(
        {node, glm::vec3(whole), std::isfinite(value) ? static_cast<float>(value) : value_[node]});
  });
  for (const Whole& whole : found) {
    x_[whole.node] = whole.at.x;
    y_[whole.node] = whole.at.y;
    z_[whole.node] = whole.at.z;
    value_[whole.node] = whole.value;
  }
}

/// Moves positions from the middles of cells to the nodes, and values with them; adds what bent coordinates have taken from means.
void GridNodes::moveToNodes(const Block& block) {
  const size_t ni = block.size[0], nj = block.size[1], nk = block.size[2], plane = ni * nj;
  // The last plane and this one as they were.
  std::vector<glm::vec3> last(plane), here(plane);
  for (size_t k = 0; k < nk; ++k) {
    const size_t first = block.first + k * plane;
    last.swap(here);
    for (size_t n = 0; n < plane; ++n) here[n] = position(first + n);
    for (size_t j = 0; j < nj; ++j)
      for (size_t i = 0; i < ni; ++i) {
        const size_t n = j * ni + i, node = first + n;
        if (isBlank(node)) continue;
        const OfAxes beside = neighbours(block, node, {i, j, k});
        const auto placeOf = [&](size_t other) {
          if (other >= first + plane) return glm::dvec3(position(other));
          return glm::dvec3(other < first ? last[n] : here[other - first]);
        };
        std::array<AlongAxis, 3> axes;
        for (size_t axis = 0; axis < 3; ++axis)
          axes[axis] = {placeOf(beside[axis].before), placeOf(beside[axis].after),
                        beside[axis].areBoth(node)};
        const Moved moved = movedBy(glm::dvec3(here[n]), axes);
        const glm::dvec3 slope(slopes_.x[node], slopes_.y[node], slopes_.z[node]);
        const glm::dvec3 to = glm::dvec3(here[n]) - moved.shift;
        const double value = value_[node] + glm::dot(slope, kBend * moved.bend - moved.shift);
        x_[node] = static_cast<float>(to.x);
        y_[node] = static_cast<float>(to.y);
        z_[node] = static_cast<float>(to.z);
        if (std::isfinite(value)) value_[node] = static_cast<float>(value);
      }
  }
}

/// Takes the correction for the scalar's bend out of the values: a mean has f + kBend Σ (f₊ - 2f + f₋). Some steps of a fixed point: more
/// would make the rounding of what alternates from node to node larger, which the means hardly have. By least squares with the slopes,
/// errors of the slopes of thin cells became larger than what was to be corrected.
void GridNodes::unbend(const Block& block, float least, float most) {
  const auto begin = static_cast<std::ptrdiff_t>(block.first);
  const auto end = begin + static_cast<std::ptrdiff_t>(block.nodes());
  std::vector<float>& means = slopes_.x;  // slopes have done their part
  std::vector<float>& next = slopes_.y;
  std::copy(value_.begin() + begin, value_.begin() + end, means.begin() + begin);
  for (int step = 0; step < kUnbendSteps; ++step) {
    forNodes(block, [&](size_t node, const OfAxes& axes) {
      float second = 0;
      for (const Neighbours& axis : axes)
        if (axis.areBoth(node))
          second += (value_[axis.after] - value_[node]) - (value_[node] - value_[axis.before]);
      next[node] = std::clamp(means[node] - static_cast<float>(kBend) * second, least, most);
    });
    std::copy(next.begin() + begin, next.begin() + end, value_.begin() + begin);
  }
}

/// Calls use(node, neighbours) for the nodes of a block that are there, in order.
template <typename Use>
void GridNodes::forNodes(const Block& block, const Use& use) const {
  size_t node = block.first;
  for (uint64_t k = 0; k < block.size[2]; ++k)
    for (uint64_t j = 0; j < block.size[1]; ++j)
      for (uint64_t i = 0; i < block.size[0]; ++i, ++node)
        if (!isBlank(node)) use(node, neighbours(block, node, {i, j, k}));
}

}  // namespace curvisplat
