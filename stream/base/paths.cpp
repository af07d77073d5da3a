#include "stream/base/paths.h"

#include <system_error>

#include "stream/base/error.h"
#include "stream/base/words.h"

namespace curvisplat {

std::filesystem::path folderOf(const std::filesystem::path& path) {
  return path.has_parent_path() ? path.parent_path() : std::filesystem::path(".");
}

std::string extensionOf(const std::filesystem::path& path) {
  return lowerCase(path.extension().string());
}

bool isRegularFile(const std::filesystem::path& path) noexcept {
  std::error_code ignored;
  return std::filesystem::is_regular_file(path, ignored);
}

std::filesystem::path linkTarget(std::filesystem::path path) {
  constexpr int kMaxLinks = 40;  // the kernel's limit
  const std::filesystem::path first = path;
  for (int links = 0; links <= kMaxLinks; ++links) {
    std::error_code ignored;
    if (!std::filesystem::is_symlink(path, ignored)) return path;
    path =
        folderOf(path) / std::filesystem::read_symlink(path);  // an absolute target replaces the whole path
  }
  throw Error("{}: its symbolic links form a cycle", first.string());
}

std::filesystem::path writableTarget(const std::filesystem::path& path) {
  const std::filesystem::path target = linkTarget(path);
  std::error_code ignored;
  if (std::filesystem::exists(target, ignored) && !isRegularFile(target))
    throw Error("{}: exists and is not a regular file; choose another name", path.string());
  return target;
}

}  // namespace curvisplat
