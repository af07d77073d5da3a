#include "tests/support/folder_files.h"

#include <algorithm>
#include <fstream>
#include <iterator>

namespace curvisplat {

namespace fs = std::filesystem;

Files filesOf(const fs::path& folder) {
  Files files;
  for (const auto& entry : fs::directory_iterator(folder)) {
    if (!entry.is_regular_file()) continue;
    std::ifstream file(entry.path(), std::ios::binary);
    files[entry.path().filename().string()] = {std::istreambuf_iterator<char>(file), {}};
  }
  return files;
}

bool holdsAllOf(const Files& files, const Files& expected) {
  return std::all_of(expected.begin(), expected.end(), [&](const auto& file) {
    const auto found = files.find(file.first);
    return found != files.end() && found->second == file.second;
  });
}

void writeFiles(const fs::path& folder, const Files& files) {
  fs::remove_all(folder);
  fs::create_directories(folder);
  for (const auto& [name, bytes] : files) std::ofstream(folder / name, std::ios::binary) << bytes;
}

}  // namespace curvisplat
