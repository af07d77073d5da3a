#include "tools/throughput/machine.h"

#include <sys/mman.h>
#include <sys/utsname.h>
#include <unistd.h>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <thread>
#include <utility>
#include <vector>

#include "preprocess/convert/memory_plan.h"
#include "stream/base/error.h"
#include "stream/base/file.h"
#include "stream/base/os.h"
#include "stream/base/text.h"
#include "stream/paging/async_reads.h"

namespace curvisplat {
Machine Machine::here(const std::filesystem::path& folder) {
  Machine machine;
  machine.processor = os::processorName();
  machine.cores = std::max(1u, std::thread::hardware_concurrency());
  machine.memory_bytes = machineMemory();
  utsname name{};
  if (::uname(&name) == 0) machine.system = std::string(name.sysname) + " " + name.release;
  machine.file_system = fileSystemOf(folder);
  double load = 0;
  if (::getloadavg(&load, 1) == 1) machine.load = load;
  return machine;
}

nlohmann::ordered_json Machine::toJson() const {
  return {{"processor", processor},       {"cores", cores},
          {"memory_bytes", memory_bytes}, {"system", system},
          {"file_system", file_system},   {"load", load ? nlohmann::ordered_json(*load) : nullptr}};
}

std::string Machine::busyNote() const {
  constexpr double kBusyShare = 0.25;  // of the cores; a desktop at rest has a load of 0.1 to 0.3
  if (!load || *load <= kBusyShare * cores) return {};
  return fmt::format(
      "the machine is busy (load {:.1f} in the last minute, {}): these figures will be wrong; end other "
      "programs or wait, and measure again",
      *load, countText(cores, "core"));
}

uint64_t availableMemory() {
  return os::availableMemory();
}

namespace {

// Values of statfs.f_type, from linux/magic.h and the sources of the file systems.
constexpr std::pair<uint64_t, const char*> kFileSystems[] = {
    {0xEF53, "ext4"},       {0x58465342, "xfs"},     {0x9123683E, "btrfs"}, {0x01021994, "tmpfs"},
    {0x858458F6, "ramfs"},  {0x794C7630, "overlay"}, {0x6969, "nfs"},       {0x65735546, "fuse"},
    {0x0BD00BD0, "lustre"}, {0x2FC12FC1, "zfs"},     {0x47504653, "gpfs"},  {0xFF534D42, "cifs"},
    {0xFE534D42, "smb2"},   {0xF2F52010, "f2fs"},    {0x01021997, "9p"},    {0x00C36400, "ceph"}};

/// Maps a part of a file without touching its pages.
class Mapping {
 public:
  Mapping(const DirectFile& file, uint64_t offset, uint64_t bytes) : bytes_(bytes) {
    at_ = ::mmap(nullptr, bytes, PROT_READ, MAP_SHARED, file.bufferedFd(), static_cast<off_t>(offset));
    if (at_ == MAP_FAILED)
      throw Error("{}: cannot map {} bytes at offset {}: {}", file.path().string(), bytes, offset,
                  std::strerror(errno));
  }
  ~Mapping() { ::munmap(at_, bytes_); }
  Mapping(const Mapping&) = delete;
  Mapping& operator=(const Mapping&) = delete;

  void* at() const { return at_; }

 private:
  void* at_ = nullptr;
  const uint64_t bytes_;
};

}  // namespace

PageResidence residenceOf(const std::filesystem::path& path, uint64_t offset, uint64_t bytes) {
  if (bytes == 0) return {};
  const auto page = static_cast<uint64_t>(::sysconf(_SC_PAGESIZE));
  CURVISPLAT_CHECK_OP(offset % page, ==, 0u);
  const DirectFile file(path, false);
  const Mapping mapping(file, offset, bytes);
  const std::optional<uint64_t> resident = os::residentPages(mapping.at(), bytes);
  if (!resident)
    throw ResidenceUnknown("{}: the system does not tell which pages are in memory: {}", path.string(),
                           std::strerror(errno));
  return {(bytes + page - 1) / page, *resident};
}

PageResidence residenceOf(const std::filesystem::path& path) {
  return residenceOf(path, 0, std::filesystem::file_size(path));
}

std::optional<std::string> dropPages(std::span<const std::filesystem::path> files) try {
  for (const std::filesystem::path& path : files) {
    {
      const DirectFile file(path, false);
      // Unwritten pages cannot be evicted, hence the sync. mincore shows below whether both calls worked.
      SystemCalls::current().fsync(file.bufferedFd());
      os::evictPages(file.bufferedFd());
    }
    const PageResidence left = residenceOf(path);
    if (left.resident == 0) continue;
    const std::string file_system = fileSystemOf(path);
    return fmt::format("{} of {} pages of {} stay in memory ({}): {}", left.resident, left.pages,
                       path.filename().string(), file_system,
                       isInMemory(file_system) ? "this file system keeps its files in memory"
                                               : "another program uses them, or another user owns the file");
  }
  return std::nullopt;
} catch (const ResidenceUnknown& error) {
  return error.what();
}

std::string fileSystemOf(const std::filesystem::path& path) {
  const int64_t found = os::fileSystemNumber(path.c_str());
  if (found < 0) throw Error("{}: cannot determine its file system: {}", path.string(), std::strerror(errno));
  for (const auto& [number, name] : kFileSystems)
    if (number == static_cast<uint64_t>(found)) return name;
  return fmt::format("file system {:#x}", found);
}

bool isInMemory(const std::string& file_system) {
  return file_system == "tmpfs" || file_system == "ramfs";
}

}  // namespace curvisplat
