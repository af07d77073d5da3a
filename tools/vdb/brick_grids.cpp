#include "stream/vdb/brick_grids.h"

#include <openvdb/io/Stream.h>
#include <openvdb/openvdb.h>

#include <algorithm>
#include <cmath>
#include <sstream>

#include "stream/base/checksum.h"
#include "stream/base/error.h"
#include "tools/vdb/vdb_plugin.h"

namespace curvisplat {
namespace {

// OpenVDB's file header: magic number (8), versions of file, library (major, minor; 4 each), a flag (1), UUID
// (36).
constexpr size_t kMagic = 8, kUuidOffset = 21;
constexpr openvdb::Int32 kBackground = -1;
// The only compression that every build of OpenVDB has: active values only, not compressed further.
constexpr uint32_t kCompression = openvdb::io::COMPRESS_ACTIVE_MASK;
constexpr const char* kWorldUnits = "world_units";

std::string gridName(uint32_t level) {
  return fmt::format("level {}", level);
}

openvdb::Coord coordOf(const Cell& cell) {
  return {static_cast<int>(cell.at[0]), static_cast<int>(cell.at[1]), static_cast<int>(cell.at[2])};
}

bool firstOfItsCell(std::span<const Brick> bricks, size_t brick) {
  return brick == 0 || !(bricks[brick - 1].cell == bricks[brick].cell);
}

/// OpenVDB writes a random UUID into each file. Replaces it by a UUID computed from the contents, so that the
/// same octree gives the same bytes.
void replaceUuid(std::string& file) {
  constexpr size_t kOffset = kUuidOffset, kLength = 36;
  CURVISPLAT_CHECK_OP(file.size(), >, kOffset + kLength);
  CURVISPLAT_CHECK(file[kOffset + 8] == '-' && file[kOffset + 23] == '-');
  const auto bytes = std::as_bytes(std::span(file));
  const uint64_t head = checksumOf(bytes.first(kOffset)), tail = checksumOf(bytes.subspan(kOffset + kLength));
  const std::string hex = fmt::format("{:016x}{:016x}", head, tail);
  const std::string uuid = hex.substr(0, 8) + '-' + hex.substr(8, 4) + '-' + hex.substr(12, 4) + '-' +
                           hex.substr(16, 4) + '-' + hex.substr(20, 12);
  file.replace(kOffset, kLength, uuid);
}

/// The length of the file's unit in world units. OpenVDB refuses voxels smaller than about 1e-5 units, so an
/// octree with smaller cells is written in units of a smaller power of two.
double worldUnits(double smallest_cell) {
  constexpr double kSmallestVoxel = 0x1p-14;
  return smallest_cell >= kSmallestVoxel ? 1
                                         : std::exp2(std::floor(std::log2(smallest_cell / kSmallestVoxel)));
}

/// `compression`: OpenVDB's compression flags.
std::vector<std::byte> fileOf(const RootCube& root, std::span<const Brick> bricks, uint32_t compression) {
  initializeOpenVdb();
  openvdb::GridPtrVec grids;
  const double world_units = worldUnits(root.cellSize(bricks.back().cell.level));
  openvdb::Int32Grid::Ptr grid;
  for (size_t n = 0; n < bricks.size(); ++n) {
    const Cell& cell = bricks[n].cell;
    if (n == 0 || cell.level != bricks[n - 1].cell.level) {
      grid = makeVdbGrid<openvdb::Int32Grid>(kBackground);
      grid->setName(gridName(cell.level));
      grid->insertMeta(kWorldUnits, openvdb::DoubleMetadata(world_units));
      const double size = root.cellSize(cell.level) / world_units;
      const auto transform = openvdb::math::Transform::createLinearTransform(size);
      // OpenVDB's index coordinates are the centres of voxels.
      transform->postTranslate(openvdb::Vec3d(root.min.x, root.min.y, root.min.z) / world_units +
                               openvdb::Vec3d(0.5 * size));
      grid->setTransform(transform);
      grids.push_back(grid);
    }
    if (firstOfItsCell(bricks, n)) grid->tree().setValue(coordOf(cell), static_cast<openvdb::Int32>(n));
  }
  std::ostringstream text(std::ios::binary);
  openvdb::io::Stream stream(text);
  stream.setCompression(compression);
  stream.write(grids);
  std::string file = std::move(text).str();
  replaceUuid(file);
  const auto bytes = std::as_bytes(std::span(file));
  return {bytes.begin(), bytes.end()};
}

}  // namespace

std::vector<std::byte> vdb_plugin::brickGridsFile(const RootCube& root, std::span<const Brick> bricks) {
  try {
    return fileOf(root, bricks, kCompression);
  } catch (const openvdb::Exception& refused) {  // of cells that it takes for empty
    throw Error(
        "bricks of {:g} in a root of {:g} cannot be written by OpenVDB ({}); are the coordinates right?",
        root.cellSize(bricks.back().cell.level), root.cellSize(0), refused.what());
  }
}

uint64_t vdb_plugin::brickGridsMemory(std::span<const Brick> bricks) {
  using Tree = openvdb::Int32Tree;
  using Leaf = Tree::LeafNodeType;
  using Lower = Tree::RootNodeType::ChildNodeType::ChildNodeType;
  using Upper = Tree::RootNodeType::ChildNodeType;
  // In Morton order, the bricks of a tree node's cube follow one another: count how often they enter a new
  // cube.
  const auto nodes = [&](uint32_t log2_side) {
    uint64_t count = 0;
    for (size_t n = 0; n < bricks.size(); ++n) {
      const Cell &cell = bricks[n].cell, &before = bricks[n == 0 ? 0 : n - 1].cell;
      bool enters = n == 0 || cell.level != before.level;
      for (int axis = 0; axis < 3; ++axis)
        enters |= cell.at[axis] >> log2_side != before.at[axis] >> log2_side;
      count += enters;
    }
    return count;
  };
  return nodes(Leaf::TOTAL) * (sizeof(Leaf) + Leaf::SIZE * sizeof(openvdb::Int32)) +
         nodes(Lower::TOTAL) * sizeof(Lower) + nodes(Upper::TOTAL) * sizeof(Upper);
}

BrickGridsComparison vdb_plugin::compareBrickGrids(std::span<const std::byte> bytes, const RootCube& root,
                                                   std::span<const Brick> bricks, uint64_t most_memory) {
  // Recognises other kinds of file by their header, without building the whole octree.
  const std::vector<std::byte> small = vdb_plugin::brickGridsFile(root, bricks.first(1));
  if (bytes.size() < kUuidOffset || !std::equal(bytes.begin(), bytes.begin() + kMagic, small.begin()))
    return {"is not an OpenVDB file", ""};
  if (!std::equal(bytes.begin(), bytes.begin() + kUuidOffset, small.begin()))
    return {"", "another version of OpenVDB wrote it"};
  if (const uint64_t memory = vdb_plugin::brickGridsMemory(bricks); memory > most_memory)
    return {"", fmt::format("the comparison would take {} MiB of memory", memory >> 20)};
  const auto is_file_of = [&](uint32_t compression) {
    const std::vector<std::byte> expected = fileOf(root, bricks, compression);
    return std::equal(bytes.begin(), bytes.end(), expected.begin(), expected.end());
  };
  if (is_file_of(kCompression)) return {};
  // Earlier converters left the compression to the library, so it depended on how the library was built.
  const bool blosc = openvdb::io::Archive::hasBloscCompression();
  const bool zlib = openvdb::io::Archive::hasZLibCompression();
  if (blosc && is_file_of(kCompression | openvdb::io::COMPRESS_BLOSC)) return {};
  if (zlib && is_file_of(kCompression | openvdb::io::COMPRESS_ZIP)) return {};
  if (blosc && zlib) return {"does not agree with the octree in bricks.bin", ""};
  return {"", "it uses a compression that this build of OpenVDB lacks"};
}

}  // namespace curvisplat
