#include "stream/base/durable_file.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <string_view>
#include <utility>

#include "stream/base/disk_space.h"
#include "stream/base/file.h"
#include "stream/base/temporary_files.h"

namespace curvisplat {
namespace {

namespace fs = std::filesystem;

constexpr TemporaryNames kNames{".curvisplat.", ".part"};

std::string errnoText() {
  return std::strerror(errno);
}

}  // namespace

void renameDurably(const fs::path& from, const fs::path& to) {
  SystemCalls& calls = SystemCalls::current();
  std::error_code none_there;
  const bool replaces = fs::exists(fs::symlink_status(to, none_there));
  // Where names can be exchanged, the old file stays under the new one's until the folder is synced.
  const bool exchanged = replaces && calls.exchange(from.c_str(), to.c_str()) == 0;
  if (!exchanged && calls.rename(from.c_str(), to.c_str()) < 0) failToRename(errno, from, to);
  try {
    syncDirectory(folderOf(to));
  } catch (const Error& error) {
    if (exchanged ? calls.exchange(from.c_str(), to.c_str()) == 0
                  : !replaces && calls.rename(to.c_str(), from.c_str()) == 0)
      throw;
    if (exchanged) calls.remove(from.c_str());
    throw NameNotSynced("{}: was written, but a power loss may undo that: {}", to.string(), error.what());
  }
  if (exchanged) calls.remove(from.c_str());
}

TemporaryFile::TemporaryFile(fs::path target) : target_(std::move(target)) {
  const auto name = [&](uint32_t random) { return folderOf(target_) / kNames.of(random); };
  while (true) {
    NewFile file = createNewFile(name, 0666);
    path_ = std::move(file.path);
    fd_ = file.fd;
    if (fd_ < 0 && DiskFull::is(errno)) throw DiskFull(path_, target_, "a new file", errno);
    if (fd_ < 0) throw Error("{}: no file can be made beside it: {}", target_.string(), errnoText());
    if (lockNew(fd_)) return;
    SystemCalls::current().close(fd_);
  }
}

TemporaryFile::~TemporaryFile() {
  if (!in_place_) removeFileIfThere(path_);
  SystemCalls::current().close(fd_);
}

std::string TemporaryFile::aboutTarget(std::string message) const {
  const std::string own = path_.string();
  for (size_t at = 0; (at = message.find(own, at)) != std::string::npos; at += target_.string().size())
    message.replace(at, own.size(), target_.string());
  return message;
}

void TemporaryFile::putIntoPlace() {
  int result;
  do {
    result = SystemCalls::current().fsync(fd_);
  } while (result < 0 && errno == EINTR);
  if (result < 0 && DiskFull::is(errno)) throw DiskFull(path_, target_, "what was written", errno);
  if (result < 0 && errno != EINVAL && errno != ENOTSUP)
    throw Error("{}: cannot be synced to the disk: {}", target_.string(), errnoText());
  try {
    renameDurably(path_, target_);
  } catch (const NameNotSynced&) {
    in_place_ = true;
    throw;
  } catch (const Error& error) {
    throw Error(aboutTarget(error.what()));
  }
  in_place_ = true;
}

void writeFileDurably(const fs::path& path, std::span<const std::byte> bytes) {
  TemporaryFile temporary(writableTarget(path));
  OutputFile(temporary.path(), Caching::kPages, OutputFile::Existing::kEmpty, temporary.target())
      .append(bytes);
  temporary.putIntoPlace();
}

void writeFileDurably(const fs::path& path, const std::string& text) {
  writeFileDurably(path, std::as_bytes(std::span(text)));
}

void removeAbandonedFiles(const fs::path& folder) noexcept {
  removeAbandoned(folder, kNames, O_RDWR | O_NOFOLLOW | O_NONBLOCK,
                  [](const struct stat& status) { return S_ISREG(status.st_mode); });
}

}  // namespace curvisplat
