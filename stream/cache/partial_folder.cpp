#include "stream/cache/partial_folder.h"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <fmt/format.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <optional>
#include <regex>
#include <span>
#include <string>
#include <utility>

#include "stream/base/checksum.h"
#include "stream/base/disk_space.h"
#include "stream/base/error.h"
#include "stream/base/file.h"
#include "stream/cache/cache_format.h"
#include "stream/cache/manifest.h"

namespace curvisplat {
namespace {

namespace fs = std::filesystem;

std::string reason() {
  return std::strerror(errno);
}

fs::path withSuffix(fs::path path, const char* suffix) {
  path += suffix;
  return path;
}

/// "cache/" has an empty file name: without the slash, suffixes are added to "cache".
fs::path withoutSlash(fs::path path) {
  return path.has_filename() ? std::move(path) : path.parent_path();
}

fs::path partialOf(const fs::path& target) {
  return withSuffix(withoutSlash(target), kPartialSuffix);
}

/// removeAll() of a folder, its mark last: killed meanwhile, it leaves a folder that the next conversion
/// removes.
std::error_code removeMarked(const fs::path& path) {
  std::error_code error, first;
  for (fs::directory_iterator entry(path, error), end; !error && entry != end; entry.increment(error))
    if (entry->path().filename() != kPartialLock)
      if (const std::error_code inside = removeAll(entry->path()); !first) first = inside;
  return first ? first : removeAll(path);
}

void requireRemoved(std::error_code error, const fs::path& path, const char* what) {
  if (error) throw OutputError("{}: the {} cannot be removed: {}", path.string(), what, error.message());
}

}  // namespace

bool isCacheFile(const fs::directory_entry& entry) {
  if (fs::is_directory(entry.symlink_status())) return false;
  static const std::regex own(
      R"((manifest\.json|bricks\.(bin|vdb|log)|(geometry|steps|walls|faces(\.(blanks|(var|step)\d+))?|var(\.\d+){1,2})\.bin|lock|journal)(\.part)?)");
  return std::regex_match(entry.path().filename().string(), own);
}

namespace {

/// Whether the program gives such a name to a folder in a cache.
bool isOwnFolder(const std::string& name) {
  static const std::regex own(R"((geometry|blanks)\.\d+(\.partial)?)");
  return std::regex_match(name, own);
}

void addForeignNames(const fs::path& folder, const fs::path& place, std::vector<fs::path>& names) {
  for (const auto& entry : fs::directory_iterator(folder)) {
    const fs::path name = entry.path().filename();
    const bool is_folder = fs::is_directory(entry.symlink_status());
    if (is_folder && place.empty() && isOwnFolder(name.string()))
      addForeignNames(entry.path(), name, names);
    else if (!isCacheFile(entry))
      names.push_back(place / name);
  }
}

/// `path`, or the first of PATH.1, PATH.2, ... if there is something of this name.
fs::path freeName(const fs::path& path) {
  std::error_code error;
  fs::path name = path;
  for (unsigned n = 1; fs::exists(fs::symlink_status(name, error)); ++n)
    name = withSuffix(path, fmt::format(".{}", n).c_str());
  return name;
}

/// Moves what a user has put into `old` into `target`, for ever. Names that are taken there get a number.
void moveForeign(const fs::path& old, const fs::path& target) {
  const std::vector<fs::path> names = foreignNames(old);
  for (const fs::path& name : names) {
    std::error_code error;
    const bool has_place = fs::is_directory(target / name.parent_path(), error);
    const fs::path from = old / name, to = freeName(target / (has_place ? name : name.filename()));
    if (SystemCalls::current().rename(from.c_str(), to.c_str()) < 0) failToRename(errno, from, to);
  }
  if (!names.empty()) syncDirectory(target);
}

/// Text of the lock in `folder`; nullopt if it is missing, no regular file or too long for a mark. Throws
/// Error if it cannot be read.
std::optional<std::string> lockText(const fs::path& folder) {
  const fs::path lock = folder / kPartialLock;
  std::error_code error;
  if (!fs::is_regular_file(fs::symlink_status(lock, error)) ||
      fs::file_size(lock, error) > kPartialMark.size())
    return std::nullopt;
  return readTextFile(lock);
}

bool isMarked(const fs::path& folder) {
  return lockText(folder) == kPartialMark;
}

/// Whether a conversion to `target` has made the folder `path` and may empty it; not if it is a link.
bool isOurs(const fs::path& path, const fs::path& target) {
  std::error_code error;
  if (!fs::is_directory(fs::symlink_status(path, error))) return false;
  if (isMarked(path)) return true;
  // Killed while it put the cache into place, it leaves the mark there, and the old cache here.
  if (isMarked(target) && fs::exists(path / "manifest.json", error)) return true;
  // Killed between making the folder and marking it: empty, or with a lock that has a part of the mark.
  for (fs::directory_iterator entry(path, error), end; !error && entry != end; entry.increment(error))
    if (entry->path().filename() != kPartialLock) return false;
  if (error) return false;
  if (!fs::exists(fs::symlink_status(path / kPartialLock, error))) return true;
  const std::optional<std::string> text = lockText(path);
  return text && kPartialMark.starts_with(*text);
}

/// Why this user may not remove a folder with what is in it: an error of errno, or 0.
int whyUnremovable(const fs::path& folder) {
  if (::faccessat(AT_FDCWD, folder.c_str(), W_OK | X_OK, AT_EACCESS) != 0) return errno;
  struct stat ours {
  }, above{};
  if (::stat(folder.c_str(), &ours) != 0 || ::stat(folderOf(folder).c_str(), &above) != 0) return errno;
  const uid_t user = ::geteuid();
  const bool is_owner = user == 0 || user == ours.st_uid || user == above.st_uid;
  return (above.st_mode & S_ISVTX) != 0 && !is_owner ? EPERM : 0;  // as in /tmp
}

}  // namespace

void checkReplaceable(const fs::path& target, bool overwrite) {
  if (target.empty()) throw UsageError("the output has no name");
  if (!fs::exists(fs::symlink_status(target))) return;
  if (!overwrite)
    throw OutputError("{}: exists already; choose another output, or replace it with --overwrite",
                      target.string());
  try {
    const fs::path manifest = target / "manifest.json";
    Manifest::fromJson(readTextFile(manifest), manifest);
  } catch (const OtherVersion&) {
    // Still a cache.
  } catch (const Error& error) {
    throw OutputError(
        "{}: is not a complete splat cache and will not be overwritten; remove it, or choose another output "
        "({})",
        target.string(), error.what());
  }
  if (const int error = whyUnremovable(target); error != 0)
    throw OutputError("{}: cannot be overwritten: {}; choose another output", target.string(),
                      std::strerror(error));
}

std::vector<fs::path> foreignNames(const fs::path& cache) {
  std::vector<fs::path> names;
  addForeignNames(cache, {}, names);
  std::sort(names.begin(), names.end());
  return names;
}

std::error_code removeCacheFolder(const fs::path& folder) noexcept {
  try {
    std::error_code error;
    const fs::file_status status = fs::symlink_status(folder, error);
    if (status.type() == fs::file_type::not_found) return {};
    if (error) return error;
    if (!fs::is_directory(status)) return std::make_error_code(std::errc::not_a_directory);
    for (fs::directory_iterator entry(folder, error), end; !error && entry != end; entry.increment(error))
      if (isCacheFile(*entry)) removeFileIfThere(entry->path());
    if (SystemCalls::current().remove(folder.c_str()) < 0) return {errno, std::generic_category()};
    return {};
  } catch (const std::exception&) {
    return std::make_error_code(std::errc::not_enough_memory);
  }
}

void requireCacheFolderRemoved(const fs::path& folder) {
  if (const std::error_code error = removeCacheFolder(folder))
    throw OutputError("{}: is not the cache's, and in the way of its next folder: move it elsewhere ({})",
                      folder.string(), error.message());
}

bool hasUnfinished(const fs::path& target) {
  try {
    return isOurs(partialOf(target), withoutSlash(target));
  } catch (const Error&) {
    return true;  // a lock that cannot be read
  }
}

PartialFolder::PartialFolder(fs::path target, bool overwrite, Rest rest)
    : target_(withoutSlash(std::move(target))), path_(partialOf(target_)) {
  checkReplaceable(target_, overwrite);
  const bool is_new = SystemCalls::current().mkdir(path_.c_str(), 0777) == 0;
  if (!is_new && DiskFull::is(errno)) throw DiskFull(path_, target_, "a new directory", errno);
  if (!is_new && errno != EEXIST)
    throw OutputError("{}: the directory cannot be created: {}; choose another output", path_.string(),
                      reason());
  if (!is_new && !isOurs(path_, target_))
    throw OutputError("{}: exists and was not made by curvisplat; remove it, or choose another output",
                      path_.string());
  try {
    lock(is_new);
    mark();
  } catch (...) {
    if (lock_ >= 0 && is_new) SystemCalls::current().remove((path_ / kPartialLock).c_str());
    if (lock_ >= 0) SystemCalls::current().close(lock_);
    if (is_new)
      SystemCalls::current().remove(path_.c_str());  // fails if another conversion's lock is in it by now
    throw;
  }
  try {
    if (rest == Rest::kRemove)
      clear();
    else
      leave(!is_new);
  } catch (...) {
    SystemCalls::current().close(lock_);
    throw;
  }
}

void PartialFolder::clear() {
  leave_ = false;
  std::error_code error;
  if (fs::exists(path_ / "manifest.json", error) && fs::is_directory(target_, error))
    moveForeign(path_, target_);
  for (const auto& entry : fs::directory_iterator(path_))
    if (entry.path().filename() != kPartialLock)
      requireRemoved(removeAll(entry.path()), entry.path(), "remainder of an unfinished conversion");
}

PartialFolder::~PartialFolder() {
  if (lock_ < 0) return;
  if (!leave_) removeMarked(path_);
  SystemCalls::current().close(lock_);
}

void PartialFolder::lock(bool is_new) {
  const fs::path name = path_ / kPartialLock;
  const int fd = openRetrying(name, O_RDWR | O_CREAT | O_NOFOLLOW, 0666);
  if (fd < 0 && DiskFull::is(errno)) throw DiskFull(name, target_, "a new file", errno);
  if (fd < 0) throw OutputError("{}: cannot be opened: {}", name.string(), reason());
  bool locked = ::flock(fd, LOCK_EX | LOCK_NB) == 0;
  std::string why = reason();
  const bool busy = !locked && errno == EWOULDBLOCK;
  // A conversion that ended between open and flock has removed the file: then the locked file is no longer
  // the one of this name.
  struct stat ours {
  }, theirs{};
  const bool named = ::fstat(fd, &ours) == 0 && ::stat(name.c_str(), &theirs) == 0;
  if (locked && !named && errno != ENOENT) {
    locked = false;
    why = reason();
  }
  const bool same = named && ours.st_ino == theirs.st_ino && ours.st_dev == theirs.st_dev;
  if (locked && same) {
    lock_ = fd;
    return;
  }
  SystemCalls::current().close(fd);
  if (busy || locked)
    throw OutputError(
        "{}: another conversion to this output is running; wait for it, or choose another output",
        path_.string());
  if (is_new) SystemCalls::current().remove(name.c_str());  // no other conversion can have locked it either
  throw OutputError("{}: cannot be locked: {}; choose an output on a file system that supports flock",
                    name.string(), why);
}

void PartialFolder::mark() {
  if (isMarked(path_)) return;
  OutputFile file(path_ / kPartialLock);
  file.append(std::as_bytes(std::span(kPartialMark)));
  file.close();
  syncDirectory(path_);  // a power loss must not leave the work without its mark
}

void PartialFolder::putIntoPlace() {
  CURVISPLAT_CHECK(lock_ >= 0);
  SystemCalls& calls = SystemCalls::current();
  syncDirectory(path_);
  const fs::path aside = withSuffix(target_, ".replaced");
  if (!fs::exists(fs::symlink_status(target_))) {
    if (calls.rename(path_.c_str(), target_.c_str()) < 0) failToRename(errno, path_, target_);
  } else if (calls.exchange(path_.c_str(), target_.c_str()) == 0) {
    replaced_ = path_;
  } else if (errno == EINVAL || errno == ENOSYS || errno == ENOTSUP) {
    if (calls.rename(target_.c_str(), aside.c_str()) < 0) failToRename(errno, target_, aside);
    if (calls.rename(path_.c_str(), target_.c_str()) < 0) {
      const int error = errno;
      calls.rename(aside.c_str(), target_.c_str());
      failToRename(error, path_, target_);
    }
    replaced_ = aside;
  } else {
    failToRename(errno, path_, target_);
  }
  try {
    // Synced before the old cache is removed: a power loss must not lose both caches.
    syncDirectory(folderOf(target_));
  } catch (...) {
    const fs::path old = std::exchange(replaced_, {});
    if (old == path_)
      calls.exchange(path_.c_str(), target_.c_str());
    else
      calls.rename(target_.c_str(), path_.c_str());
    if (old == aside) calls.rename(aside.c_str(), target_.c_str());
    throw;
  }
  // The lock is released after the rename. Otherwise another conversion could take the folder for an
  // abandoned one.
  const int lock = std::exchange(lock_, -1);
  // The old cache, which is to be removed, is marked with it.
  if (replaced_ != path_ ||
      calls.rename((target_ / kPartialLock).c_str(), (path_ / kPartialLock).c_str()) < 0)
    removeFileIfThere(target_ / kPartialLock);
  calls.close(lock);
}

void PartialFolder::removeReplaced() {
  const fs::path old = std::exchange(replaced_, {});
  if (old.empty()) return;
  moveForeign(old, target_);
  requireRemoved(removeMarked(old), old, "old cache, which has been replaced,");
}

namespace {

constexpr uint64_t kReadBytes = uint64_t{1} << 20;

size_t entryBytes(size_t variables) {
  return sizeof(BrickRecord) + sizeof(double) + variables * sizeof(VariableRecord) + sizeof(uint64_t);
}

template <typename T>
void appendValue(const T& value, std::vector<std::byte>& out) {
  const size_t begin = out.size();
  out.resize(begin + sizeof value);
  std::memcpy(&out[begin], &value, sizeof value);
}

template <typename T>
T read(const std::byte*& at) {
  T value;
  std::memcpy(&value, at, sizeof value);
  at += sizeof value;
  return value;
}

}  // namespace

void forEachLogged(const std::filesystem::path& folder, size_t variables,
                   const std::function<bool(AppendedBrick&&)>& use) {
  if (!std::filesystem::exists(folder / kBrickLogName)) return;
  const InputFile file(folder / kBrickLogName);
  const size_t entry_bytes = entryBytes(variables);
  const uint64_t entries = file.size() / entry_bytes, at_once = kReadBytes / entry_bytes + 1;
  std::vector<std::byte> buffer;
  for (uint64_t first = 0; first < entries; first += at_once) {
    buffer.resize(std::min(at_once, entries - first) * entry_bytes);
    file.readAt(first * entry_bytes, std::span(buffer));
    for (size_t begin = 0; begin < buffer.size(); begin += entry_bytes) {
      const auto entry = std::span<const std::byte>(buffer).subspan(begin, entry_bytes);
      const std::byte* at = entry.data();
      AppendedBrick brick;
      brick.brick = brickOf(read<BrickRecord>(at));
      brick.weight = read<double>(at);
      for (size_t v = 0; v < variables; ++v)
        brick.variables.push_back(brickVariableOf(read<VariableRecord>(at)));
      if (read<uint64_t>(at) != checksumOf(entry.first(entry_bytes - sizeof(uint64_t)))) return;
      if (!use(std::move(brick))) return;
    }
  }
}

std::vector<AppendedBrick> readBrickLog(const std::filesystem::path& folder, size_t variables) {
  std::vector<AppendedBrick> bricks;
  forEachLogged(folder, variables, [&](AppendedBrick&& brick) {
    bricks.push_back(std::move(brick));
    return true;
  });
  return bricks;
}

BrickLog::BrickLog(const std::filesystem::path& folder, size_t variables)
    : variables_(variables), file_(folder / kBrickLogName, Caching::kPages, OutputFile::Existing::kKeep) {}

void BrickLog::append(const AppendedBrick& brick) {
  entry_.clear();
  appendValue(recordOf(brick.brick), entry_);
  appendValue(brick.weight, entry_);
  for (const BrickVariable& variable : brick.variables) appendValue(recordOf(variable), entry_);
  appendValue(checksumOf(entry_), entry_);
  file_.append(std::span<const std::byte>(entry_));
}

void BrickLog::keep(uint64_t count) {
  file_.truncate(count * entryBytes(variables_));
}

}  // namespace curvisplat
