#include "stream/base/free_space.h"

#include <sys/statvfs.h>

namespace curvisplat {

std::optional<uint64_t> freeBytes(const std::filesystem::path& folder) noexcept {
  struct statvfs disk {};
  if (::statvfs(folder.empty() ? "." : folder.c_str(), &disk) != 0 || disk.f_blocks == 0) return std::nullopt;
  return uint64_t{disk.f_bavail} * disk.f_frsize;
}

}  // namespace curvisplat
