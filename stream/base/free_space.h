// How much room a disk has, where its file system tells.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>

namespace curvisplat {

/// Bytes that a user may write to the file system of `folder`. nullopt if that is not known: some file systems (ramfs,
/// some of FUSE and of networks) say that they have no blocks at all.
std::optional<uint64_t> freeBytes(const std::filesystem::path& folder) noexcept;

}  // namespace curvisplat
