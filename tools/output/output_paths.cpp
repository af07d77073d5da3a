#include "tools/output/output_paths.h"

#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <string>
#include <system_error>

#include "stream/base/durable_file.h"
#include "stream/base/error.h"
#include "stream/base/paths.h"

namespace curvisplat {

void checkOutputFolder(std::string_view option, const std::filesystem::path& path, std::string_view suffix) {
  const std::filesystem::path folder = folderOf(path);
  std::error_code ignored;
  if (!std::filesystem::is_directory(folder, ignored))
    throw Error("{} {}: the directory {} does not exist; create it first", option, path.string(),
                folder.string());
  if (::access(folder.c_str(), W_OK | X_OK) != 0)
    throw Error("{} {}: the directory {} is not writable: {}; choose another", option, path.string(),
                folder.string(), std::strerror(errno));
  std::error_code error;
  static_cast<void>(std::filesystem::symlink_status(path.string().append(suffix), error));
  if (error != std::errc::filename_too_long) return;
  const long most = ::pathconf(folder.c_str(), _PC_NAME_MAX);
  const size_t bytes = path.filename().string().size() + suffix.size();
  if (most > 0 && bytes > static_cast<size_t>(most))
    throw Error("{} {}: the name is too long; choose one that is {} bytes shorter", option, path.string(),
                bytes - static_cast<size_t>(most));
  throw Error("{} {}: the name is too long; choose a shorter one", option, path.string());
}

void checkOutputFile(std::string_view option, const std::filesystem::path& path,
                     const std::vector<std::filesystem::path>& others) {
  namespace fs = std::filesystem;
  checkOutputFolder(option, path);
  std::error_code ignored;
  fs::path target;
  try {
    target = fs::weakly_canonical(writableTarget(path), ignored);
  } catch (const Error& error) {
    throw Error("{} {}", option, error.what());
  }
  if (target != path) checkOutputFolder(option, target);
  removeAbandonedFiles(folderOf(target));
  for (const fs::path& other : others) {
    if (other.empty()) continue;
    const fs::path there = fs::weakly_canonical(linkTarget(other), ignored);
    if (there == target || fs::equivalent(target, there, ignored) ||
        fs::equivalent(target.parent_path(), there, ignored))
      throw Error("{} {}: would overwrite {}; choose another name", option, path.string(), other.string());
  }
}

}  // namespace curvisplat
