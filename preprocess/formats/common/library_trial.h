// Checks of a file that may be damaged or hostile, before a data library opens it: is the file complete, does
// the library survive it, and where does it lead?
//
// HDF5 (1.10) and libcgns trust the structures of a file. If these are damaged, the libraries read and free
// memory that does not exist, or never return. Their work is therefore tried in a child process first, which
// may crash without harm. A trial costs a fork and the time of opening the file. A file is tried once, and
// again only if it changes. If no process can be started (ulimit -u), nothing is tried. Any thread may call
// these functions, but not while it holds dataLibraryMutex().
#pragma once

#include <filesystem>
#include <functional>
#include <string_view>

#include "stream/base/file.h"

namespace curvisplat {

inline constexpr std::string_view kHdf5Signature = "\x89HDF\r\n\x1a\n";

/// Whether `file` begins as HDF5.
bool isHdf5(const InputFile& file);

/// Throws TruncatedFile if `file` begins as HDF5 and ends before the address that its superblock (versions 0
/// to 3) states: HDF5 reports a truncated file as an unknown error.
void requireWholeHdf5(const InputFile& file);

/// Runs `work` on the file in a trial. Throws Error if it crashes or takes too long; exceptions of `work`
/// are ignored, since the caller meets the same ones. `library` names it in the message.
void tryLibrary(const char* library, const std::filesystem::path& path, const std::function<void()>& work);

/// Tries what HDF5 does with the file: the trial walks all objects, links, attributes and indices, and reads
/// small chunks, but not all values. Then does the same with each file that an external link or a virtual
/// data set leads to. Last, `more`, if given, runs in a trial of its own; its exceptions are ignored.
/// Throws Error if HDF5 crashes or takes too long, or if the file leads to one that is not regular or lies
/// outside its folder, keeps values in a raw file (HDF5 looks for that in the working directory), or takes
/// virtual values from virtual data sets (HDF5 follows a cycle of them until the stack ends).
void tryHdf5(const std::filesystem::path& path, const std::function<void()>& more = nullptr);

}  // namespace curvisplat
