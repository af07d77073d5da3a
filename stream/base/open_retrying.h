// open(2), for code that keeps the descriptor. Files that are only read or written use stream/base/file.h.
#pragma once

#include <filesystem>

namespace curvisplat {

/// SystemCalls::open() with O_CLOEXEC, retried on EINTR. Returns the descriptor, or -1 with errno set.
int openRetrying(const std::filesystem::path& path, int flags, unsigned mode = 0);

}  // namespace curvisplat
