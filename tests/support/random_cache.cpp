#include "tests/support/random_cache.h"

#include <algorithm>
#include <numeric>
#include <random>

#include "tests/stream/test_bricks.h"

namespace curvisplat {
namespace {

BrickSplats byOctant(const BrickSplats& brick) {
  std::vector<size_t> order(brick.size());
  std::iota(order.begin(), order.end(), size_t{0});
  std::stable_sort(order.begin(), order.end(), [&](size_t a, size_t b) {
    return octantOf(brick.positions[a], brick.cell) < octantOf(brick.positions[b], brick.cell);
  });
  BrickSplats sorted = brick;
  for (size_t n = 0; n < order.size(); ++n) {
    sorted.positions[n] = brick.positions[order[n]];
    sorted.splats[n] = brick.splats[order[n]];
    sorted.variables[0][n] = brick.variables[0][order[n]];
  }
  return sorted;
}

}  // namespace

void writeRandomCache(const std::filesystem::path& path, uint64_t seed, size_t most_splats) {
  const RootCube root{{-1, 2, 3}, 4};
  CacheWriter writer(path, false, root, {{0, "f", "", -1, 1}});
  std::mt19937_64 random(seed);
  RandomBrick like;
  like.unit = root.size;
  like.axis = 0.03;
  const auto append = [&](const Cell& cell, bool leaf, float error) {
    like.leaf = leaf;
    like.splats = 1 + random() % (random() % 3 == 0 ? most_splats : most_splats / 20);
    BrickSplats brick = randomBrick(like, cell, random());
    if (!leaf) brick = byOctant(brick);
    writer.append(encodeBrick(root, brick), error);
    return brick.size();
  };
  uint64_t nodes = 0;
  for (int octant = 0; octant < 8; ++octant) {
    const Cell cell = Cell{}.child(octant);
    for (int below = 0; below < 8; ++below) {
      if (below >= 2 && random() % 4 == 0) continue;
      for (int part = 0; part < (below == 1 ? 2 : 1); ++part) nodes += append(cell.child(below), true, 0);
    }
    append(cell, false, 0.1f);
  }
  append({}, false, 0.2f);
  Manifest manifest;
  manifest.title = "random";
  manifest.program = "test";
  manifest.sources = {"none"};
  manifest.reader = "none";
  manifest.lower = root.min;
  manifest.upper = root.min + root.size;
  manifest.blocks = {{"block 1", nodes, 1, 1}};
  manifest.nodes = nodes;
  writer.finish(manifest);
}

}  // namespace curvisplat
