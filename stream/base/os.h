// These functions ask the operating system for what POSIX and the standard library do not have. os.cpp answers
// with Linux's own calls; os_left_out.cpp, which CMake takes instead with CURVISPLAT_PORTABLE=ON, does without
// them. Other sources must not use calls that only Linux has, except for the few with such a twin,
// NAME_left_out.cpp, which tests/structure/check_portable.py lists.
//
// Any thread may call these functions. Where nothing else is said they cannot fail.
#pragma once

#include <sys/types.h>

#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace curvisplat::os {

// Files

/// The flag of open(2) for transfers that bypass the page cache; 0 where there is none.
int directFlag();
/// Swaps the files of two names in one step. Returns 0, or -1 with errno set: ENOSYS if the system has no
/// such call.
int exchangeNames(const char* a, const char* b);
/// A hint that a file will be read in no order.
void expectRandomReads(int fd);
/// A hint that the page cache need not keep a file.
void evictPages(int fd);
/// Opens an empty file in memory, or one without a name on disk. Returns its descriptor, or -1 with errno
/// set.
int openInMemory(const char* name);
/// Whether a file of `bytes` fits on the disk of a folder. True where that cannot be tried.
bool hasRoom(const std::filesystem::path& folder, uint64_t bytes);
/// The kind of file system that a path is in: f_type of statfs(2). Returns 0 if the system does not tell, and
/// -1 with errno set if the call fails.
int64_t fileSystemNumber(const char* path);
/// The number of pages of a mapping that are in memory. Returns nullopt with errno set if that is unknown.
std::optional<uint64_t> residentPages(void* mapping, size_t bytes);

// Sockets

/// Makes two connected sockets that programs started later do not inherit. Returns 0, or -1 with errno set.
int connectSockets(std::array<int, 2>& ends);
/// Calls send(2) and returns its result. If the other end is closed it fails with EPIPE, without a SIGPIPE.
ssize_t sendQuietly(int socket, const void* from, size_t count);

// The process and its threads

/// The program's file; empty if unknown.
std::filesystem::path programFile();
/// The process' command line; empty if unknown.
std::vector<std::string> commandLine();
/// Seconds since the process began; nullopt if unknown.
std::optional<double> secondsSinceStart();
/// Bytes of the process: read, written and in memory.
struct ProcessNumbers {
  uint64_t bytes_read = 0, bytes_written = 0;        // by system calls; 0: unknown
  uint64_t memory_bytes = 0, peak_memory_bytes = 0;  // resident; 0: unknown
};
ProcessNumbers processNumbers();
/// Sets the peak memory to what is resident now. Returns false if that is impossible.
bool resetPeakMemory();
/// The size of the address space in use; 0 if unknown.
uint64_t addressSpaceBytes();
/// Asks the system to kill this process when its parent ends.
void endWithParent();
/// Names the calling thread (at most 15 characters).
void nameThread(const char* name);
/// The calling thread's name. A thread without one has the program's name, or an empty one.
std::string threadName();
/// A number that no other thread of the process has.
int threadNumber();
bool isMainThread();
/// Gives the calling thread, and those that it then starts, the lower priority `nice` (1 to 19, 19 is the
/// lowest).
void lowerThreadPriority(int nice);
/// The flag of dlopen() that makes a library find its own symbols first; 0 where there is none.
int ownSymbolsFirst();

// The machine

/// The processor's name; empty if unknown.
std::string processorName();
/// Memory that programs can have without swapping; 0 if unknown.
uint64_t availableMemory();
/// Fills `bytes` with random numbers that nobody can predict. Returns false if the system has none.
bool fillRandom(std::span<unsigned char> bytes);

// The allocator

/// A hint to use large pages for this memory. `begin` is the beginning of a page.
void adviseHugePages(void* begin, size_t bytes);
/// Gives whole pages back to the system; what they hold is lost.
void discardPages(void* begin, size_t bytes);
/// Makes the allocator give blocks of at least `bytes` back to the system as soon as they are freed.
void returnBlocksFrom(size_t bytes);
/// Gives freed memory back to the system.
void trimHeap();
/// Limits the number of heaps that threads share to `most`.
void limitHeaps(int most);
/// Makes the allocator fill memory with junk when it is allocated and when it is freed.
void junkFreedMemory();

}  // namespace curvisplat::os
