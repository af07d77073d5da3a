#include "preprocess/convert/preflight.h"

#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <optional>

#include "preprocess/convert/splat_record.h"
#include "stream/base/disk_space.h"
#include "stream/base/error.h"
#include "stream/base/file.h"
#include "stream/base/text.h"
#include "stream/cache/partial_folder.h"

namespace curvisplat {
namespace {

// The bytes that a node with one scalar takes in the cache, levels of detail included, on grids that compress
// badly; and each further scalar.
constexpr uint64_t kCacheBytesPerNode = 16, kCacheBytesPerScalar = 5;
// Chunk headers, chunks that are not full, and the records of borders and seams, which are a fifth longer.
constexpr uint64_t kTemporaryMarginPercent = 8;

// Values between those measured: 3.9 to 5.0 bytes a splat, and 1.2 to 1.6 million splats a second on two
// threads. Meshes: points 7.5 to 13 bytes, cells 8 to 18 and, where they have a random order, 14 to 23.
constexpr double kUsualBytesPerMeshPoint = 11, kUsualBytesPerMeshCell = 13;
constexpr double kUsualBytesPerSplat = 5, kUsualBytesPerScalar = 1.5;
constexpr double kUsualStartSeconds = 0.1, kUsualSplatsPerSecond = 0.7e6;
// Nodes of faces between blocks are kept, matched and merged: 100,000 blocks of 3 x 3 x 3 nodes took 35 s of processor time,
// 2,500 of 11 x 11 x 11 nodes 18 s.
constexpr double kUsualFaceNodesPerSecond = 0.11e6;

/// The nodes on the faces of several blocks; none of a single block.
uint64_t faceNodesOf(std::span<const GridBlock> blocks) {
  uint64_t nodes = 0;
  const auto inner = [](uint64_t count) { return count - std::min<uint64_t>(count, 2); };
  for (const GridBlock& block : blocks)
    nodes += block.nodes() - inner(block.ni) * inner(block.nj) * inner(block.nk);
  return blocks.size() > 1 ? nodes : 0;
}

struct Disk {
  dev_t device;
  uint64_t free_bytes;
};

std::optional<Disk> diskOf(const std::filesystem::path& folder) {
  struct stat status {};
  const std::optional<uint64_t> free_bytes = freeBytes(folder);
  if (!free_bytes || ::stat(folder.c_str(), &status) != 0) return std::nullopt;
  return Disk{status.st_dev, *free_bytes};
}

void checkRoom(const std::filesystem::path& folder, const Disk& disk, uint64_t bytes, const char* what,
               const std::string& hint) {
  if (disk.free_bytes < bytes)
    throw OutputError("{}: {} need about {}, but only {} are free; {}", folder.string(), what,
                      byteText(bytes), byteText(disk.free_bytes), hint);
}

uint64_t withMargin(uint64_t temporary) {
  return temporary + temporary * kTemporaryMarginPercent / 100;
}

}  // namespace

DiskNeeds diskNeeds(uint64_t nodes, size_t variables) {
  const uint64_t further = variables > 1 ? variables - 1 : 0;
  return {withMargin(nodes * regularRecordBytes(variables)),
          nodes * (kCacheBytesPerNode + further * kCacheBytesPerScalar), 0};
}

ConversionEstimate estimateConversion(uint64_t splats, unsigned threads, SplatsOf what,
                                      std::span<const GridBlock> blocks) {
  const auto count = static_cast<double>(splats);
  const double bytes = what == SplatsOf::kGrid         ? kUsualBytesPerSplat
                       : what == SplatsOf::kMeshPoints ? kUsualBytesPerMeshPoint
                                                       : kUsualBytesPerMeshCell;
  return {static_cast<uint64_t>(count * bytes), static_cast<uint64_t>(count * kUsualBytesPerScalar),
          kUsualStartSeconds + (count / kUsualSplatsPerSecond +
                                static_cast<double>(faceNodesOf(blocks)) / kUsualFaceNodesPerSecond) /
                                   std::max(1u, threads)};
}

DiskNeeds with(const TemporaryNeeds& temporary, DiskNeeds needs) {
  needs.before_cache_bytes =
      temporary.lasting + std::max(temporary.before_splats, temporary.beside_splats + needs.temporary_bytes);
  needs.temporary_bytes += temporary.lasting;
  return needs;
}

DiskNeeds diskNeedsOfAdding(uint64_t splats, size_t variables, size_t record_bytes) {
  return {withMargin(splats * record_bytes), splats * variables * kCacheBytesPerScalar, 0};
}

void checkWritable(const std::filesystem::path& folder, const char* hint) {
  std::error_code error;
  if (!std::filesystem::is_directory(folder, error))
    throw OutputError("{}: {}{}", folder.string(),
                      std::filesystem::exists(folder, error) ? "is not a folder" : "does not exist", hint);
  if (::access(folder.c_str(), W_OK | X_OK) != 0)
    throw OutputError("{}: cannot be written to: {}{}", folder.string(), std::strerror(errno), hint);
}

void checkOutput(const std::filesystem::path& output, bool overwrite,
                 const std::filesystem::path& temporary_folder) {
  checkReplaceable(output, overwrite);
  checkWritable(folderOf(output), "");
  checkWritable(temporary_folder, "; name another folder with --tmp");
}

void checkDiskSpace(const DiskNeeds& needs, const std::filesystem::path& output,
                    const std::filesystem::path& temporary_folder, const std::string& hint) {
  const std::filesystem::path folder = folderOf(output);
  const std::optional<Disk> cache = diskOf(folder), temporary = diskOf(temporary_folder);
  if (!cache || !temporary) return;  // a file system that does not tell is no reason to refuse
  if (cache->device == temporary->device) {
    checkRoom(folder, *cache, std::max(needs.cache_bytes + needs.temporary_bytes, needs.before_cache_bytes),
              "the cache and temporary files", hint);
    return;
  }
  checkRoom(folder, *cache, needs.cache_bytes, "the cache's files",
            "make room, or skip this check with --no-preflight");
  checkRoom(temporary_folder, *temporary, needs.mostTemporary(), "temporary files",
            "make room, name another folder with --tmp, or skip this check with --no-preflight");
}

bool hasDiskSpace(const DiskNeeds& needs, const std::filesystem::path& output,
                  const std::filesystem::path& temporary_folder) {
  try {
    checkDiskSpace(needs, output, temporary_folder);
    return true;
  } catch (const Error&) {
    return false;
  }
}

RoomNeeded roomNeeded(const ConvertOptions& options) {
  RoomNeeded room{options.given_folders, "the cache and its temporary files", options.full_disk_hint};
  if (room.folders.empty()) room.folders = {folderOf(options.output), temporaryFolder(options)};
  if (room.advice.empty()) room.advice = kFullDiskHint;
  return room;
}

}  // namespace curvisplat
