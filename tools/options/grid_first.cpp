#include "tools/options/grid_first.h"

#include <algorithm>

#include "stream/base/error.h"
#include "tools/options/convert_arguments.h"
#include "tools/options/kept_caches.h"

namespace curvisplat {
namespace {

constexpr size_t kMaxFiles = 8;

bool opens(const std::vector<std::filesystem::path>& files) {
  ConvertArguments arguments;
  arguments.grid.grid = files.front();
  arguments.grid.solutions.assign(files.begin() + 1, files.end());
  try {
    openSource(arguments, keptFolder().value_or(std::filesystem::temp_directory_path()) / "any.splats");
    return true;
  } catch (const Error&) {
    return false;
  }
}

}  // namespace

std::optional<std::vector<std::filesystem::path>> gridFirst(std::vector<std::filesystem::path> files,
                                                            const Progress& progress) {
  if (files.size() < 2 || files.size() > kMaxFiles || opens(files)) return std::nullopt;
  for (size_t n = 1; n < files.size(); ++n) {
    progress.throwIfStopped();
    std::rotate(files.begin(), files.begin() + static_cast<std::ptrdiff_t>(n),
                files.begin() + static_cast<std::ptrdiff_t>(n) + 1);
    if (opens(files)) return files;
    std::rotate(files.begin(), files.begin() + 1, files.begin() + static_cast<std::ptrdiff_t>(n) + 1);
  }
  return std::nullopt;
}

}  // namespace curvisplat
