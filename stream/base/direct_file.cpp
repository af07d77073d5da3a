#include "stream/base/direct_file.h"

#include <fcntl.h>

#include <cerrno>
#include <cstring>
#include <utility>

#include "stream/base/error.h"
#include "stream/base/file.h"
#include "stream/base/open_retrying.h"

namespace curvisplat {

DirectFile::DirectFile(std::filesystem::path path, bool direct) : path_(std::move(path)) {
  buffered_fd_ = openRetrying(path_, O_RDONLY);
  if (buffered_fd_ < 0)
    throw Error("{}: cannot be opened for reading: {}", path_.string(), std::strerror(errno));
  ::posix_fadvise(buffered_fd_, 0, 0, POSIX_FADV_RANDOM);  // only a hint: failure does no harm
  if (direct) direct_fd_ = openRetrying(path_, O_RDONLY | O_DIRECT);
}

DirectFile::~DirectFile() {
  if (direct_fd_ >= 0) SystemCalls::current().close(direct_fd_);
  SystemCalls::current().close(buffered_fd_);
}

}  // namespace curvisplat
