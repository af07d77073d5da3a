// Creates temporary files under names that nothing has yet: in a folder that others may write to, a file or a link
// that someone has put there beforehand is never opened.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>

namespace curvisplat {

/// A file that has just been created, empty, open for reading and writing. Whoever gets it closes `fd`.
struct NewFile {
  std::filesystem::path path;
  int fd = -1;  // -1: no file can be created; errno says why
};

/// Creates a file with open(2)'s `mode`. `name`: a path for a random number; it is called again while something, a
/// link included, has the name.
NewFile createNewFile(const std::function<std::filesystem::path(uint32_t random)>& name, unsigned mode);

}  // namespace curvisplat
