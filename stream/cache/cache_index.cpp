#include "stream/cache/cache_index.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

#include "stream/base/checksum.h"
#include "stream/base/error.h"
#include "stream/base/memory.h"
#include "stream/base/mirror.h"
#include "stream/cache/cache_format.h"

namespace curvisplat {
namespace {

namespace fs = std::filesystem;

/// Throws the Error for a brick with an invalid record.
[[noreturn]] void refuse(const fs::path& path, size_t brick, const std::string& what) {
  throw Error("{}: brick {}: {}; the file is damaged: convert again", path.string(), brick, what);
}

void checkChecksum(const fs::path& path, const FileInfo& info, uint64_t found) {
  if (found != info.checksum)
    throw Error(
        "{}: has a wrong checksum (found {:016x}, expected {:016x}); the file is damaged: convert again",
        path.string(), found, info.checksum);
}

/// Upper bounds of the length of a stream of `splats` splats: its header, the runs or rows, the planes, and
/// zstd's overhead. Readers allocate memory for the stream's length.
uint64_t maxGeometryBytes(uint64_t splats) {
  return (16 << 10) + 135 * splats;  // a run (50) and 21 arrays of 4 planes
}
uint64_t maxValuesBytes(uint64_t splats) {
  return (16 << 10) + 31 * splats;  // a row (10) and 5 arrays of 4 planes
}

/// Whether extents follow one another in the octree's post-order, in which writers append them, within
/// [begin, end). Then none overlap, and nothing has to be sorted: of a million bricks that takes longer than
/// reading them.
template <typename ExtentOf>
class PostOrder {
 public:
  PostOrder(std::span<const Brick> bricks, const ExtentOf& extent_of, uint64_t begin, uint64_t end)
      : bricks_(bricks), extent_of_(extent_of), free_(begin), end_(end) {}

  bool followsWithin() {
    uint32_t roots = 0;
    while (roots < bricks_.size() && bricks_[roots].parent == kNoBrick) ++roots;
    return visit(0, roots);
  }

 private:
  /// Visits the bricks below, recursively: at most as deep as the octree has levels.
  bool visit(uint32_t first, uint32_t count) {
    for (uint32_t n = first; n < first + count; ++n) {
      if (!bricks_[n].isLeaf() && !visit(bricks_[n].first_child, bricks_[n].child_count)) return false;
      const Extent& extent = extent_of_(n);
      if (extent.length == 0 || extent.offset < free_ || extent.offset > end_ ||
          extent.length > end_ - extent.offset)
        return false;
      free_ = extent.offset + extent.length;
    }
    return true;
  }

  const std::span<const Brick> bricks_;
  const ExtentOf& extent_of_;
  uint64_t free_;
  const uint64_t end_;
};

/// Throws Error unless the extents of all bricks, whose links have been checked, are in [begin, end) and
/// none overlap.
template <typename ExtentOf>
void checkExtents(const fs::path& path, std::span<const Brick> bricks, const ExtentOf& extent_of,
                  uint64_t begin, uint64_t end) {
  if (PostOrder(bricks, extent_of, begin, end).followsWithin()) return;
  std::vector<uint32_t> order(bricks.size());
  std::iota(order.begin(), order.end(), 0u);
  std::sort(order.begin(), order.end(),
            [&](uint32_t a, uint32_t b) { return extent_of(a).offset < extent_of(b).offset; });
  uint64_t free = begin;
  for (uint32_t n : order) {
    const Extent& extent = extent_of(n);
    if (extent.length == 0 || extent.offset < free || extent.offset > end ||
        extent.length > end - extent.offset)
      refuse(path, n,
             fmt::format("its {} bytes at offset {} overlap another brick's, or are outside of the file",
                         extent.length, extent.offset));
    free = extent.offset + extent.length;
  }
}

class IndexChecker {
 public:
  /// `bricks`: the bricks read so far; it grows between calls of checkLast().
  IndexChecker(const fs::path& path, const std::vector<Brick>& bricks, const Manifest& manifest)
      : path_(path), bricks_(bricks), manifest_(manifest) {}

  /// Checks the last of the bricks by itself and against those before it.
  void checkLast() {
    const size_t n = bricks_.size() - 1;
    checkCell(n);
    checkNumbers(n);
    checkLinks(n);
    if (bricks_[n].isLeaf()) splats_ += bricks_[n].splats;
    children_ += bricks_[n].child_count;
    roots_ += bricks_[n].cell.level == 0;
  }

  void checkAll() const {
    if (roots_ + children_ != bricks_.size())
      throw Error(
          "{}: has {} roots and {} children, expected {} bricks in all; the file is damaged: convert again",
          path_.string(), roots_, children_, bricks_.size());
    if (splats_ != manifest_.splats)
      throw Error(
          "{}: wrong number of splats in leaves (found {}, the manifest has {}); the cache is damaged: "
          "convert again",
          path_.string(), splats_, manifest_.splats);
    const uint32_t levels = bricks_.back().cell.level + 1;
    if (levels != manifest_.levels)
      throw Error(
          "{}: wrong number of levels (found {}, the manifest has {}); the cache is damaged: convert again",
          path_.string(), levels, manifest_.levels);
  }

 private:
  /// Checks the brick's cell and its place in the order of bricks.
  void checkCell(size_t n) const {
    const Cell& cell = bricks_[n].cell;
    if (cell.level > kMaxLevel)
      refuse(path_, n, fmt::format("its level is {}, expected at most {}", cell.level, kMaxLevel));
    for (uint32_t at : cell.at)
      if (at >> cell.level != 0)
        refuse(path_, n, fmt::format("its cell coordinate {} is outside of level {}", at, cell.level));
    if (n == 0) {
      if (cell.level != 0) refuse(path_, n, "the first brick is not a root");
      return;
    }
    const Brick& before = bricks_[n - 1];
    if (cell == before.cell) {
      if (!bricks_[n].isLeaf() || !before.isLeaf())
        refuse(path_, n, "it shares its cell with another brick, but not both are leaves");
    } else if (cell.level < before.cell.level ||
               (cell.level == before.cell.level && !mortonLess(before.cell, cell))) {
      refuse(path_, n, "it is out of order");
    }
  }

  void checkNumbers(size_t n) const {
    const Brick& brick = bricks_[n];
    if (brick.splats == 0 || brick.splats > kMaxBrickSplats)
      refuse(path_, n, fmt::format("it has {} splats, expected 1 to {}", brick.splats, kMaxBrickSplats));
    uint64_t octants = 0;
    for (uint32_t splats : brick.octant_splats) octants += splats;
    if (octants != brick.splats)
      refuse(path_, n, fmt::format("its octants have {} splats, expected {}", octants, brick.splats));
    if (brick.geometry.length > maxGeometryBytes(brick.splats))
      refuse(path_, n,
             fmt::format("its stream of {} bytes is too long for {} splats", brick.geometry.length,
                         brick.splats));
    if (!(brick.largest_radius > 0 && std::isfinite(brick.largest_radius)))
      refuse(path_, n,
             fmt::format("its largest radius is {}, expected a positive number", brick.largest_radius));
    if (!(brick.error >= 0 && std::isfinite(brick.error)))
      refuse(path_, n, fmt::format("its error is {}, expected 0 or more", brick.error));
    const glm::dvec3 corner = manifest_.root.cellMin(brick.cell);
    const double size = manifest_.root.cellSize(brick.cell.level);
    for (int axis = 0; axis < 3; ++axis) {
      const double slack = 1e-12 * (std::abs(manifest_.root.min[axis]) + manifest_.root.size);
      const bool inside = corner[axis] - slack <= brick.lower[axis] &&
                          brick.lower[axis] <= brick.upper[axis] &&
                          brick.upper[axis] <= corner[axis] + size + slack;  // false for NaN
      if (!inside)
        refuse(path_, n,
               fmt::format("its box [{}, {}] along {} is not inside its cell", brick.lower[axis],
                           brick.upper[axis], "xyz"[axis]));
    }
  }

  void checkLinks(size_t n) const {
    const Brick& brick = bricks_[n];
    if (brick.cell.level == 0) {
      if (brick.parent != kNoBrick) refuse(path_, n, "it is a root with a parent");
    } else {
      if (brick.parent >= n)
        refuse(path_, n, fmt::format("its parent is brick {}, expected an earlier brick", brick.parent));
      const Brick& parent = bricks_[brick.parent];
      const bool counted = n >= parent.first_child && n - parent.first_child < parent.child_count;
      if (!counted || !(parent.cell == brick.cell.parent()))
        refuse(path_, n, fmt::format("its parent, brick {}, does not have it as a child", brick.parent));
    }
    if (brick.isLeaf()) {
      if (brick.first_child != kNoBrick) refuse(path_, n, "it is a leaf with a child");
    } else if (brick.first_child <= n || brick.first_child >= manifest_.bricks ||
               brick.child_count > manifest_.bricks - brick.first_child) {
      refuse(path_, n,
             fmt::format("it has {} children from brick {}, expected later bricks of the cache",
                         brick.child_count, brick.first_child));
    }
  }

  const fs::path& path_;
  const std::vector<Brick>& bricks_;
  const Manifest& manifest_;
  uint64_t splats_ = 0, children_ = 0, roots_ = 0;
};

/// Calls `use` for each record of a table whose header has been read. The number of records is checked
/// against the file's size. A sparse file can be large and hold nothing, so the records are read a piece at
/// a time, and `use` checks each record before memory is allocated for the next.
template <typename Record, typename Header, typename Use>
void readRecords(const InputFile& file, const Header& header, uint64_t offset, uint64_t bricks,
                 const FileInfo& info, const Use& use) {
  if (header.magic != Header{}.magic)
    throw Error("{}: does not begin with the magic bytes of a cache's file; it is damaged or of another kind",
                file.path().string());
  if (header.version != kTableVersion || header.record_bytes != sizeof(Record))
    throw Error("{}: has version {} and records of {} bytes (expected {} and {}); the file is damaged",
                file.path().string(), header.version, header.record_bytes, kTableVersion, sizeof(Record));
  if (header.bricks != bricks || offset > file.size() ||
      (file.size() - offset) / sizeof(Record) != header.bricks ||
      (file.size() - offset) % sizeof(Record) != 0)
    throw Error(
        "{}: has a header for {} bricks from offset {}, but its size is {} and the manifest has {} bricks; "
        "the file is damaged",
        file.path().string(), header.bricks, offset, file.size(), bricks);
  Checksum checksum;
  checksum.add(std::as_bytes(std::span(&header, 1)));
  constexpr uint64_t kRecordsAtOnce = (1 << 20) / sizeof(Record);
  std::vector<Record> records;
  for (uint64_t first = 0; first < header.bricks; first += records.size()) {
    records.resize(std::min(kRecordsAtOnce, header.bricks - first));
    file.readAt(offset + first * sizeof(Record), std::span(records));
    checksum.add(std::as_bytes(std::span(records)));
    for (const Record& record : records) use(record);
  }
  checkChecksum(file.path(), info, checksum.value());
}

/// Reserves the bricks at once, so that growing needs no copies: those are twice the memory, and a third of
/// the time that opening takes. Pages that are not written take no memory, so that a sparse file gets none;
/// the limit is for the address space.
void reserveBricks(std::vector<Brick>& bricks, uint64_t count) {
  constexpr uint64_t kMaxBytes = uint64_t{256} << 20;
  bricks.reserve(std::min<uint64_t>(count, kMaxBytes / sizeof(Brick)));
  preferHugePages(bricks.data(), bricks.capacity() * sizeof(Brick));
}

}  // namespace

fs::path cacheFile(const fs::path& cache, const std::string& name) {
  fs::path path = cache / name;
  std::error_code error;
  const fs::file_status status = fs::symlink_status(path, error);
  if (fs::is_symlink(status))
    throw Error(
        "{}: is a symbolic link; expected a file in the cache's own directory: replace the link by a copy",
        path.string());
  if (fs::exists(status) && !fs::is_regular_file(status))
    throw Error("{}: is not a regular file", path.string());
  return path;
}

fs::path cacheFolder(const fs::path& cache, const std::string& name) {
  fs::path path = cache / name;
  expectMirroredFolder(path);
  std::error_code error;
  if (!fs::is_directory(fs::symlink_status(path, error)))
    throw Error("{}: is not a directory of the cache's own; the cache is damaged: convert again",
                path.string());
  return path;
}

std::string variableFileName(const VariableInfo& variable) {
  return fmt::format("var.{}.bin", variable.number);
}

void checkSize(const fs::path& path, uint64_t bytes, const FileInfo& info) {
  if (info.size != bytes)
    throw Error(
        "{}: is truncated or has grown (found {} bytes, expected {}); the file is damaged: convert again",
        path.string(), bytes, info.size);
}

const FileInfo& checkFile(const fs::path& path, uint64_t bytes, const Manifest& manifest) {
  const FileInfo* const info = manifest.file(path.filename().string());
  if (!info)
    throw Error("{}: is not listed in the manifest; the cache is damaged: convert again", path.string());
  checkSize(path, bytes, *info);
  return *info;
}

const FileInfo& checkFile(const InputFile& file, const Manifest& manifest) {
  return checkFile(file.path(), file.size(), manifest);
}

std::vector<std::byte> readListed(const fs::path& cache, const std::string& name, const Manifest& manifest,
                                  uint64_t most) {
  const InputFile file(cacheFile(cache, name));
  const FileInfo& info = checkFile(file, manifest);
  if (file.size() > most)
    throw Error("{}: is too large (found {} bytes, expected {} at most); the cache is damaged: convert again",
                file.path().string(), file.size(), most);
  std::vector<std::byte> bytes(file.size());
  file.readAt(0, std::span(bytes));
  if (const uint64_t found = checksumOf(bytes); found != info.checksum)
    throw Error(
        "{}: has a wrong checksum (found {:016x}, expected {:016x}); the file is damaged: convert again",
        file.path().string(), found, info.checksum);
  return bytes;
}

std::vector<Brick> readBricks(const fs::path& cache, const Manifest& manifest) {
  const InputFile file(cacheFile(cache, "bricks.bin"));
  const FileInfo& info = checkFile(file, manifest);
  BricksHeader header;
  file.readAt(0, std::span(&header, 1));
  std::vector<Brick> bricks;
  reserveBricks(bricks, std::min(manifest.bricks, file.size() / sizeof(BrickRecord)));
  IndexChecker checker(file.path(), bricks, manifest);
  readRecords<BrickRecord>(file, header, sizeof header, manifest.bricks, info,
                           [&](const BrickRecord& record) {
                             bricks.push_back(brickOf(record));
                             checker.checkLast();
                           });
  checker.checkAll();
  bricks.shrink_to_fit();

  const InputFile geometry(cacheFile(cache, manifest.steps.front().geometry));
  const FileInfo& geometry_info = checkFile(geometry, manifest);
  checkExtents(
      file.path(), bricks, [&](uint32_t n) -> const Extent& { return bricks[n].geometry; }, 0,
      geometry.size());
  checkChecksum(geometry.path(), geometry_info, geometryChecksum(bricks));
  return bricks;
}

std::vector<BrickVariable> readVariableTable(const InputFile& file, const FileInfo& info,
                                             std::span<const Brick> bricks) {
  checkSize(file.path(), file.size(), info);
  VariableHeader header;
  file.readAt(0, std::span(&header, 1));
  std::vector<BrickVariable> table;
  table.reserve(bricks.size());
  readRecords<VariableRecord>(
      file, header, header.table_offset, bricks.size(), info, [&](const VariableRecord& record) {
        const size_t n = table.size();
        table.push_back(brickVariableOf(record));
        const BrickVariable& variable = table.back();
        const bool fine = std::isfinite(variable.min) && std::isfinite(variable.max) &&
                          variable.min <= variable.max && variable.largest_slope >= 0 &&
                          std::isfinite(variable.largest_slope) && variable.largest_deviation >= 0 &&
                          std::isfinite(variable.largest_deviation);
        if (!fine) refuse(file.path(), n, "its range, slope or deviation is invalid");
        if (variable.values.length > maxValuesBytes(bricks[n].splats))
          refuse(file.path(), n,
                 fmt::format("its stream of {} bytes is too long for {} splats", variable.values.length,
                             bricks[n].splats));
      });
  CURVISPLAT_CHECK_OP(table.size(), ==, bricks.size());
  checkExtents(
      file.path(), bricks, [&](uint32_t n) -> const Extent& { return table[n].values; }, sizeof header,
      header.table_offset);
  return table;
}

uint64_t geometryChecksum(std::span<const Brick> bricks) {
  Checksum checksum;
  std::array<uint64_t, 512> together;
  while (!bricks.empty()) {
    const size_t count = std::min(bricks.size(), together.size());
    for (size_t n = 0; n < count; ++n) together[n] = bricks[n].geometry.checksum;
    checksum.add(std::as_bytes(std::span(together).first(count)));
    bricks = bricks.subspan(count);
  }
  return checksum.value();
}

}  // namespace curvisplat
