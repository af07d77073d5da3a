// open(2), for whoever keeps a descriptor: files that are only read or written have stream/file.h.
#pragma once

#include <filesystem>

namespace curvisplat {

/// SystemCalls::open(), closed on exec, and tried again where a signal came in between. The descriptor, or -1
/// and errno.
int openRetrying(const std::filesystem::path& path, int flags, unsigned mode = 0);

}  // namespace curvisplat
