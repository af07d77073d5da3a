// Which pages of a file lie in memory, and how to get them out: for reads that are to be cold, and known to
// be.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <string>

namespace curvisplat {

struct PageResidence {
  uint64_t pages = 0;
  uint64_t resident = 0;  // of those, in memory
  bool operator==(const PageResidence&) const = default;
};

/// Of `bytes` bytes of the file from `offset` (a multiple of the page) on, asked with mincore. The kernel
/// says "all" of a file that the caller neither owns nor may write. Throws Error.
PageResidence residenceOf(const std::filesystem::path& file, uint64_t offset, uint64_t bytes);
/// Of the whole file.
PageResidence residenceOf(const std::filesystem::path& file);

/// Writes back and drops the pages of `files`, and looks whether they are gone. Nothing if all are, else the
/// reason in words: a file system in memory keeps them, and so does another process that maps them. Throws
/// Error where a file cannot be opened.
std::optional<std::string> dropPages(std::span<const std::filesystem::path> files);

/// "ext4", "tmpfs", ...: the file system that `path` is on.
std::string fileSystemOf(const std::filesystem::path& path);
/// Whether it has no disk below it.
bool isInMemory(const std::string& file_system);

}  // namespace curvisplat
