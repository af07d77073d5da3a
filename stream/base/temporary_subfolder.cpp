#include "stream/base/temporary_subfolder.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <random>

#include "stream/base/error.h"
#include "stream/base/file.h"
#include "stream/base/open_retrying.h"
#include "stream/base/temporary_names.h"

namespace curvisplat {
namespace {

namespace fs = std::filesystem;

constexpr int kOpenFolder = O_RDONLY | O_DIRECTORY | O_NOFOLLOW;

}  // namespace

TemporarySubfolder::TemporarySubfolder(const fs::path& parent, std::string_view ending) {
  const TemporaryNames names{"curvisplat.", ending};
  removeAbandoned(parent, names, kOpenFolder,
                  [](const struct stat& status) { return status.st_uid == ::geteuid(); });
  std::random_device random;
  while (true) {
    path_ = parent / names.of(random());
    const auto fail = [&] {
      throw Error("{}: cannot be created as a temporary folder: {}", path_.string(), std::strerror(errno));
    };
    if (SystemCalls::current().mkdir(path_.c_str(), 0700) != 0) {
      if (errno == EEXIST) continue;
      fail();
    }
    fd_ = openRetrying(path_, kOpenFolder, 0);
    if (fd_ < 0 && errno == ENOENT) continue;  // taken for abandoned
    if (fd_ < 0) {
      const int reason = errno;
      removeAll(path_);
      errno = reason;
      fail();
    }
    if (lockNew(fd_)) return;
    SystemCalls::current().close(fd_);
  }
}

void TemporarySubfolder::remove() noexcept {
  if (fd_ < 0) return;
  removeAll(path_);
  SystemCalls::current().close(fd_);
  fd_ = -1;
}

}  // namespace curvisplat
