#include "tools/throughput/disk_throughput.h"

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstdlib>
#include <cstring>
#include <memory>
#include <optional>
#include <random>

#include "stream/base/error.h"
#include "stream/base/file.h"
#include "stream/cache/cache_format.h"
#include "stream/paging/async_reads.h"
#include "tools/throughput/machine.h"

namespace curvisplat {
namespace {

using SteadyClock = std::chrono::steady_clock;
using Way = DiskRun::Way;

constexpr uint64_t kMaxBlock = kDiskBlocks.back();
constexpr Way kWays[] = {Way::kDirect, Way::kDirectPread, Way::kBufferedCold, Way::kBufferedWarm};

const char* nameOf(Way way) {
  switch (way) {
    case Way::kDirect:
      return "direct";
    case Way::kDirectPread:
      return "direct-pread";
    case Way::kBufferedCold:
      return "buffered-cold";
    case Way::kBufferedWarm:
      break;
  }
  return "buffered-warm";
}

bool isDirect(Way way) {
  return way == Way::kDirect || way == Way::kDirectPread;
}

/// The part of a file that is measured.
struct MeasuredPart {
  const DirectFile* file;
  uint64_t bytes;  // from offset 0
};

struct Block {
  const DirectFile* file;
  uint64_t offset;
};

/// All blocks of the parts in a shuffled but fixed order.
std::vector<Block> blocksOf(std::span<const MeasuredPart> parts, uint64_t block_bytes) {
  std::vector<Block> blocks;
  for (const MeasuredPart& part : parts)
    for (uint64_t offset = 0; offset < part.bytes; offset += block_bytes)
      blocks.push_back({part.file, offset});
  std::mt19937_64 random(1);
  std::shuffle(blocks.begin(), blocks.end(), random);
  return blocks;
}

struct Free {
  void operator()(std::byte* bytes) const { std::free(bytes); }
};
using Buffer = std::unique_ptr<std::byte, Free>;

/// Reads `blocks` until all are read or `max_s` seconds have passed. Returns bytes per second.
double readBlocks(std::span<const Block> blocks, const DiskRun& run, AsyncReads& reads, std::byte* buffer,
                  double max_s) {
  const auto start = SteadyClock::now();
  const auto seconds = [&] { return std::chrono::duration<double>(SteadyClock::now() - start).count(); };
  std::vector<size_t> block_of(run.depth);  // [tag]
  size_t next = 0;
  unsigned under_way = 0;
  const auto submit = [&](uint64_t tag) {
    const Block& block = blocks[block_of[tag]];
    const int fd = isDirect(run.way) ? block.file->directFd() : block.file->bufferedFd();
    reads.submit({fd, block.offset, buffer + tag * run.block_bytes, run.block_bytes, tag});
  };
  const auto submitNext = [&](uint64_t tag) {
    block_of[tag] = next++;
    submit(tag);
    ++under_way;
  };
  uint64_t bytes = 0;
  int failed = 0;
  for (uint64_t tag = 0; tag < run.depth && next < blocks.size(); ++tag) submitNext(tag);
  while (under_way > 0) {
    const auto end = reads.wait();
    if (!end) continue;
    if (end->result == -EINTR || end->result == -EAGAIN) {
      submit(end->tag);
      continue;
    }
    --under_way;
    if (end->result < 0) failed = static_cast<int>(-end->result);
    bytes += static_cast<uint64_t>(std::max<int64_t>(end->result, 0));
    if (failed == 0 && next < blocks.size() && seconds() < max_s) submitNext(end->tag);
  }
  if (failed != 0) throw Error("reading {}: {}", nameOf(run.way), std::strerror(failed));
  return static_cast<double>(bytes) / seconds();
}

/// The two files of a cache that drawing reads, and the part of each that is measured.
class CacheFiles {
 public:
  CacheFiles(const CacheReader& cache, size_t variable, uint64_t max_bytes)
      : paths_{cache.geometryPath(), cache.valuesPath(variable)} {
    uint64_t all_bytes = 0;
    for (const auto& path : paths_) all_bytes += std::filesystem::file_size(path);
    if (const uint64_t available = availableMemory()) max_bytes = std::min(max_bytes, available / 4);
    const double part = static_cast<double>(max_bytes) / static_cast<double>(all_bytes);
    for (size_t n = 0; n < paths_.size(); ++n) {
      files_[n] = std::make_unique<DirectFile>(paths_[n]);
      const uint64_t bytes = std::filesystem::file_size(paths_[n]);
      const auto wanted = static_cast<uint64_t>(part * static_cast<double>(bytes)) / kMaxBlock;
      parts_.push_back({files_[n].get(), std::min(bytes, (wanted + 1) * kMaxBlock)});
    }
  }

  std::span<const MeasuredPart> parts() const { return parts_; }
  bool areDirect() const {
    return std::all_of(files_.begin(), files_.end(), [](const auto& file) { return file->isDirect(); });
  }
  std::span<const std::filesystem::path> paths() const { return paths_; }

  /// Reads the parts into the page cache. Returns nullopt if they are all there afterwards, else the
  /// reason.
  std::optional<std::string> makeWarm() const try {
    std::vector<std::byte> piece(1 << 20);
    for (const MeasuredPart& part : parts_) {
      const InputFile file(part.file->path());
      for (uint64_t at = 0; at < part.bytes; at += piece.size())
        file.readAt(at, std::span(piece).first(std::min<uint64_t>(piece.size(), part.bytes - at)));
      const PageResidence residence = residenceOf(part.file->path(), 0, part.bytes);
      if (residence.resident < residence.pages)
        return fmt::format("only {} of {} pages of {} stay in the page cache after being read",
                           residence.resident, residence.pages, part.file->path().filename().string());
    }
    return std::nullopt;
  } catch (const ResidenceUnknown& error) {
    return error.what();
  }

 private:
  const std::array<std::filesystem::path, 2> paths_;
  std::array<std::unique_ptr<DirectFile>, 2> files_;
  std::vector<MeasuredPart> parts_;
};

/// Brings the files into the state that `way` requires. Returns nullopt, or the reason if that is impossible.
std::optional<std::string> prepareFiles(const CacheFiles& files, Way way) {
  if (way == Way::kBufferedCold) return dropPages(files.paths());
  if (way == Way::kBufferedWarm) return files.makeWarm();
  const std::string file_system = fileSystemOf(files.paths()[0]);
  if (isInMemory(file_system)) return fmt::format("{} is a file system in memory", file_system);
  if (!files.areDirect()) return fmt::format("the file system ({}) refuses direct reads", file_system);
  return std::nullopt;
}

void measure(const DiskRun& run, const CacheFiles& files, const DiskEffort& effort, Measurements& to) {
  auto reads = run.way == Way::kDirectPread ? nullptr : makeUringReads(run.depth);
  if (!reads) reads = makeThreadReads(run.depth);
  const Buffer buffer(static_cast<std::byte*>(std::aligned_alloc(kPageBytes, run.depth * run.block_bytes)));
  const std::vector<Block> blocks = blocksOf(files.parts(), run.block_bytes);
  std::vector<double> rates;
  try {
    for (unsigned sample = 0; sample < effort.samples; ++sample) {
      if (const auto reason = prepareFiles(files, run.way)) return to.leaveOut(run.name(), *reason);
      rates.push_back(readBlocks(blocks, run, *reads, buffer.get(), effort.sample_s));
    }
  } catch (const Error& error) {
    if (!isDirect(run.way)) throw;
    return to.leaveOut(run.name(),
                       error.what());  // the file system accepted O_DIRECT at open but fails reads
  }
  to.add(run.name(), "B/s", std::move(rates));
}

}  // namespace

std::string DiskRun::name() const {
  const bool whole_mib = block_bytes >= 1 << 20;
  return fmt::format("disk/{}/{}{}/depth:{}", nameOf(way), block_bytes >> (whole_mib ? 20 : 10),
                     whole_mib ? "MiB" : "KiB", depth);
}

std::vector<DiskRun> diskRuns() {
  std::vector<DiskRun> runs;
  for (const Way way : kWays) {
    for (const uint64_t block : kDiskBlocks) runs.push_back({way, block, kPagerDepth});
    for (const unsigned depth : kDiskDepths)
      if (depth != kPagerDepth) runs.push_back({way, kPagerBlock, depth});
  }
  return runs;
}

void measureDisk(const CacheReader& cache, size_t variable, const DiskEffort& effort, Measurements& to,
                 Progress& progress) {
  const CacheFiles files(cache, variable, effort.max_bytes);
  const std::vector<DiskRun> runs = diskRuns();
  progress.begin("reading the disk", runs.size(), "runs");
  for (const DiskRun& run : runs) {
    measure(run, files, effort, to);
    progress.advance(1);
  }
}

}  // namespace curvisplat
