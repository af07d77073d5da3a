#include "stream/cache/brick_grids.h"

#include <openvdb/io/Stream.h>
#include <openvdb/openvdb.h>

#include <algorithm>
#include <cmath>
#include <mutex>
#include <sstream>

#include "stream/base/check.h"
#include "stream/base/checksum.h"

namespace curvisplat {
namespace {

// Magic (8), file, library major and minor version (4 each), flag (1).
constexpr size_t kMagic = 8, kUuidOffset = 21;
constexpr openvdb::Int32 kBackground = -1;
// Which every build of OpenVDB writes alike: values that are not the background, as they are.
constexpr uint32_t kCompression = openvdb::io::COMPRESS_ACTIVE_MASK;
constexpr const char* kWorldUnits = "world_units";

void initialize() {
  static std::once_flag once;
  std::call_once(once, [] { openvdb::initialize(); });
}

std::string gridName(uint32_t level) {
  return fmt::format("level {}", level);
}

openvdb::Coord coordOf(const Cell& cell) {
  return {static_cast<int>(cell.at[0]), static_cast<int>(cell.at[1]), static_cast<int>(cell.at[2])};
}

bool firstOfItsCell(std::span<const Brick> bricks, size_t brick) {
  return brick == 0 || !(bricks[brick - 1].cell == bricks[brick].cell);
}

/// OpenVDB puts a random UUID into each file it writes. A UUID made of the contents keeps the bytes the same.
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

/// OpenVDB refuses voxels of less than about 1e-5 units: an octree of smaller cells is written in units of a
/// power of two, so many world units each.
double worldUnits(double smallest_cell) {
  constexpr double kSmallestVoxel = 0x1p-14;
  return smallest_cell >= kSmallestVoxel ? 1
                                         : std::exp2(std::floor(std::log2(smallest_cell / kSmallestVoxel)));
}

/// `compression`: OpenVDB's flags.
std::vector<std::byte> fileOf(const RootCube& root, std::span<const Brick> bricks, uint32_t compression) {
  initialize();
  openvdb::GridPtrVec grids;
  const double world_units = worldUnits(root.cellSize(bricks.back().cell.level));
  openvdb::Int32Grid::Ptr grid;
  for (size_t n = 0; n < bricks.size(); ++n) {
    const Cell& cell = bricks[n].cell;
    if (n == 0 || cell.level != bricks[n - 1].cell.level) {
      grid = openvdb::Int32Grid::create(kBackground);
      grid->setName(gridName(cell.level));
      grid->insertMeta(kWorldUnits, openvdb::DoubleMetadata(world_units));
      const double size = root.cellSize(cell.level) / world_units;
      const auto transform = openvdb::math::Transform::createLinearTransform(size);
      // An index is the middle of its voxel.
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

std::vector<std::byte> brickGridsFile(const RootCube& root, std::span<const Brick> bricks) {
  return fileOf(root, bricks, kCompression);
}

uint64_t brickGridsMemory(std::span<const Brick> bricks) {
  using Tree = openvdb::Int32Tree;
  using Leaf = Tree::LeafNodeType;
  using Lower = Tree::RootNodeType::ChildNodeType::ChildNodeType;
  using Upper = Tree::RootNodeType::ChildNodeType;
  // A node is made anew where bricks, in Morton order, enter its cube.
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

BrickGridsComparison compareBrickGrids(std::span<const std::byte> bytes, const RootCube& root,
                                       std::span<const Brick> bricks, uint64_t most_memory) {
  // A file of another kind is not worth an octree.
  const std::vector<std::byte> small = brickGridsFile(root, bricks.first(1));
  if (bytes.size() < kUuidOffset || !std::equal(bytes.begin(), bytes.begin() + kMagic, small.begin()))
    return {"is no file of OpenVDB's", ""};
  if (!std::equal(bytes.begin(), bytes.begin() + kUuidOffset, small.begin()))
    return {"", "another version of OpenVDB wrote it"};
  if (const uint64_t memory = brickGridsMemory(bricks); memory > most_memory)
    return {"", fmt::format("that takes {} MiB of memory", memory >> 20)};
  const auto is_file_of = [&](uint32_t compression) {
    const std::vector<std::byte> expected = fileOf(root, bricks, compression);
    return std::equal(bytes.begin(), bytes.end(), expected.begin(), expected.end());
  };
  if (is_file_of(kCompression)) return {};
  // Converters left the choice to the library once, and so to how it had been built.
  const bool blosc = openvdb::io::Archive::hasBloscCompression();
  const bool zlib = openvdb::io::Archive::hasZLibCompression();
  if (blosc && is_file_of(kCompression | openvdb::io::COMPRESS_BLOSC)) return {};
  if (zlib && is_file_of(kCompression | openvdb::io::COMPRESS_ZIP)) return {};
  if (blosc && zlib) return {"has not the octree of bricks.bin", ""};
  return {"", "it is compressed as this build of OpenVDB cannot"};
}

}  // namespace curvisplat
