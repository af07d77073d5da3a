#include "tests/support/temporary_folder.h"

#include <poll.h>
#include <sys/inotify.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdlib>
#include <fstream>
#include <iterator>
#include <stdexcept>
#include <system_error>

namespace curvisplat {
namespace {

namespace fs = std::filesystem;

constexpr int kLongestSilenceMs = 60'000;

}  // namespace

TemporaryFolder::TemporaryFolder() {
  std::string name = (std::filesystem::temp_directory_path() / "curvisplat_test_XXXXXX").string();
  if (mkdtemp(name.data()) == nullptr) throw std::system_error(errno, std::generic_category(), name);
  path_ = name;
}

TemporaryFolder::~TemporaryFolder() {
  std::error_code ignored;
  std::filesystem::remove_all(path_, ignored);
}

Files filesOf(const fs::path& folder) {
  Files files;
  for (const auto& entry : fs::directory_iterator(folder))
    if (entry.is_regular_file()) files[entry.path().filename().string()] = bytesOfFile(entry.path());
  return files;
}

Files allFilesOf(const fs::path& folder) {
  Files files;
  for (const auto& entry : fs::recursive_directory_iterator(folder)) {
    const std::string name = entry.path().lexically_relative(folder).string();
    if (entry.is_directory())
      files[name + "/"] = "";
    else
      files[name] = bytesOfFile(entry.path());
  }
  return files;
}

std::string bytesOfFile(const fs::path& path) {
  std::ifstream file(path, std::ios::binary | std::ios::ate);
  const std::streamoff size = file.tellg();
  if (size < 0) {  // no such file, or one of /proc, which have no end
    file = std::ifstream(path, std::ios::binary);
    return {std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
  }
  std::string bytes(static_cast<size_t>(size), '\0');
  file.seekg(0);
  file.read(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  bytes.resize(static_cast<size_t>(file.gcount()));
  return bytes;
}

void overwriteFile(const fs::path& path, const std::string& bytes) {
  std::ofstream(path, std::ios::binary | std::ios::trunc) << bytes;
}

size_t entriesOf(const fs::path& folder) {
  return static_cast<size_t>(std::distance(fs::directory_iterator(folder), fs::directory_iterator()));
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

FolderWatch::FolderWatch(const std::filesystem::path& folder) : fd_(::inotify_init1(IN_CLOEXEC)) {
  if (fd_ < 0 || ::inotify_add_watch(fd_, folder.c_str(), IN_CREATE | IN_MODIFY | IN_MOVED_TO) < 0)
    throw std::system_error(errno, std::generic_category(), "inotify: " + folder.string());
}

FolderWatch::~FolderWatch() {
  ::close(fd_);
}

void FolderWatch::waitUntil(const std::function<bool()>& happened) {
  while (!happened()) {
    pollfd waiting{fd_, POLLIN, 0};
    if (::poll(&waiting, 1, kLongestSilenceMs) == 0)
      throw std::runtime_error("what was waited for did not happen");
    std::array<char, 4096> events;
    if (::read(fd_, events.data(), events.size()) < 0 && errno != EINTR)
      throw std::system_error(errno, std::generic_category(), "inotify");
  }
}

}  // namespace curvisplat
