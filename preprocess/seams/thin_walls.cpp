#include "preprocess/seams/thin_walls.h"

#include <algorithm>
#include <array>
#include <map>
#include <tuple>
#include <utility>

#include "stream/base/error.h"

namespace curvisplat {
namespace {

/// Joins boxes that are the same but along `axis`, where one begins behind the end of another. Keeps their order.
void joinAlong(size_t axis, std::vector<WallSide>& boxes) {
  std::map<std::tuple<uint32_t, uint32_t, std::array<uint64_t, 3>, std::array<uint64_t, 3>>, size_t> last_of;
  std::vector<WallSide> joined;
  for (const WallSide& box : boxes) {
    std::array<uint64_t, 3> first = box.first, last = box.last;
    first[axis] = last[axis] = 0;
    const auto [at, is_new] = last_of.try_emplace({box.block, box.side, first, last}, joined.size());
    if (!is_new && joined[at->second].last[axis] + 1 == box.first[axis]) {
      joined[at->second].last[axis] = box.last[axis];
      continue;
    }
    at->second = joined.size();
    joined.push_back(box);
  }
  boxes = std::move(joined);
}

/// Makes one box of every two neighbours of one block and one side.
void joinPairs(std::vector<WallSide>& boxes) {
  std::vector<WallSide> joined;
  for (size_t n = 0; n < boxes.size(); ++n) {
    WallSide& box = joined.emplace_back(boxes[n]);
    if (n + 1 == boxes.size() || boxes[n + 1].block != box.block || boxes[n + 1].side != box.side) continue;
    ++n;
    for (size_t axis = 0; axis < 3; ++axis) {
      box.first[axis] = std::min(box.first[axis], boxes[n].first[axis]);
      box.last[axis] = std::max(box.last[axis], boxes[n].last[axis]);
    }
  }
  boxes = std::move(joined);
}

/// Whether the boxes have no more rows than some lists over all blocks would have: each takes memory.
bool haveRowsOf(std::span<const WallSide> boxes, std::span<const GridBlock> blocks) {
  constexpr uint64_t kMaxLists = 16;
  uint64_t most = 0, rows = 0;
  for (const GridBlock& block : blocks) most += kMaxLists * block.nj * block.nk;
  for (const WallSide& box : boxes) {
    if (box.block >= blocks.size()) return false;
    const auto along = [&](size_t axis, uint64_t count) {
      const uint64_t end = std::min(box.last[axis], count - 1) + 1;
      return end - std::min(box.first[axis], end);
    };
    rows += along(1, blocks[box.block].nj) * along(2, blocks[box.block].nk);
    if (rows > most) return false;
  }
  return true;
}

}  // namespace

ThinWalls ThinWalls::read(std::span<const std::byte> bytes, std::span<const GridBlock> blocks,
                          const std::string& name) {
  std::vector<WallSide> boxes(bytes.size() / sizeof(WallSide));
  const auto to = std::as_writable_bytes(std::span(boxes));
  std::copy_n(bytes.begin(), to.size(), to.begin());
  if (bytes.size() % sizeof(WallSide) != 0 || !haveRowsOf(boxes, blocks))
    throw Error("{}: is damaged (has boxes that are not of the grid); convert again", name);
  return {boxes, blocks};
}

ThinWalls::ThinWalls(std::span<const WallSide> boxes, std::span<const GridBlock> blocks) {
  std::vector<uint64_t> first_node{0};
  for (const GridBlock& block : blocks) first_node.push_back(first_node.back() + block.nodes());
  for (const WallSide& box : boxes) {
    if (box.block >= blocks.size()) continue;
    const GridBlock& block = blocks[box.block];
    const uint64_t end = std::min(box.last[0], block.ni - 1) + 1;
    for (uint64_t k = box.first[2]; k <= box.last[2] && k < block.nk; ++k)
      for (uint64_t j = box.first[1]; j <= box.last[1] && j < block.nj; ++j) {
        const uint64_t row = first_node[box.block] + (k * block.nj + j) * block.ni;
        if (box.first[0] < end) runs_.push_back({row + box.first[0], row + end, box.side});
      }
  }
  std::sort(runs_.begin(), runs_.end(), [](const Run& a, const Run& b) {
    return std::tie(a.begin, a.end, a.side) < std::tie(b.begin, b.end, b.side);
  });
  // Boxes of several nodes may overlap.
  std::vector<Run> apart;
  for (Run run : runs_) {
    if (!apart.empty() && run.begin < apart.back().end) {
      if (run.side == apart.back().side) {
        apart.back().end = std::max(apart.back().end, run.end);
        continue;
      }
      run.begin = apart.back().end;
      if (run.begin >= run.end) continue;
    }
    apart.push_back(run);
  }
  runs_ = std::move(apart);
}

uint32_t ThinWalls::sideOf(uint64_t node) const {
  const auto behind = std::upper_bound(runs_.begin(), runs_.end(), node,
                                       [](uint64_t number, const Run& run) { return number < run.begin; });
  return behind != runs_.begin() && node < std::prev(behind)->end ? std::prev(behind)->side : 0;
}

std::vector<WallSide> wallSidesOf(std::span<const WallNode> nodes, std::span<const GridBlock> blocks,
                                  size_t most) {
  std::vector<WallSide> boxes;
  uint32_t block = 0;
  uint64_t first = 0;  // of the block
  for (const auto& [node, side] : nodes) {
    for (; node >= first + blocks[block].nodes(); ++block) first += blocks[block].nodes();
    const uint64_t row = (node - first) / blocks[block].ni;
    const std::array<uint64_t, 3> at{(node - first) % blocks[block].ni, row % blocks[block].nj,
                                     row / blocks[block].nj};
    boxes.push_back({block, side, at, at});
  }
  for (const size_t axis : {0u, 1u, 2u}) joinAlong(axis, boxes);
  while (boxes.size() > std::max(most, 2 * blocks.size())) {
    const size_t before = boxes.size();
    joinPairs(boxes);
    if (boxes.size() == before) break;  // neighbours are all on other sides
  }
  return boxes;
}

}  // namespace curvisplat
