#include "stream/cache/cache_file.h"

#include "stream/base/error.h"

namespace curvisplat {

std::filesystem::path cacheFile(const std::filesystem::path& cache, const std::string& name) {
  namespace fs = std::filesystem;
  fs::path path = cache / name;
  std::error_code error;
  const fs::file_status status = fs::symlink_status(path, error);
  if (fs::is_symlink(status))
    throw Error(
        "{}: is a symbolic link; expected a file in the cache's own directory: replace the link by a copy",
        path.string());
  if (fs::exists(status) && !fs::is_regular_file(status))
    throw Error("{}: is not a regular file", path.string());
  return path;
}

std::filesystem::path cacheFolder(const std::filesystem::path& cache, const std::string& name) {
  namespace fs = std::filesystem;
  fs::path path = cache / name;
  std::error_code error;
  if (!fs::is_directory(fs::symlink_status(path, error)))
    throw Error("{}: is not a directory of the cache's own; the cache is damaged: convert again",
                path.string());
  return path;
}

}  // namespace curvisplat
