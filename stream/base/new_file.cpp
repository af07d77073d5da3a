#include "stream/base/new_file.h"

#include <fcntl.h>

#include <cerrno>
#include <random>

#include "stream/base/open_retrying.h"

namespace curvisplat {

NewFile createNewFile(const std::function<std::filesystem::path(uint32_t random)>& name, unsigned mode) {
  std::random_device random;
  while (true) {
    NewFile file{name(random()), -1};
    file.fd = openRetrying(file.path, O_RDWR | O_CREAT | O_EXCL | O_NOFOLLOW, mode);
    if (file.fd >= 0 || errno != EEXIST) return file;
  }
}

}  // namespace curvisplat
