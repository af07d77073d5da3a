// Checks before the work begins: that a command can write its outputs, and that it can have the threads that
// it needs (ulimit -u, ulimit -v). So a command fails at once and not after hours of work. Libraries start
// threads in places that no exception may leave; one that cannot be started there ends the process.
//
// A check takes a few system calls, and some 20 microseconds for each thread. Any thread may call it.
#pragma once

#include <exception>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

namespace curvisplat {

/// `path` is the value of `option`. Throws Error if its folder does not exist or is not writable, or if no
/// file can have the name with `suffix`, which names of temporary files beside it end with.
void checkOutputFolder(std::string_view option, const std::filesystem::path& path,
                       std::string_view suffix = "");

/// Calls checkOutputFolder(), and removes unfinished files that killed runs have left in the folder. Also
/// throws Error if `path` exists and is not a regular file, or if it is one of `others` (files or caches
/// that the command reads or writes) or a file of such a cache.
void checkOutputFile(std::string_view option, const std::filesystem::path& path,
                     const std::vector<std::filesystem::path>& others);

/// Calls checkOutputFile() for a file of JSON, which may have any name: also throws Error if `path` exists and holds
/// anything else, such as a grid.
void checkJsonOutput(std::string_view option, const std::filesystem::path& path,
                     const std::vector<std::filesystem::path>& others);

/// Throws Error if this process cannot now have the threads of a command with `--threads count` (0: one per
/// core), or if memory is too small for them to begin. `option`: the option's name in the message. Starts
/// and ends all of them, but at most 68.
void requireThreads(unsigned count, std::string_view option = "--threads");
/// Checks for one thread per core, for a command without such an option.
void requireThreads();

/// Whether `error` says that a thread could not be started: those of the C++ library and of TBB do.
bool isForLackOfThreads(const std::exception& error);

/// Describes in one line what a call of std::filesystem has failed at.
std::string textOf(const std::filesystem::filesystem_error& error);

/// The message where isForLackOfThreads().
extern const char* const kNoThread;

}  // namespace curvisplat
