#include "tools/output/standard_streams.h"

#include <fcntl.h>

#include <cerrno>
#include <cstdio>
#include <cstring>

#include "stream/base/message.h"

namespace curvisplat {

void openStandardStreams() {
  // The lowest free number is taken. Standard output is opened for reading: what is printed to it is not lost
  // in silence.
  for (int number = 0; number <= 2; ++number)
    if (::fcntl(number, F_GETFD) < 0) ::open("/dev/null", number == 2 ? O_WRONLY : O_RDONLY);
}

bool finishStandardOutput() {
  // A write that failed before has left its mark, but not its reason.
  const bool failed = std::ferror(stdout) != 0;
  if (std::fflush(stdout) == 0 && !failed) return true;
  printMessage("standard output cannot be written{}{}", failed ? "" : ": ",
               failed ? "" : std::strerror(errno));
  return false;
}

}  // namespace curvisplat
