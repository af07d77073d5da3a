#include "stream/base/paths.h"

#include <system_error>

#include "stream/base/error.h"

namespace curvisplat {

std::filesystem::path folderOf(const std::filesystem::path& path) {
  return path.has_parent_path() ? path.parent_path() : std::filesystem::path(".");
}

bool isRegularFile(const std::filesystem::path& path) noexcept {
  std::error_code none_there;
  return std::filesystem::is_regular_file(path, none_there);
}

std::filesystem::path linkTarget(std::filesystem::path path) {
  constexpr int kMaxLinks = 40;  // as the kernel
  const std::filesystem::path first = path;
  for (int links = 0; links <= kMaxLinks; ++links) {
    std::error_code none_there;
    if (!std::filesystem::is_symlink(path, none_there)) return path;
    path = folderOf(path) / std::filesystem::read_symlink(path);  // which replaces all if it is absolute
  }
  throw Error("{}: is a link that leads round in a circle", first.string());
}

std::filesystem::path writableTarget(const std::filesystem::path& path) {
  const std::filesystem::path target = linkTarget(path);
  std::error_code none_there;
  if (std::filesystem::exists(target, none_there) && !isRegularFile(target))
    throw Error("{}: is there, and is no regular file; choose another name", path.string());
  return target;
}

}  // namespace curvisplat
