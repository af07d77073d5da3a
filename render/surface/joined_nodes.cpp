#include "render/surface/joined_nodes.h"

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>
#include <limits>
#include <map>
#include <set>
#include <tuple>
#include <utility>

#include "render/surface/node_tree.h"

namespace curvisplat {
namespace {

constexpr size_t kVoters = 128;         // of a face
constexpr int kMaxRounds = 32;          // maps of a face
constexpr uint64_t kMaxCompared = 2e8;  // nodes
constexpr double kNear = 1.5;           // cells, between where a node is expected and a candidate
constexpr double kMaxAside = 1;         // lengths of the last cell, between there and where the majority says
constexpr uint32_t kNoSplat = std::numeric_limits<uint32_t>::max();

/// A face of a block.
struct BlockFace {
  size_t block, axis;
  bool at_end;

  size_t u() const { return axis == 0 ? 1 : 0; }
  size_t v() const { return axis == 2 ? 1 : 2; }
  bool operator<(const BlockFace& other) const {
    return std::tie(block, axis, at_end) < std::tie(other.block, other.axis, other.at_end);
  }
};

using Index = std::array<int64_t, 3>;
using Place = std::array<int64_t, 2>;  // on a face, along u and v

/// One coordinate on a face by those on another: sign * place[of] + offset, or the offset alone.
struct MappedAxis {
  int of = 0, sign = 0;  // sign 0: collapsed
  int64_t offset = 0;

  int64_t at(const Place& place) const { return sign * place[static_cast<size_t>(of)] + offset; }
  bool operator<(const MappedAxis& other) const {
    return std::tie(of, sign, offset) < std::tie(other.of, other.sign, other.offset);
  }
};
/// How the lattice of a face lies on another.
struct FaceMap {
  BlockFace to;
  std::array<MappedAxis, 2> along;

  bool operator<(const FaceMap& other) const { return std::tie(to, along) < std::tie(other.to, other.along); }
};

/// A place where a node is expected, and the cell there: across the face, along u and v.
struct Expected {
  glm::dvec3 at;
  glm::dmat3 cell;
};
/// A node of a face that is looked for.
struct Missing {
  Place place;
  Expected expected;
  glm::dmat3 in_cells;  // the inverse of its cell
};

class Joiner {
 public:
  Joiner(std::span<const NodeLattice3> blocks, std::span<const uint8_t> is_there,
         const std::function<glm::dvec3(size_t node)>& at, const std::function<void()>& throw_if_stopped)
      : blocks_(blocks),
        is_there_(is_there),
        at_(at),
        throw_if_stopped_(throw_if_stopped),
        same_(is_there.size(), kNoSplat) {
    for (size_t block = 0; block < blocks.size(); ++block)
      for (size_t axis = 0; axis < 3; ++axis)
        for (const bool at_end : {false, true}) faces_.push_back({block, axis, at_end});
    std::vector<NodeTree::Point> candidates;
    for (const BlockFace& face : faces_)
      forFace(face, [&](const Place& place, size_t node) {
        if (is_there_[node] && isFirstFaceOf(face, place))
          candidates.push_back({at_(node), static_cast<uint32_t>(node)});
      });
    candidates_ = NodeTree(std::move(candidates));
  }

  std::optional<std::vector<JoinedNode>> find(uint64_t count) {
    const bool has_blanks = static_cast<uint64_t>(std::count(is_there_.begin(), is_there_.end(), 0)) != count;
    auto left = static_cast<int64_t>(count);
    // What a face finds may tell the next one where its nodes are expected.
    for (bool any = true; any && left > 0;) {
      any = false;
      for (const BlockFace& face : faces_)
        for (int round = 0; round < kMaxRounds; ++round) {
          const size_t found = joinFace(face);
          left -= static_cast<int64_t>(found);
          any = any || found > 0;
          if (found == 0) break;
        }
      if (compared_ > kMaxCompared) break;
    }
    if (left > 0) left -= static_cast<int64_t>(has_blanks ? joinBesideBlanks() : joinBesideJoined());
    if (left != 0) return std::nullopt;
    std::vector<JoinedNode> joined;
    for (size_t node = 0; node < same_.size(); ++node)
      if (same_[node] != kNoSplat) joined.push_back({static_cast<uint32_t>(node), same_[node]});
    return joined;
  }

 private:
  template <typename Use>
  void forFace(const BlockFace& face, const Use& use) const {
    const NodeLattice3& block = blocks_[face.block];
    for (uint64_t v = 0; v < block.size[face.v()]; ++v)
      for (uint64_t u = 0; u < block.size[face.u()]; ++u) {
        const Place place{static_cast<int64_t>(u), static_cast<int64_t>(v)};
        use(place, *nodeAt(face, place));
      }
  }
  std::optional<size_t> nodeAt(const BlockFace& face, const Place& place) const {
    const NodeLattice3& block = blocks_[face.block];
    Index index{};
    index[face.axis] = face.at_end ? static_cast<int64_t>(block.size[face.axis]) - 1 : 0;
    index[face.u()] = place[0];
    index[face.v()] = place[1];
    size_t node = block.first;
    for (size_t axis = 0; axis < 3; ++axis) {
      if (index[axis] < 0 || index[axis] >= static_cast<int64_t>(block.size[axis])) return std::nullopt;
      node += static_cast<size_t>(index[axis]) * block.stride(axis);
    }
    return node;
  }
  /// Whether a node on several faces is counted with this one.
  bool isFirstFaceOf(const BlockFace& face, const Place& place) const {
    const size_t node = *nodeAt(face, place);
    for (const BlockFace& other : std::span(faces_).subspan(6 * face.block, 6)) {
      if (!(other < face)) return true;
      if (placeOn(other, node)) return false;
    }
    return true;
  }
  bool isKnown(size_t node) const { return is_there_[node] || same_[node] != kNoSplat; }
  glm::dvec3 at(size_t node) const { return at_(is_there_[node] ? node : same_[node]); }

  /// Finds where the node at a place of a face is expected, by the two behind it and those beside them.
  std::optional<Expected> expected(const BlockFace& face, const Place& place) const {
    const NodeLattice3& block = blocks_[face.block];
    if (block.size[face.axis] < 3) return std::nullopt;
    const size_t node = *nodeAt(face, place), step = block.stride(face.axis);
    const auto behind = [&](size_t n) { return face.at_end ? node - n * step : node + n * step; };
    if (!isKnown(behind(1)) || !isKnown(behind(2))) return std::nullopt;
    const glm::dvec3 first = at(behind(1)), across = first - at(behind(2));
    Expected out{first + across, glm::dmat3(across, glm::dvec3(0.0), glm::dvec3(0.0))};
    for (size_t n = 0; n < 2; ++n) {
      const size_t axis = n == 0 ? face.u() : face.v(), beside = block.stride(axis);
      const bool before = place[n] > 0 && isKnown(behind(1) - beside);
      const bool after = place[n] + 1 < static_cast<int64_t>(block.size[axis]) && isKnown(behind(1) + beside);
      if (!before && !after) return std::nullopt;
      const glm::dvec3 from = before ? at(behind(1) - beside) : first;
      out.cell[static_cast<int>(n) + 1] =
          (after ? at(behind(1) + beside) - from : first - from) * (before && after ? 0.5 : 1.0);
    }
    return out;
  }

  /// A grid line's last cell may be longer or shorter; beside it, half a cell is another node.
  static double lengthOf(const glm::dvec3& in_cells) {
    return std::max({std::abs(in_cells.x), 2 * std::abs(in_cells.y), 2 * std::abs(in_cells.z)});
  }
  /// Measures a way as lengthOf() does, but in lengths of the last cell along axes of thinner cells: the splat of a collapsed line,
  /// which half a disc shares, lies many of these thin cells beside the line.
  static double lengthAcross(const Missing& missing, const glm::dvec3& way) {
    const glm::dvec3 in_cells = missing.in_cells * way;
    const glm::dmat3& cell = missing.expected.cell;
    double length = std::abs(in_cells.x);
    for (int n = 1; n < 3; ++n)
      length = std::max(length,
                        std::abs(in_cells[n]) *
                            std::min(2.0, kNear / kMaxAside * glm::length(cell[n]) / glm::length(cell[0])));
    return length;
  }
  /// The candidate nearest to there, in cells; else across.
  std::optional<size_t> nearest(const Missing& missing) {
    const Expected& expected = missing.expected;
    const glm::dvec3 reach =
        kNear * (glm::abs(expected.cell[0]) + glm::abs(expected.cell[1]) + glm::abs(expected.cell[2]));
    std::optional<size_t> best, across;
    double least = kNear, least_across = kNear;
    compared_ +=
        candidates_.forBox(expected.at - reach, expected.at + reach, [&](const NodeTree::Point& candidate) {
          const glm::dvec3 way = candidate.at - expected.at;
          const double distance = lengthOf(missing.in_cells * way),
                       distance_across = lengthAcross(missing, way);
          if (distance < least) least = distance, best = candidate.number;
          if (distance_across < least_across) least_across = distance_across, across = candidate.number;
        });
    return best ? best : across;
  }

  /// Finds nodes of a face by one map; how many.
  size_t joinFace(const BlockFace& face) {
    throw_if_stopped_();
    std::vector<Missing> missing;
    forFace(face, [&](const Place& place, size_t node) {
      if (isKnown(node)) return;
      if (const auto there = expected(face, place))
        missing.push_back({place, *there, glm::inverse(there->cell)});
    });
    if (missing.empty() || compared_ > kMaxCompared) return 0;
    std::map<FaceMap, size_t> votes;
    const size_t step = std::max<size_t>(1, missing.size() / kVoters);
    for (size_t n = 0; n < missing.size(); n += step)
      if (const auto node = nearest(missing[n])) vote(missing[n].place, *node, votes);
    const Taken best = bestOf(face, missing, mapsFor(face, votes));
    for (const auto& [node, same] : best.nodes) same_[node] = static_cast<uint32_t>(same);
    if (!best.nodes.empty()) maps_.emplace_back(face, best.map);
    return best.nodes.size();
  }
  /// Finds nodes that nothing tells where to expect, since blanked ones lie behind them: by the maps of the others on their faces.
  size_t joinBesideBlanks() {
    size_t found = 0;
    for (const auto& face_and_map : maps_) {
      const BlockFace& face = face_and_map.first;
      const FaceMap& map = face_and_map.second;
      if (collapsed(map) != 0) continue;
      forFace(face, [&](const Place& place, size_t node) {
        const auto to = nodeAt(map.to, {map.along[0].at(place), map.along[1].at(place)});
        if (isKnown(node) || !to || !is_there_[*to] || expected(face, place)) return;
        same_[node] = static_cast<uint32_t>(*to);
        ++found;
      });
    }
    return found;
  }

  /// Finds nodes that share a splat which lies far from them, as where a collapsed line ends: by the maps of those beside them.
  size_t joinBesideJoined() {
    size_t found = 0;
    for (const auto& face_and_map : maps_) {
      const BlockFace& face = face_and_map.first;
      const FaceMap& map = face_and_map.second;
      const auto mapped = [&](const Place& place) {
        return nodeAt(map.to, {map.along[0].at(place), map.along[1].at(place)});
      };
      const auto is_joined = [&](const Place& place) {
        const auto node = nodeAt(face, place), to = mapped(place);
        return node && to && same_[*node] == *to;
      };
      forFace(face, [&](const Place& place, size_t node) {
        const auto [u, v] = place;
        const auto to = mapped(place);
        if (isKnown(node) || !to || !is_there_[*to]) return;
        if (!is_joined({u - 1, v}) && !is_joined({u + 1, v}) && !is_joined({u, v - 1}) &&
            !is_joined({u, v + 1}))
          return;
        same_[node] = static_cast<uint32_t>(*to);
        ++found;
      });
    }
    return found;
  }

  /// The maps with the most votes, and those that lay whole faces on one another: where cells are thin and grid lines bend, the
  /// nearest node is not the one that is meant.
  std::vector<FaceMap> mapsFor(const BlockFace& face, const std::map<FaceMap, size_t>& votes) const {
    constexpr size_t kMaxVoted = 4;
    std::vector<std::pair<FaceMap, size_t>> sorted(votes.begin(), votes.end());
    std::stable_sort(sorted.begin(), sorted.end(),
                     [](const auto& a, const auto& b) { return a.second > b.second; });
    std::vector<FaceMap> maps;
    std::set<BlockFace> onto{face, {face.block, face.axis, !face.at_end}};
    for (size_t n = 0; n < std::min(sorted.size(), kMaxVoted); ++n) {
      maps.push_back(sorted[n].first);
      onto.insert(sorted[n].first.to);
    }
    for (const BlockFace& to : onto) addWhole(to, maps);
    return maps;
  }
  void addWhole(const BlockFace& to, std::vector<FaceMap>& maps) const {
    const auto& size = blocks_[to.block].size;
    const auto last_u = static_cast<int64_t>(size[to.u()]) - 1,
               last_v = static_cast<int64_t>(size[to.v()]) - 1;
    for (const int of : {0, 1})
      for (const int u : {1, -1})
        for (const int v : {1, -1})
          maps.push_back(
              {to, {MappedAxis{of, u, u > 0 ? 0 : last_u}, MappedAxis{1 - of, v, v > 0 ? 0 : last_v}}});
  }

  /// The nodes that a map finds.
  struct Taken {
    std::vector<std::pair<size_t, size_t>> nodes;  // of the face, and the one there
    double farthest = 0;                           // cells
    FaceMap map{};
  };
  /// The map that finds the most nodes; of several the least collapsed, then the nearest.
  Taken bestOf(const BlockFace& face, const std::vector<Missing>& missing,
               const std::vector<FaceMap>& maps) const {
    Taken best;
    int best_collapsed = 0;
    for (const FaceMap& map : maps) {
      Taken one = taken(face, missing, map);
      if (one.nodes.empty()) continue;
      const int of_one = collapsed(map);
      const bool is_first = best.nodes.empty();
      if (is_first || std::tuple(best.nodes.size(), of_one, one.farthest) <
                          std::tuple(one.nodes.size(), best_collapsed, best.farthest)) {
        best = std::move(one);
        best.map = map;
        best_collapsed = of_one;
      }
    }
    return best;
  }
  static int collapsed(const FaceMap& map) { return (map.along[0].sign == 0) + (map.along[1].sign == 0); }

  /// Votes for all maps that take a place to a node.
  void vote(const Place& place, size_t node, std::map<FaceMap, size_t>& votes) const {
    constexpr std::array<std::pair<int, int>, 5> kWays{{{0, 1}, {0, -1}, {1, 1}, {1, -1}, {0, 0}}};
    // Each block has six faces.
    const auto block = std::upper_bound(blocks_.begin(), blocks_.end(), node,
                                        [](size_t n, const NodeLattice3& b) { return n < b.first; }) -
                       1;
    const size_t first = 6 * static_cast<size_t>(block - blocks_.begin());
    for (const BlockFace& to : std::span(faces_).subspan(first, 6)) {
      const auto there = placeOn(to, node);
      if (!there) continue;
      for (const auto& [of_u, sign_u] : kWays)
        for (const auto& [of_v, sign_v] : kWays) {
          if (sign_u != 0 && sign_v != 0 && of_u == of_v) continue;
          FaceMap map{to, {MappedAxis{of_u, sign_u, 0}, MappedAxis{of_v, sign_v, 0}}};
          for (size_t n = 0; n < 2; ++n) map.along[n].offset = (*there)[n] - map.along[n].at(place);
          ++votes[map];
        }
    }
  }
  /// The place of a node on a face, if it is on it.
  std::optional<Place> placeOn(const BlockFace& face, size_t node) const {
    const NodeLattice3& block = blocks_[face.block];
    if (node < block.first || node >= block.first + block.nodes()) return std::nullopt;
    const auto index = [&](size_t axis) {
      return static_cast<int64_t>((node - block.first) / block.stride(axis) % block.size[axis]);
    };
    if (index(face.axis) != (face.at_end ? static_cast<int64_t>(block.size[face.axis]) - 1 : 0))
      return std::nullopt;
    return Place{index(face.u()), index(face.v())};
  }

  Taken taken(const BlockFace& face, const std::vector<Missing>& missing, const FaceMap& map) const {
    Taken out;
    for (const Missing& one : missing) {
      const auto& [place, there, in_cells] = one;
      const auto to = nodeAt(map.to, {map.along[0].at(place), map.along[1].at(place)});
      if (!to || !is_there_[*to]) continue;
      const glm::dvec3 way = at_(*to) - there.at;
      const double away = lengthOf(in_cells * way);
      if (!(away <= kNear) && !(glm::length(way) <= kMaxAside * glm::length(there.cell[0])) &&
          !(lengthAcross(one, way) <= kNear))
        continue;
      out.nodes.push_back({*nodeAt(face, place), *to});
      out.farthest = std::max(out.farthest, away);
    }
    return out;
  }

  const std::span<const NodeLattice3> blocks_;
  const std::span<const uint8_t> is_there_;
  const std::function<glm::dvec3(size_t node)>& at_;
  const std::function<void()>& throw_if_stopped_;
  std::vector<BlockFace> faces_;
  NodeTree candidates_;         // nodes of faces that have splats
  std::vector<uint32_t> same_;  // [node]: whose splat it has; kNoSplat: its own, or not known
  std::vector<std::pair<BlockFace, FaceMap>> maps_;  // that have found nodes
  uint64_t compared_ = 0;
};

}  // namespace

uint64_t joinBytes(const NodeLattice3& block) {
  const auto& [ni, nj, nk] = block.size;
  constexpr uint64_t kNodeBytes =
      sizeof(uint8_t) + sizeof(uint32_t);  // whether it is there, and whose splat it has
  constexpr uint64_t kFaceBytes =
      2 * NodeTree::kPointBytes + sizeof(Missing) +
      2 * sizeof(size_t);  // a candidate (as its array doubles), a missing one, its partner
  return kNodeBytes * ni * nj * nk + 2 * kFaceBytes * (ni * nj + nj * nk + nk * ni);
}

std::optional<std::vector<JoinedNode>> findJoinedNodes(std::span<const NodeLattice3> blocks,
                                                       std::span<const uint8_t> is_there, uint64_t count,
                                                       const std::function<glm::dvec3(size_t node)>& at,
                                                       const std::function<void()>& throw_if_stopped) {
  if (count == 0) return std::vector<JoinedNode>();
  return Joiner(blocks, is_there, at, throw_if_stopped).find(count);
}

}  // namespace curvisplat
