// These functions ask the operating system for what POSIX and the standard library do not have. os.cpp answers
// with Linux's own calls; os_left_out.cpp, which CMake takes instead with CURVISPLAT_PORTABLE=ON, does without
// them. No source of another room may call Linux alone, except for the twins of
// tests/structure/check_portable.py.
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
/// Swaps two names in one step. Returns -1 with errno set where that fails: ENOSYS where no call does it.
int exchangeNames(const char* a, const char* b);
/// A hint that a file will be read in no order.
void expectRandomReads(int fd);
/// A hint that the page cache need not keep a file.
void evictPages(int fd);
/// A file in memory, or one without a name; -1 with errno set.
int openInMemory(const char* name);
/// Whether a file of `bytes` fits on the disk of a folder. True where that cannot be tried.
bool hasRoom(const std::filesystem::path& folder, uint64_t bytes);
/// The number of the file system that a path is in, by statfs(2): 0 if the system has none, -1 with errno set.
int64_t fileSystemNumber(const char* path);
/// Pages of a mapping that are in memory; nullopt with errno set.
std::optional<uint64_t> residentPages(void* mapping, size_t bytes);

// Sockets

/// Makes two connected sockets that programs started later do not inherit. Returns -1 with errno set.
int connectSockets(std::array<int, 2>& ends);
/// Calls send(2). If nobody reads, it fails with EPIPE, and no SIGPIPE comes.
ssize_t sendQuietly(int socket, const void* from, size_t count);

// The process and its threads

/// The program's file; empty if unknown.
std::filesystem::path programFile();
/// The process' command line; empty if unknown.
std::vector<std::string> commandLine();
std::optional<double> secondsSinceStart();
struct ProcessNumbers {
  uint64_t bytes_read = 0, bytes_written = 0;        // by system calls; 0: unknown
  uint64_t memory_bytes = 0, peak_memory_bytes = 0;  // resident; 0: unknown
};
ProcessNumbers processNumbers();
/// Lets the peak memory start again from what is resident now. False if that is impossible.
bool resetPeakMemory();
/// The size of the address space in use; 0 if unknown.
uint64_t addressSpaceBytes();
/// Ends this process when its parent ends.
void endWithParent();
/// Names the calling thread (at most 15 characters).
void nameThread(const char* name);
/// The calling thread's name; the program's, or empty, if it was given none.
std::string threadName();
/// A number that no other thread of the process has.
int threadNumber();
bool isMainThread();
/// Lowers the priority of the calling thread and of those that it starts.
void lowerThreadPriority(int nice);
/// Flag of dlopen() that lets a library find its own symbols first.
int ownSymbolsFirst();

// The machine

/// The processor's name; empty if unknown.
std::string processorName();
/// Memory that programs can have without swapping; 0 if unknown.
uint64_t availableMemory();
/// Fills `bytes` with numbers that nobody can predict. False if there are none.
bool fillRandom(std::span<unsigned char> bytes);

// The allocator

/// A hint to use large pages for whole pages of memory.
void adviseHugePages(void* begin, size_t bytes);
/// Gives whole pages back to the system; what they hold is lost.
void discardPages(void* begin, size_t bytes);
/// Blocks of at least `bytes` go back to the system as soon as they are freed.
void returnBlocksFrom(size_t bytes);
/// Gives freed memory back to the system.
void trimHeap();
/// Limits the heaps that threads share.
void limitHeaps(int most);
/// Fills memory that is allocated and freed with junk.
void junkFreedMemory();

}  // namespace curvisplat::os
