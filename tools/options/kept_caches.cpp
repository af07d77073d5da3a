#include "tools/options/kept_caches.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <memory>
#include <sstream>
#include <system_error>
#include <thread>

#include "preprocess/formats/open/open_grid.h"
#include "preprocess/formats/open/series_files.h"
#include "stream/base/checksum.h"
#include "stream/base/error.h"
#include "stream/base/file.h"
#include "tools/options/further_scalars.h"
#include "tools/options/option_parsers.h"

namespace curvisplat {
namespace {

namespace fs = std::filesystem;

constexpr uint64_t kDefaultLimit = uint64_t{20} << 30;
constexpr size_t kPiece = 4 << 20;

uint64_t checksumOfText(const std::string& text) {
  return checksumOf(std::as_bytes(std::span(text)));
}

/// What tells that a file is unchanged without reading it.
std::string stampOf(const fs::path& file) {
  struct stat found {};
  if (::stat(file.c_str(), &found) != 0) return {};
  return fmt::format("{} {} {} {} {}", found.st_size, found.st_mtim.tv_sec, found.st_mtim.tv_nsec,
                     found.st_ino, found.st_dev);
}

uint64_t checksumOfFile(const fs::path& path, Progress& progress) {
  const InputFile file(path);
  Checksum checksum;
  std::vector<std::byte> piece(kPiece);
  for (uint64_t at = 0; at < file.size(); at += piece.size()) {
    piece.resize(std::min<uint64_t>(kPiece, file.size() - at));
    file.readAt(at, std::span(piece));
    checksum.add(piece);
    progress.advance(piece.size());
  }
  return checksum.value();
}

/// The checksum of a file's bytes, from `known` if it has not changed since.
uint64_t checksumOf(const fs::path& path, const fs::path& known, Progress& progress) {
  std::error_code ignored;
  const fs::path whole = fs::weakly_canonical(path, ignored);
  const fs::path memo = known / fmt::format("{:016x}", checksumOfText(whole.string()));
  const std::string stamp = stampOf(path);
  if (fs::exists(memo, ignored)) {
    std::istringstream text(readTextFile(memo));
    std::string before;
    uint64_t checksum = 0;
    if (std::getline(text, before) && before == stamp && text >> checksum) return checksum;
  }
  const uint64_t checksum = checksumOfFile(path, progress);
  if (stampOf(path) == stamp) writeFileAtomically(memo, fmt::format("{}\n{}\n", stamp, checksum));
  return checksum;
}

/// A lock on the folder of one cache, which is waited for.
class MakingLock {
 public:
  MakingLock(const fs::path& file, const Progress& progress) {
    fd_ = ::open(file.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0666);
    if (fd_ < 0)
      throw Error("{}: cannot be opened: {}", file.string(), std::generic_category().message(errno));
    while (::flock(fd_, LOCK_EX | LOCK_NB) != 0) {
      if (errno != EWOULDBLOCK && errno != EINTR) break;  // a file system without locks
      try {
        progress.throwIfStopped();
      } catch (...) {
        ::close(fd_);
        throw;
      }
      std::this_thread::sleep_for(std::chrono::milliseconds(50));
    }
  }
  ~MakingLock() { ::close(fd_); }
  MakingLock(const MakingLock&) = delete;
  MakingLock& operator=(const MakingLock&) = delete;

 private:
  int fd_ = -1;
};

bool isBeingMade(const fs::path& used) {
  const int fd = ::open(used.c_str(), O_RDWR | O_CLOEXEC);
  if (fd < 0) return false;
  const bool locked = ::flock(fd, LOCK_EX | LOCK_NB) != 0 && errno == EWOULDBLOCK;
  ::close(fd);
  return locked;
}

uint64_t bytesIn(const fs::path& folder) {
  uint64_t bytes = 0;
  std::error_code error;
  for (fs::recursive_directory_iterator at(folder, error), end; !error && at != end; at.increment(error)) {
    std::error_code ignored;
    const uint64_t size = at->is_regular_file(ignored) ? at->file_size(ignored) : 0;
    if (!ignored) bytes += size;
  }
  return bytes;
}

bool isSmallText(const fs::path& file, std::string& text) {
  constexpr uint64_t kMaxText = 4 << 20;
  std::error_code error;
  if (fs::file_size(file, error) > kMaxText || error) return false;
  text = readTextFile(file);
  const size_t first = text.find_first_not_of(" \t\r\n");
  return first != std::string::npos && (text[first] == '<' || text[first] == '{');
}

/// Adds `file`: of a folder all files; and those that a small text (.pvd, .vtm, .p3d) names between quotes.
void addFilesOf(const fs::path& file, std::vector<fs::path>& all, int depth = 0) {
  std::error_code error;
  if (fs::is_directory(file, error)) {
    const auto begin = static_cast<std::ptrdiff_t>(all.size());
    for (fs::recursive_directory_iterator at(file, error), end; !error && at != end; at.increment(error))
      if (std::error_code no_file; at->is_regular_file(no_file)) all.push_back(at->path());
    std::sort(all.begin() + begin, all.end());
    return;
  }
  all.push_back(file);
  constexpr int kMaxDepth = 3;  // a .pvd of .vtm of .vts
  std::string text;
  if (depth == kMaxDepth || !isSmallText(file, text)) return;
  for (size_t begin = text.find('"'); begin != std::string::npos;) {
    const size_t end = text.find('"', begin + 1);
    if (end == std::string::npos) return;
    const std::string word = text.substr(begin + 1, std::min<size_t>(end - begin - 1, 4096));
    const fs::path named = file.parent_path() / word;
    if (word.find('.') != std::string::npos && fs::is_regular_file(named, error) && named != file)
      addFilesOf(named, all, depth + 1);
    begin = text.find('"', end + 1);
  }
}

/// What makes two grids the same: the program, the bytes of the files, and their names, since names of scalars can lie
/// beside a file, and the grid's name becomes the cache's.
uint64_t contentsOf(const std::vector<fs::path>& files, const fs::path& known, Progress& progress) {
  progress.begin("looking for a kept cache", 0, "bytes");
  std::vector<fs::path> all;
  for (const fs::path& file : files) addFilesOf(file, all);
  std::string contents = CURVISPLAT_VERSION;
  for (const fs::path& file : all) contents += fmt::format(" {:016x}", checksumOf(file, known, progress));
  contents += ' ';
  contents += namesOf(files);
  return checksumOfText(contents);
}

/// The files as paths that hold in any folder, with those that match a pattern.
std::vector<fs::path> wholePaths(const std::vector<fs::path>& given) {
  OpenGridOptions options;
  options.grid = given.front();
  options.solutions.assign(given.begin() + 1, given.end());
  expandPatterns(options);
  std::vector<fs::path> files{options.grid};
  files.insert(files.end(), options.solutions.begin(), options.solutions.end());
  for (fs::path& file : files) {
    file = fs::absolute(file).lexically_normal();
    if (!file.has_filename()) file = file.parent_path();  // "case/"
  }
  return files;
}

uint64_t limitOfFolder() {
  const char* const limit = std::getenv("CURVISPLAT_CACHE_SIZE");
  return limit && *limit ? parseMemory("CURVISPLAT_CACHE_SIZE", limit) : kDefaultLimit;
}

}  // namespace

std::optional<fs::path> keptFolder() {
  const char* const cache = std::getenv("XDG_CACHE_HOME");
  if (cache && *cache == '/') return fs::path(cache) / "curvisplat";
  const char* const home = std::getenv("HOME");
  if (home && *home) return fs::path(home) / ".cache" / "curvisplat";
  return std::nullopt;
}

bool isGrid(const std::vector<fs::path>& files) {
  std::error_code ignored;
  if (files.size() > 1 || fs::is_regular_file(files.front(), ignored) || isGridFolder(files.front()))
    return true;
  // A quoted pattern of a series' files.
  return !fs::exists(files.front(), ignored) &&
         files.front().string().find_first_of("*?%") != std::string::npos;
}

std::string namesOf(const std::vector<fs::path>& files) {
  std::string names;
  for (const fs::path& file : files) {
    if (!names.empty()) names += ' ';
    names += file.filename().string();
  }
  return names;
}

fs::path keptCacheOf(const std::vector<fs::path>& given_files, Progress& progress,
                     const KeptCacheEvents& events, const std::vector<std::string>& scalars,
                     ValuePrecision precision) {
  const auto folder = keptFolder();
  if (!folder)
    throw Error(
        "{}: cannot find the user's cache folder: neither XDG_CACHE_HOME nor HOME is set; use convert",
        given_files.front().string());
  const uint64_t limit = limitOfFolder();
  std::error_code error;
  fs::create_directories(*folder / "known", error);
  if (error) throw Error("{}: cannot create the directory: {}", folder->string(), error.message());
  const std::vector<fs::path> files = wholePaths(given_files);
  const uint64_t contents = contentsOf(files, *folder / "known", progress);
  const char* const suffix = precision == ValuePrecision::kFine ? "-fine" : "";
  const fs::path place = *folder / fmt::format("{:016x}{}", contents, suffix);
  const fs::path cache = place / (files.front().stem().string() + ".splats");
  fs::create_directories(place, error);
  if (error) throw Error("{}: cannot create the directory: {}", place.string(), error.message());
  {
    const MakingLock lock(place / "used", progress);
    if (!fs::exists(cache / "manifest.json", error)) makeKeptCache(files, cache, progress, events, precision);
    addMissingScalars(cache, files, scalars, progress);
    fs::last_write_time(place / "used", fs::file_time_type::clock::now(), error);
  }
  limitKeptCaches(*folder, limit, place);
  return cache;
}

void limitKeptCaches(const fs::path& folder, uint64_t limit, const fs::path& kept) {
  struct Kept {
    fs::path place;
    fs::file_time_type used;
    uint64_t bytes;
  };
  std::vector<Kept> all;
  uint64_t total = 0;
  std::error_code error;
  for (fs::directory_iterator at(folder, error), end; !error && at != end; at.increment(error)) {
    std::error_code no_file;
    const auto used = fs::last_write_time(at->path() / "used", no_file);
    if (no_file) continue;  // not one of ours
    all.push_back({at->path(), used, bytesIn(at->path())});
    total += all.back().bytes;
  }
  std::sort(all.begin(), all.end(), [](const Kept& a, const Kept& b) { return a.used < b.used; });
  for (const Kept& one : all) {
    if (total <= limit) return;
    if (one.place == kept || isBeingMade(one.place / "used")) continue;
    fs::remove_all(one.place, error);
    if (!error) total -= one.bytes;
  }
}

}  // namespace curvisplat
