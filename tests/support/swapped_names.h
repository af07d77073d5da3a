// Whether this build can swap two names in one step. A portable build cannot (stream/base/os.h).
#pragma once

#include <cerrno>

#include "stream/base/os.h"

namespace curvisplat {

inline bool namesCanBeSwapped() {
  return os::exchangeNames("", "") == 0 || errno != ENOSYS;
}

}  // namespace curvisplat
