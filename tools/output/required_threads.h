// Whether the threads that a command needs can be had (ulimit -u, ulimit -v), asked before anything is written. Libraries start
// threads in places where no exception may leave; one that fails to start there ends the process.
#pragma once

#include <exception>
#include <string_view>

namespace curvisplat {

/// Throws Error if this process cannot have the threads of a command with `--threads count` (0: one per core) now, or if there is
/// too little memory for them to begin. To be called before anything is written. `option`: what the user calls it. Starts and ends
/// each of them, at most 68: some 20 microseconds a thread. Any thread.
void requireThreads(unsigned count, std::string_view option = "--threads");
/// The same for a command without such an option.
void requireThreads();

/// Whether `error` says that a thread could not be started: those of the C++ library and of TBB do.
bool isForLackOfThreads(const std::exception& error);

/// The message where isForLackOfThreads().
extern const char* const kNoThread;

}  // namespace curvisplat
