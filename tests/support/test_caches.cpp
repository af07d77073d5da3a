#include "tests/support/test_caches.h"

#include <glm/geometric.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <random>
#include <utility>
#include <vector>

#include "stream/base/error.h"
#include "stream/base/file.h"
#include "stream/cache/cache_writer.h"
#include "stream/model/border_code.h"

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
    for (size_t v = 0; v < brick.variables.size(); ++v) sorted.variables[v][n] = brick.variables[v][order[n]];
    if (!brick.border_codes.empty()) sorted.border_codes[n] = brick.border_codes[order[n]];
  }
  return sorted;
}

/// A code of any of the five forms.
uint32_t randomBorderCode(std::mt19937_64& random) {
  std::uniform_real_distribution<double> unit(0, 1);
  const auto direction = [&] {
    glm::dvec3 towards;
    for (int axis = 0; axis < 3; ++axis) towards[axis] = unit(random) - 0.5;
    return glm::normalize(towards);
  };
  const glm::dvec3 first = direction(), second = glm::normalize(glm::cross(first, direction()));
  const std::array<glm::dvec3, 3> axes{first, second, glm::cross(first, second)};
  const size_t count = 1 + random() % 3;
  const double near = unit(random), far = unit(random);
  switch (random() % 5) {
    case 0:
      return packBorderCode({axes.data(), count}, static_cast<uint32_t>(random() % (1u << count)));
    case 1:
      return packLayerCode(first, 0.5 + near);
    case 2:
      return packMergedCode(first, 0.2 + 0.6 * near, 0.8 + 2 * far);
    case 3:
      return packLayersCode({axes.data(), near < 0.5 ? 2u : 3u}, far < 0.5 ? 0 : 1);
    default:
      return packPlateCode(first);
  }
}

enum class Borders : uint8_t { kNone, kOfNodes, kOfCells };

void writeRandom(const std::filesystem::path& path, uint64_t seed, size_t most_splats, Borders borders,
                 size_t variables = 1) {
  const RootCube root{{-1, 2, 3}, 4};
  std::vector<VariableInfo> infos{{0, "f", "", -1, 1}};
  if (variables > 1) infos.push_back({1, "g", "", -1, 1});
  CacheWriter writer(path, false, root, infos);
  std::mt19937_64 random(seed);
  RandomBrick like;
  like.unit = root.size;
  like.axis = 0.03;
  like.variables = variables;
  const auto append = [&](const Cell& cell, bool leaf, float error) {
    like.leaf = leaf;
    like.splats = 1 + random() % (random() % 3 == 0 ? most_splats : most_splats / 20);
    BrickSplats brick = randomBrick(like, cell, random());
    if (borders != Borders::kNone) {
      brick.border_codes.assign(brick.size(), kNoBorder);
      for (size_t n = 0; n < brick.size(); n += 3) brick.border_codes[n] = randomBorderCode(random);
    }
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
  manifest.cells = borders == Borders::kOfCells;
  if (borders != Borders::kNone) manifest.requirements = {kBorderFaces, kFaceLayers, kMergedBorders, kPlates};
  if (manifest.cells) manifest.requirements.push_back(kBorderPairs);
  writer.finish(manifest);
}

}  // namespace

void writeRandomCache(const std::filesystem::path& path, uint64_t seed, size_t most_splats) {
  writeRandom(path, seed, most_splats, Borders::kNone);
}

void writeRandomCacheWithBorders(const std::filesystem::path& path, uint64_t seed, bool cells,
                                 size_t variables) {
  writeRandom(path, seed, 3000, cells ? Borders::kOfCells : Borders::kOfNodes, variables);
}

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

void writePlatesCache(const std::filesystem::path& path, double thickness) {
  const RootCube root{glm::dvec3(0), kLatticeSide};
  constexpr uint64_t kNodes = uint64_t{kLatticeSide} * kLatticeSide;
  BrickSplats brick;
  brick.variables.resize(2);
  for (uint64_t n = 0; n < kNodes; ++n) {
    const glm::dvec3 at(static_cast<double>(n % kLatticeSide) + 0.5,
                        static_cast<double>(n / kLatticeSide) + 0.5, 0.5 * kLatticeSide);
    brick.positions.push_back(root.fromWorld(at));
    Splat splat;
    splat.axis = {1, 1, thickness};
    splat.weight = thickness;
    brick.splats.push_back(splat);
    brick.border_codes.push_back(packPlateCode({0, 0, 1}));
    for (size_t v = 0; v < 2; ++v) brick.variables[v].push_back({v == 0 ? 0.5 : -0.5, {0, 0, 1}, 0});
  }
  brick.runs.push_back({0, 0, 0, 0, kNodes});
  CacheWriter writer(path, true, root, {{0, "f", "", 0, 1}, {1, "g", "", -1, 0}});
  writer.append(encodeBrick(root, brick), 0);
  Manifest manifest;
  manifest.title = "plates";
  manifest.program = "test";
  manifest.sources = {"none"};
  manifest.reader = "none";
  manifest.lower = {0, 0, 0.5 * (kLatticeSide - thickness)};
  manifest.upper = {kLatticeSide, kLatticeSide, 0.5 * (kLatticeSide + thickness)};
  manifest.blocks = {{"block 1", kNodes, 1, 1}};
  manifest.nodes = kNodes;
  manifest.requirements = {kBorderFaces, kFaceLayers, kMergedBorders, kPlates};
  writer.finish(manifest);
}

namespace {

constexpr uint32_t kLeafSplats = 11'000, kInnerSplats = 24 * 24 * 24;
constexpr uint32_t kGeometryBytes = 6, kValuesBytes = 2;  // a splat

/// The cells of a full octree that have children, so that it has a given number of bricks.
class OctreeShape {
 public:
  /// There are whole eights of children: `bricks` is rounded down to 1 + 8 n.
  explicit OctreeShape(uint64_t bricks) : parents_((bricks - 1) / 8) {
    for (uint64_t cells = 1; parents_ > full_ + cells; cells *= 8) {
      full_ += cells;
      ++full_levels_;
    }
  }

  uint64_t bricks() const { return 1 + 8 * parents_; }
  bool hasChildren(const Cell& cell) const {
    if (cell.level < full_levels_) return true;
    return cell.level == full_levels_ && mortonOf(cell) < parents_ - full_;
  }

 private:
  static uint64_t mortonOf(const Cell& cell) {
    uint64_t number = 0;
    for (uint32_t bit = 0; bit < cell.level; ++bit)
      for (int axis = 0; axis < 3; ++axis)
        number |= uint64_t{cell.at[axis] >> bit & 1} << (3 * bit + static_cast<uint32_t>(axis));
    return number;
  }

  const uint64_t parents_;  // bricks with children
  uint64_t full_ = 0;       // those of the levels that all have them
  uint32_t full_levels_ = 0;
};

/// The index's records of all bricks, in post-order, and the streams of those that have some.
class SparseBricks {
 public:
  SparseBricks(const RootCube& root, const OctreeShape& shape) : root_(root), shape_(shape) {
    bricks.reserve(shape.bricks());
    append({});
  }

  struct Stream {
    uint64_t brick;
    EncodedBrick encoded;
  };
  std::vector<AppendedBrick> bricks;
  std::vector<Stream> streams;

 private:
  void append(const Cell& cell) {
    const bool leaf = !shape_.hasChildren(cell);
    if (!leaf)
      for (int octant = 0; octant < 8; ++octant) append(cell.child(octant));
    if (cell.level < kRealLevels) {
      BrickSplats splats = latticeBrick(root_, cell, {0, {1, 0, 0}, leaf});
      EncodedBrick encoded = encodeBrick(root_, splats);
      bricks.push_back({encoded.brick, encoded.weight, encoded.variables});
      streams.push_back({bricks.size() - 1, std::move(encoded)});
    } else {
      bricks.push_back(emptyBrick(cell, leaf));
    }
    bricks.back().brick.error = leaf ? 0 : static_cast<float>(root_.cellSize(cell.level) / 16);
  }

  AppendedBrick emptyBrick(const Cell& cell, bool leaf) const {
    AppendedBrick made;
    const double size = root_.cellSize(cell.level);
    made.weight = size * size * size;
    Brick& brick = made.brick;
    brick.cell = cell;
    brick.splats = leaf ? kLeafSplats : kInnerSplats;
    brick.octant_splats.fill(brick.splats / 8);
    brick.lower = root_.cellMin(cell);
    brick.upper = brick.lower + size;
    brick.largest_radius = static_cast<float>(size / 20);
    brick.geometry = {0, kGeometryBytes * brick.splats, 0};
    const auto low = static_cast<float>(brick.lower.x), high = static_cast<float>(brick.upper.x);
    made.variables = {{{0, kValuesBytes * brick.splats, 0}, low, high, (high - low) / 16, 0}};
    return made;
  }

  const RootCube& root_;
  const OctreeShape& shape_;
};

void writeStreams(const std::filesystem::path& path, const std::vector<SparseBricks::Stream>& streams,
                  const SparseBricks& sparse, bool geometry) {
  OutputFile file(path, Caching::kPages, OutputFile::Existing::kKeep);
  for (const auto& [brick, encoded] : streams) {
    const AppendedBrick& placed = sparse.bricks[brick];
    const Extent& extent = geometry ? placed.brick.geometry : placed.variables[0].values;
    file.writeAt(extent.offset, std::span(geometry ? encoded.geometry : encoded.values[0]));
  }
  file.close();
}

}  // namespace

void writeSparseCache(const std::filesystem::path& path, uint64_t bricks) {
  CURVISPLAT_CHECK_OP(bricks, >, uint64_t{kLatticeBricks});
  const RootCube root{glm::dvec3(0), kLatticeSide};
  const OctreeShape shape(bricks);
  CacheWriter writer(path, false, root, {{0, "f", "", 0, kLatticeSide}});
  SparseBricks sparse(root, shape);
  writer.reserve(sparse.bricks);
  std::filesystem::path partial = path;
  partial += ".partial";
  writeStreams(partial / "geometry.bin", sparse.streams, sparse, true);
  writeStreams(partial / "var.0.bin", sparse.streams, sparse, false);
  Manifest manifest;
  manifest.title = "sparse";
  manifest.program = "test";
  manifest.sources = {"none"};
  manifest.reader = "none";
  manifest.lower = root.min;
  manifest.upper = root.min + root.size;
  for (const AppendedBrick& each : sparse.bricks)
    if (each.brick.error == 0) manifest.nodes += each.brick.splats;
  manifest.blocks = {{"block 1", manifest.nodes, 1, 1}};
  sparse.bricks = {};
  writer.finish(manifest);
}

}  // namespace curvisplat
