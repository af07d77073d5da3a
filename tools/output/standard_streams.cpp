#include "tools/output/standard_streams.h"

#include <fcntl.h>

#include <cerrno>
#include <cstdio>
#include <cstring>

#include "stream/base/message.h"

namespace curvisplat {

void openStandardStreams() {
  // open() returns the lowest free number. Standard output is opened read-only, so that printing to it fails
  // and is reported.
  for (int number = 0; number <= 2; ++number)
    if (::fcntl(number, F_GETFD) < 0) ::open("/dev/null", number == 2 ? O_WRONLY : O_RDONLY);
}

bool finishStandardOutput() {
  // An earlier failed write has set the error flag, but its errno is lost.
  const bool failed = std::ferror(stdout) != 0;
  if (std::fflush(stdout) == 0 && !failed) return true;
  printMessage("cannot write to standard output{}{}", failed ? "" : ": ", failed ? "" : std::strerror(errno));
  return false;
}

}  // namespace curvisplat
