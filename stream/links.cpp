#include "stream/links.h"

#include <system_error>

#include "stream/error.h"
#include "stream/file.h"

namespace curvisplat {

std::filesystem::path linkTarget(std::filesystem::path path) {
  constexpr int kMostLinks = 40;  // as the kernel
  const std::filesystem::path first = path;
  for (int links = 0; links <= kMostLinks; ++links) {
    std::error_code none_there;
    if (!std::filesystem::is_symlink(path, none_there)) return path;
    path = folderOf(path) / std::filesystem::read_symlink(path);  // which replaces all if it is absolute
  }
  throw Error("{}: is a link that leads round in a circle", first.string());
}

}  // namespace curvisplat
