#include "tools/options/kept_caches.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <fnmatch.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <fstream>
#include <iterator>
#include <limits>
#include <memory>
#include <optional>
#include <set>
#include <sstream>
#include <system_error>
#include <thread>
#include <utility>

#include "preprocess/formats/common/byte_source.h"
#include "preprocess/formats/common/library_trial.h"
#include "preprocess/formats/common/temporary_folder.h"
#include "preprocess/formats/common/unpacked_file.h"
#include "preprocess/formats/open/open_grid.h"
#include "preprocess/formats/open/series_files.h"
#include "preprocess/formats/openfoam/foam_case.h"
#include "preprocess/formats/openfoam/foam_source.h"
#include "stream/base/checksum.h"
#include "stream/base/durable_file.h"
#include "stream/base/error.h"
#include "stream/base/file.h"
#include "stream/base/text.h"
#include "stream/base/watched_file.h"
#include "tools/options/further_scalars.h"
#include "tools/options/option_parsers.h"

namespace curvisplat {
namespace {

namespace fs = std::filesystem;

constexpr uint64_t kDefaultLimit = uint64_t{20} << 30;
constexpr size_t kPiece = 4 << 20;
constexpr size_t kMaxName = 4096;

uint64_t checksumOfText(const std::string& text) {
  return checksumOf(std::as_bytes(std::span(text)));
}

/// A file's state, as notes have it.
std::string stampOf(const fs::path& file) {
  const FileState state = FileState::of(file);
  constexpr int64_t kNanoseconds = 1'000'000'000;
  return fmt::format("{} {} {} {} {}", state.bytes, state.changed_ns / kNanoseconds,
                     state.changed_ns % kNanoseconds, state.number, state.device);
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

/// The file in which a file's checksum and its stamp are noted.
fs::path memoOf(const fs::path& path, const fs::path& known) {
  std::error_code ignored;
  return known / fmt::format("{:016x}", checksumOfText(fs::weakly_canonical(path, ignored).string()));
}

/// A note of a file: the checksum of its bytes, and the files that it leads to (tryHdf5()).
struct FileNote {
  uint64_t checksum = 0;
  std::set<fs::path> linked = {};
};

std::optional<FileNote> notedOf(const fs::path& memo, const std::string& stamp) {
  constexpr uint64_t kMaxMemo = 16 << 20;  // the names of thousands of linked files
  std::error_code error;
  if (!fs::is_regular_file(memo, error)) return std::nullopt;
  try {
    std::istringstream text(readTextFile(memo, kMaxMemo));
    std::string before, linked;
    FileNote note;
    size_t count = 0;
    // A note that a power loss has cut short has no line's end.
    if (!std::getline(text, before) || before != stamp || !(text >> note.checksum >> count) ||
        text.get() != '\n')
      return std::nullopt;
    while (std::getline(text, linked) && !text.eof()) note.linked.insert(linked);
    if (note.linked.size() == count) return note;
  } catch (const Error&) {
    // The file's own bytes are as good.
  }
  return std::nullopt;
}

/// Notes it for the next process. Several processes may open one file for the first time, so it is written under
/// another name first. A note that cannot be written, or that a power loss takes, is missed by the next process only; so none is synced,
/// which would take longer than all else where there are thousands.
void note(const fs::path& memo, const std::string& stamp, const FileNote& of_file) {
  const fs::path written = memo.string() + fmt::format(".{}", ::getpid());
  std::ofstream out(written);
  out << fmt::format("{}\n{} {}\n", stamp, of_file.checksum, of_file.linked.size());
  for (const fs::path& linked : of_file.linked) out << linked.string() << '\n';
  out.close();
  std::error_code error;
  fs::rename(written, memo, error);
  if (error) fs::remove(written, error);
}

/// The files that a file of HDF5 leads to, from `known` if it has not changed since; nullopt where it leads out of its folder, or is
/// damaged: whoever opens it reports that.
std::optional<std::set<fs::path>> linkedBy(const fs::path& path, const fs::path& known) {
  try {
    if (!isHdf5(InputFile(path))) return std::set<fs::path>{};
    if (const auto noted = notedOf(memoOf(path, known), stampOf(path))) return noted->linked;
    tryHdf5(path);
    return linkedFilesOf(path);
  } catch (const Error&) {
    return std::nullopt;
  }
}

/// The checksum of a file's bytes, from `known` if it has not changed since. `stamp`: of the file, before.
uint64_t checksumOf(const fs::path& path, const std::string& stamp, const fs::path& known,
                    Progress& progress) {
  const fs::path memo = memoOf(path, known);
  if (const auto noted = notedOf(memo, stamp)) return noted->checksum;
  const uint64_t checksum = checksumOfFile(path, progress);
  if (const auto linked = linkedBy(path, known); linked && stampOf(path) == stamp)
    note(memo, stamp, {checksum, *linked});
  return checksum;
}

constexpr const char* kUsed = "used";  // the file that is locked; its date is when the cache was used last

/// A lock on the folder of one cache, which is made and waited for.
class MakingLock {
 public:
  MakingLock(const fs::path& place, const Progress& progress) : file_(place / kUsed) {
    do {
      makePrivateFolders(place);
      if (fd_ >= 0) ::close(fd_);
      fd_ = ::open(file_.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0666);
      if (fd_ < 0 && errno == ENOENT) continue;
      if (fd_ < 0)
        throw Error("{}: cannot be opened: {}", file_.string(), std::generic_category().message(errno));
      wait(progress);
    } while (!isLocked());
  }
  ~MakingLock() { ::close(fd_); }
  MakingLock(const MakingLock&) = delete;
  MakingLock& operator=(const MakingLock&) = delete;

  /// Removes the folder if nothing else is in it. Whoever waits for the lock then makes it again.
  void removeEmptyFolder() {
    std::error_code error;
    const fs::path place = file_.parent_path();
    if (std::distance(fs::directory_iterator(place, error), {}) == 1 && fs::remove(file_, error))
      fs::remove(place, error);
  }

 private:
  void wait(const Progress& progress) {
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
  /// Whether the file still has its name.
  bool isLocked() const {
    struct stat ours {
    }, named{};
    return fd_ >= 0 && ::fstat(fd_, &ours) == 0 && ::stat(file_.c_str(), &named) == 0 &&
           ours.st_ino == named.st_ino && ours.st_dev == named.st_dev;
  }

  const fs::path file_;
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

constexpr uint64_t kMaxText = 4 << 20;

/// The text of a small file, which may be compressed; empty for others.
std::string smallText(const fs::path& file) {
  constexpr uint64_t kMaxPacked = 256 << 10;
  std::error_code error;
  const uint64_t bytes = fs::file_size(file, error);
  if (error || bytes > kMaxText) return "";
  if (!UnpackedFile::recognises(InputFile(file))) return readTextFile(file);
  if (bytes > kMaxPacked) return "";
  const UnpackedFile unpacked(file, systemTemporaryFolder());
  return fs::file_size(unpacked.path(), error) > kMaxText || error ? "" : readTextFile(unpacked.path());
}

/// The words that may be names of files in a text: what stands between the quotes of XML (.pvd, .vtm) and
/// JSON (.p3d), and the words of an EnSight case.
std::set<std::string> fileNamesIn(const std::string& text) {
  std::set<std::string> names;
  const std::string_view begin = trimmed(text).substr(0, 6);
  if (isSameIgnoringCase(begin, "format"))
    for (std::string_view word : wordsOf(text)) {
      if (word.size() > 2 && word.starts_with('"') && word.ends_with('"'))
        word = word.substr(1, word.size() - 2);
      names.emplace(word.substr(0, kMaxName));
    }
  if (!begin.starts_with('<') && !begin.starts_with('{')) return names;
  for (size_t from = text.find('"'); from != std::string::npos;) {
    const size_t to = text.find('"', from + 1);
    if (to == std::string::npos) break;
    std::string word = text.substr(from + 1, std::min(to - from - 1, kMaxName));
    if (word.find('.') != std::string::npos) names.insert(std::move(word));
    from = text.find('"', to + 1);
  }
  return names;
}

/// The files beside `file` that it calls `name`; a star stands for the digits of a step's number.
std::vector<fs::path> filesNamed(const std::string& name, const fs::path& file) {
  std::vector<fs::path> found;
  const fs::path path = file.parent_path() / name;
  if (leadsOut(folderOf(file), name)) return found;  // nor does a reader follow it
  std::error_code error;
  if (name.find('*') == std::string::npos) {
    if (fs::is_regular_file(path, error)) found.push_back(path);
    return found;
  }
  const std::string pattern = path.filename().string();
  for (fs::directory_iterator at(folderOf(path), error), end; !error && at != end; at.increment(error))
    if (::fnmatch(pattern.c_str(), at->path().filename().c_str(), 0) == 0) found.push_back(at->path());
  std::sort(found.begin(), found.end());
  return found;
}

/// A grid's files with those that they name or link to, and when these were changed last.
class StampedFiles {
 public:
  /// `known`: the folder of notes. Throws Interrupted.
  StampedFiles(const std::vector<fs::path>& files, const fs::path& known, const Progress& progress)
      : known_(known), progress_(progress) {
    for (const fs::path& file : files) add(file, 0);
    for (const fs::path& file : all_) stamps_.push_back(stampOf(file));
  }

  const std::vector<fs::path>& all() const { return all_; }
  const std::vector<std::string>& stamps() const { return stamps_; }  // [file]
  /// Folders of times that are not read, within their case.
  const std::vector<std::string>& timesLeftOut() const { return times_left_out_; }

 private:
  /// Adds `file`: of a folder all files (of a case of OpenFOAM those that are read); and those that a small text names. At each depth a
  /// file is looked at once: a text may name another one, which does the same, thousands of times.
  void add(const fs::path& file, int depth) {
    progress_.throwIfStopped();
    std::error_code error;
    if (isFoamCase(file)) return addCase(foamCaseOf(file).folder);
    if (fs::is_directory(file, error)) return addFolder(file);
    if (!seen_.emplace(depth, file.lexically_normal()).second) return;
    all_.push_back(file);
    if (const auto files = linkedBy(file, known_))
      for (const fs::path& linked : *files)
        if (fs::is_regular_file(linked, error)) add(linked, depth);
    constexpr int kMaxDepth = 3;  // a .pvd of .vtm of .vts
    if (depth == kMaxDepth) return;
    constexpr size_t kMaxPatterns = 1000;  // each lists a folder
    size_t patterns = 0;
    for (const std::string& name : fileNamesIn(smallText(file))) {
      if (name.find('*') != std::string::npos && ++patterns > kMaxPatterns) continue;
      for (const fs::path& named : filesNamed(name, file))
        if (named != file) add(named, depth + 1);
    }
  }

  /// Adds the files of a case of OpenFOAM, which a file or a region's folder may stand for, but not those of times behind the first one,
  /// which are not read: there may be thousands. The names of these times count, since they decide whether the case's own times or those
  /// of its processors are read.
  void addCase(const fs::path& folder) {
    std::vector<fs::path> roots{folder};
    std::error_code error;
    for (const auto& entry : fs::directory_iterator(folder, error))
      if (entry.path().filename().string().starts_with("processor") && entry.is_directory(error))
        roots.push_back(entry.path());
    std::set<fs::path> first_ones;
    std::set<fs::path> later;
    for (const fs::path& root : roots) {
      const auto times = foamTimesIn(root);
      if (!times.empty()) first_ones.insert(times.front().second);
      for (const auto& time : times) later.insert(root / time.second);
    }
    std::erase_if(later, [&](const fs::path& time) { return first_ones.contains(time.filename()); });
    for (const fs::path& time : later) times_left_out_.push_back(time.lexically_relative(folder).string());
    std::set<fs::path> read = first_ones;
    read.insert({"constant", "system"});
    std::set<fs::path> apart = std::move(later);
    for (const fs::path& root : roots)
      for (const fs::path& name : read) {
        addFolder(root / name);
        apart.insert(root / name);
      }
    // Values may include other files, which are small texts.
    for (const char* const written : {"postProcessing", "VTK", "dynamicCode"}) apart.insert(folder / written);
    addFolder(folder, apart, kMaxText);
  }

  void addFolder(const fs::path& folder, const std::set<fs::path>& left_out = {},
                 uint64_t most = std::numeric_limits<uint64_t>::max()) {
    std::error_code error;
    const auto begin = static_cast<std::ptrdiff_t>(all_.size());
    for (fs::recursive_directory_iterator at(folder, error), end; !error && at != end; at.increment(error)) {
      progress_.throwIfStopped();
      if (left_out.contains(at->path())) at.disable_recursion_pending();
      if (std::error_code no_file; at->is_regular_file(no_file) && at->file_size(no_file) <= most)
        all_.push_back(at->path());
    }
    std::sort(all_.begin() + begin, all_.end());
  }

  const fs::path known_;
  const Progress& progress_;
  std::set<std::pair<int, fs::path>> seen_;
  std::vector<fs::path> all_;
  std::vector<std::string> stamps_, times_left_out_;
};

/// A checksum of what makes two grids the same: the program, the bytes of the files, and their names, since
/// names of scalars can lie beside a file, and the grid's name becomes the cache's.
uint64_t contentsOf(const std::vector<fs::path>& files, const StampedFiles& stamped, const fs::path& known,
                    Progress& progress) {
  progress.begin("looking for a kept cache", 0, "bytes");
  std::string contents = CURVISPLAT_VERSION;
  for (size_t n = 0; n < stamped.all().size(); ++n)
    contents += fmt::format(" {:016x}", checksumOf(stamped.all()[n], stamped.stamps()[n], known, progress));
  for (const std::string& time : stamped.timesLeftOut()) contents += ' ' + time;
  contents += ' ';
  contents += namesOf(files);
  return checksumOfText(contents);
}

/// A mark beside a cache whose files changed while it was made: shown now, and made again when they are
/// opened next.
constexpr const char* kChanged = "changed";

void removeChanged(const fs::path& place, const fs::path& cache) {
  std::error_code error;
  if (!fs::exists(place / kChanged, error)) return;
  fs::remove_all(cache, error);  // of a series, the link to it
  fs::remove(place / kChanged, error);
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
  makePrivateFolders(*folder / "known");  // a grid may be its owner's alone to read
  const std::vector<fs::path> files = wholePaths(given_files);
  const fs::path known = *folder / "known";
  const StampedFiles stamped(files, known, progress);
  const uint64_t contents = contentsOf(files, stamped, known, progress);
  const fs::path place = *folder / fmt::format("{:016x}-{}", contents, wordOf(precision));
  const fs::path cache = place / (files.front().stem().string() + ".splats");
  MakingLock lock(place, progress);
  try {
    removeChanged(place, cache);
    if (!fs::exists(cache / "manifest.json", error)) {
      makeKeptCache(files, cache, progress, events, scalars, precision);
      if (const StampedFiles now(files, known, progress);
          now.all() != stamped.all() || now.stamps() != stamped.stamps()) {
        writeFileDurably(place / kChanged, "");
        events.say(fmt::format(
            "warning: {}: changed while it was converted; it is converted again when it is opened next",
            namesOf(files)));
      }
    }
    addMissingScalars(cache, files, scalars, progress);
    fs::last_write_time(place / kUsed, fs::file_time_type::clock::now(), error);
  } catch (...) {
    lock.removeEmptyFolder();
    throw;
  }
  limitKeptCaches(*folder, limit, place);
  return cache;
}

void limitKeptCaches(const fs::path& folder, uint64_t limit, const fs::path& kept) {
  struct CacheEntry {
    fs::path place;
    fs::file_time_type used;
    uint64_t bytes;
  };
  std::vector<CacheEntry> all;
  uint64_t total = 0;
  std::error_code error;
  for (fs::directory_iterator at(folder, error), end; !error && at != end; at.increment(error)) {
    std::error_code no_file;
    const auto used = fs::last_write_time(at->path() / kUsed, no_file);
    if (no_file) continue;  // not one of ours
    all.push_back({at->path(), used, bytesIn(at->path())});
    total += all.back().bytes;
  }
  std::sort(all.begin(), all.end(), [](const CacheEntry& a, const CacheEntry& b) { return a.used < b.used; });
  for (const CacheEntry& one : all) {
    if (total <= limit) return;
    if (one.place == kept || isBeingMade(one.place / kUsed)) continue;
    fs::remove_all(one.place, error);
    if (!error) total -= one.bytes;
  }
}

}  // namespace curvisplat
