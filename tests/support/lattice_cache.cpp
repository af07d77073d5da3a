#include "tests/support/lattice_cache.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>

#include "stream/cache/cache_writer.h"

namespace curvisplat {
namespace {

constexpr int kBrickSide = 8;
constexpr uint32_t kLeafLevel = 2;

/// Children before their parent, in Morton order.
void append(CacheWriter& writer, const RootCube& root, const Cell& cell, double constant,
            const glm::dvec3& gradient) {
  const bool leaf = cell.level == kLeafLevel;
  if (!leaf)
    for (int octant = 0; octant < 8; ++octant) append(writer, root, cell.child(octant), constant, gradient);
  BrickSplats brick = latticeBrick(root, cell, {constant, gradient, leaf});
  const double merged = root.cellSize(cell.level) / kBrickSide;
  writer.append(encodeBrick(root, brick), static_cast<float>(std::sqrt(merged * merged - 1)));
}

}  // namespace

BrickSplats latticeBrick(const RootCube& root, const Cell& cell, const LatticeBrick& of) {
  const double side = root.cellSize(cell.level) / kBrickSide;  // of a splat's piece of space
  BrickSplats brick;
  brick.cell = cell;
  brick.variables.resize(1);
  // By octant, as inner bricks want it and leaves may have it.
  for (int octant = 0; octant < 8; ++octant)
    for (int n = 0; n < kBrickSide * kBrickSide * kBrickSide / 8; ++n) {
      const int half = kBrickSide / 2;
      const glm::dvec3 at(n % half + (octant & 1 ? half : 0), n / half % half + (octant & 2 ? half : 0),
                          n / half / half + (octant & 4 ? half : 0));
      const glm::dvec3 position = root.cellMin(cell) + side * (at + 0.5);
      brick.positions.push_back(root.fromWorld(position));
      Splat splat;
      splat.axis = {side, side, side};
      splat.weight = side * side * side;
      brick.splats.push_back(splat);
      brick.variables[0].push_back({of.constant + glm::dot(of.gradient, position), side * of.gradient, 0});
    }
  if (of.leaf) {
    const uint64_t number = cell.at[0] + 4 * (cell.at[1] + 4 * cell.at[2]);
    brick.runs.push_back({0, number * brick.size(), 0, 0, brick.size()});
  }
  return brick;
}

void writeLatticeCache(const std::filesystem::path& path, double constant, const glm::dvec3& gradient) {
  const RootCube root{glm::dvec3(0), kLatticeSide};
  const glm::dvec3 span = double{kLatticeSide} * gradient;
  const double low = constant + std::min(span.x, 0.0) + std::min(span.y, 0.0) + std::min(span.z, 0.0);
  const double high = constant + std::max(span.x, 0.0) + std::max(span.y, 0.0) + std::max(span.z, 0.0);
  CacheWriter writer(path, false, root, {{0, "f", "", low, high}});
  append(writer, root, {}, constant, gradient);
  Manifest manifest;
  manifest.title = "lattice";
  manifest.program = "test";
  manifest.sources = {"none"};
  manifest.reader = "none";
  manifest.lower = root.min;
  manifest.upper = root.min + root.size;
  constexpr uint64_t kNodes = uint64_t{kLatticeSide} * kLatticeSide * kLatticeSide;
  manifest.blocks = {{"block 1", kNodes, 1, 1}};
  manifest.nodes = kNodes;
  writer.finish(manifest);
}

}  // namespace curvisplat
