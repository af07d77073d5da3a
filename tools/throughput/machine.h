// The machine that is measured: its description, and its page cache. The pages of a file can be evicted from
// it and checked, so that reads are verifiably cold. Any thread may call these functions; they concern the
// whole machine.
#pragma once

#include <nlohmann/json_fwd.hpp>

#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <string>

#include "stream/base/error.h"

namespace curvisplat {

struct Machine {
  std::string processor;  // "Intel(R) Xeon(R) Processor @ 2.90GHz"; empty if unknown
  unsigned cores = 1;     // usable by this process
  uint64_t memory_bytes = 0;
  std::string system;       // "Linux 6.1.0"
  std::string file_system;  // of the measured folder: "ext4"
  /// Processes that ran or wanted to, on the average of the last minute; nullopt if the system does not tell.
  std::optional<double> load = std::nullopt;

  static Machine here(const std::filesystem::path& folder);
  nlohmann::ordered_json toJson() const;
  /// One line, if so many other programs use the machine that measurements begun now would be wrong; else empty.
  std::string busyNote() const;
};

/// Memory that programs can have without swapping, in bytes; 0 if unknown.
uint64_t availableMemory();

/// The system does not tell which pages of a file are in the page cache.
class ResidenceUnknown : public Error {
 public:
  using Error::Error;
};

/// How many of a file's pages are in the page cache.
struct PageResidence {
  uint64_t pages = 0;
  uint64_t resident = 0;  // of these, in the page cache
  bool operator==(const PageResidence&) const = default;
};

/// Residence of `bytes` bytes of the file from `offset`, a multiple of the page size; uses mincore. The
/// kernel reports all pages of a file as resident if the caller neither owns it nor may write it. Throws
/// Error.
PageResidence residenceOf(const std::filesystem::path& path, uint64_t offset, uint64_t bytes);
/// Residence of the whole file.
PageResidence residenceOf(const std::filesystem::path& path);

/// Writes back and evicts the pages of `files`, then checks with mincore. Returns nullopt if all are
/// evicted, else the reason: a file system in memory keeps its pages, and so does another process that maps
/// them. Throws Error if a file cannot be opened.
std::optional<std::string> dropPages(std::span<const std::filesystem::path> files);

/// The file system that holds `path`: "ext4", "tmpfs", ...
std::string fileSystemOf(const std::filesystem::path& path);
/// Whether the file system keeps its files in memory.
bool isInMemory(const std::string& file_system);

}  // namespace curvisplat
