// This file does by POSIX and the standard library what os.cpp does by Linux's own calls, or nothing where the
// work goes on without. CURVISPLAT_PORTABLE=ON takes it instead.
#include "stream/base/os.h"

#include <fcntl.h>
#include <sys/resource.h>
#include <sys/socket.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <chrono>
#include <cstdio>
#include <exception>
#include <random>
#include <thread>

#include "stream/base/disk_space.h"

namespace curvisplat::os {
namespace {

const std::chrono::steady_clock::time_point kStart = std::chrono::steady_clock::now();
const std::thread::id kMainThread = std::this_thread::get_id();
thread_local std::array<char, 16> thread_name{};

}  // namespace

int directFlag() {
  return 0;
}

int exchangeNames(const char*, const char*) {
  errno = ENOSYS;
  return -1;
}

void expectRandomReads(int) {}

void evictPages(int) {}

int openInMemory(const char*) {
  std::FILE* const file = std::tmpfile();
  if (!file) return -1;
  const int fd = ::fcntl(::fileno(file), F_DUPFD_CLOEXEC, 0);
  const int error = errno;
  std::fclose(file);
  errno = error;
  return fd;
}

bool hasRoom(const std::filesystem::path& folder, uint64_t bytes) {
  return freeBytes(folder).value_or(bytes) >= bytes;
}

int64_t fileSystemNumber(const char*) {
  return 0;
}

std::optional<uint64_t> residentPages(void*, size_t) {
  errno = ENOSYS;
  return std::nullopt;
}

int connectSockets(std::array<int, 2>& ends) {
  if (::socketpair(AF_UNIX, SOCK_STREAM, 0, ends.data()) != 0) return -1;
  for (const int end : ends) {
    ::fcntl(end, F_SETFD, FD_CLOEXEC);
#ifdef SO_NOSIGPIPE  // macOS
    const int on = 1;
    ::setsockopt(end, SOL_SOCKET, SO_NOSIGPIPE, &on, sizeof on);
#endif
  }
  return 0;
}

ssize_t sendQuietly(int socket, const void* from, size_t count) {
#ifdef SO_NOSIGPIPE
  return ::send(socket, from, count, 0);
#else
  return ::send(socket, from, count, MSG_NOSIGNAL);
#endif
}

std::filesystem::path programFile() {
  return {};
}

std::vector<std::string> commandLine() {
  return {};
}

std::optional<double> secondsSinceStart() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - kStart).count();
}

ProcessNumbers processNumbers() {
#ifdef __APPLE__
  constexpr uint64_t kUnit = 1;
#else
  constexpr uint64_t kUnit = 1024;
#endif
  ProcessNumbers numbers;
  rusage usage{};
  if (::getrusage(RUSAGE_SELF, &usage) == 0)
    numbers.peak_memory_bytes = kUnit * static_cast<uint64_t>(usage.ru_maxrss);
  return numbers;
}

bool resetPeakMemory() {
  return false;
}

uint64_t addressSpaceBytes() {
  return 0;
}

void endWithParent() {}

void nameThread(const char* name) {
  const std::string_view text(name);
  thread_name = {};
  std::copy_n(text.begin(), std::min(text.size(), thread_name.size() - 1), thread_name.begin());
}

std::string threadName() {
  return thread_name.data();
}

int threadNumber() {
  static std::atomic<int> threads = 0;
  thread_local const int number = ++threads;
  return number;
}

bool isMainThread() {
  return std::this_thread::get_id() == kMainThread;
}

void lowerThreadPriority(int) {}

int ownSymbolsFirst() {
  return 0;
}

std::string processorName() {
  return {};
}

uint64_t availableMemory() {
  return 0;
}

bool fillRandom(std::span<unsigned char> bytes) {
  try {
    std::random_device random;
    std::uniform_int_distribution<int> byte(0, 255);
    for (unsigned char& each : bytes) each = static_cast<unsigned char>(byte(random));
  } catch (const std::exception&) {
    return false;
  }
  return true;
}

void adviseHugePages(void*, size_t) {}
void discardPages(void*, size_t) {}
void returnBlocksFrom(size_t) {}
void trimHeap() {}
void limitHeaps(int) {}
void junkFreedMemory() {}

}  // namespace curvisplat::os
