#include "tests/support/sparse_cache.h"

#include <algorithm>
#include <utility>
#include <vector>

#include "stream/base/check.h"
#include "stream/base/file.h"
#include "stream/cache/cache_writer.h"
#include "tests/support/lattice_cache.h"

namespace curvisplat {
namespace {

constexpr uint32_t kLeafSplats = 11'000, kInnerSplats = 24 * 24 * 24;
constexpr uint32_t kGeometryBytes = 6, kValuesBytes = 2;  // a splat

/// Which cells of a full octree have children, so that it has a given number of bricks.
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
