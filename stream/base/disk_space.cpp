#include "stream/base/disk_space.h"

#include <sys/statvfs.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <system_error>

namespace curvisplat {
namespace {

namespace fs = std::filesystem;

constexpr const char* kMakeRoom = "make room there";

/// The absolute path, without a slash at its end.
fs::path wholePath(const fs::path& path) {
  std::error_code error;
  const fs::path absolute = fs::absolute(path, error);
  const fs::path normal = (error ? path : absolute).lexically_normal();
  return normal.has_filename() ? normal : normal.parent_path();
}

bool isIn(const fs::path& file, const fs::path& folder) {
  return std::mismatch(folder.begin(), folder.end(), file.begin(), file.end()).first == folder.end();
}

std::string adviceFor(int error, const std::string& of_full_disk) {
  return error == EFBIG ? "raise the limit of file sizes (ulimit -f)" : of_full_disk;
}

}  // namespace

std::optional<uint64_t> freeBytes(const fs::path& folder) noexcept {
  struct statvfs disk {};
  if (::statvfs(folder.empty() ? "." : folder.c_str(), &disk) != 0 || disk.f_blocks == 0) return std::nullopt;
  return uint64_t{disk.f_bavail} * disk.f_frsize;
}

bool DiskFull::is(int error) {
  return error == ENOSPC || error == EDQUOT || error == EFBIG;
}

DiskFull::DiskFull(fs::path file, const fs::path& shown, const std::string& what, int error)
    : OutputError("{}: no room for {}: {}; {}", shown.string(), what, std::strerror(error),
                  adviceFor(error, kMakeRoom)),
      file_(std::move(file)),
      error_(error) {}

std::string DiskFull::reason() const {
  return std::strerror(error_);
}

std::string DiskFull::advice(const std::string& of_full_disk) const {
  return adviceFor(error_, of_full_disk);
}

void failToRename(int error, const fs::path& from, const fs::path& to) {
  if (DiskFull::is(error)) throw DiskFull(to, to, "a new name", error);
  throw OutputError("{}: cannot be renamed to {}: {}", from.string(), to.string(), std::strerror(error));
}

OutputError RoomNeeded::error(const DiskFull& full) const {
  const fs::path file = wholePath(full.file());
  fs::path holds;
  for (const fs::path& folder : folders) {
    const fs::path whole = wholePath(folder);
    if (isIn(file, whole) && whole.native().size() > holds.native().size()) holds = whole;
  }
  if (holds.empty()) return OutputError(full.what());
  return OutputError("{}: no room for {}: {}; {}", holds.string(), what, full.reason(), full.advice(advice));
}

}  // namespace curvisplat
