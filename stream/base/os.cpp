// Linux's own calls. os_left_out.cpp stands in for this file.
#include "stream/base/os.h"

#include <dlfcn.h>
#include <fcntl.h>
#include <malloc.h>
#include <pthread.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/random.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/statfs.h>
#include <time.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <csignal>
#include <cstdio>
#include <fstream>
#include <sstream>

namespace curvisplat::os {
namespace {

/// The value of the first line "key : value" of a file of /proc; empty if there is none.
std::string valueIn(const char* path, const std::string& key) {
  std::ifstream file(path);
  for (std::string line; std::getline(file, line);) {
    if (!line.starts_with(key)) continue;
    const size_t colon = line.find(':');
    const size_t begin = line.find_first_not_of(" \t", colon + 1);
    if (colon != std::string::npos && begin != std::string::npos) return line.substr(begin);
  }
  return {};
}

uint64_t numberIn(const char* path, const std::string& key) {
  const std::string value = valueIn(path, key);
  return value.empty() ? 0 : std::stoull(value);
}

}  // namespace

int directFlag() {
  return O_DIRECT;
}

int exchangeNames(const char* a, const char* b) {
  return ::renameat2(AT_FDCWD, a, AT_FDCWD, b, RENAME_EXCHANGE);
}

void expectRandomReads(int fd) {
  ::posix_fadvise(fd, 0, 0, POSIX_FADV_RANDOM);
}

void evictPages(int fd) {
  ::posix_fadvise(fd, 0, 0, POSIX_FADV_DONTNEED);
}

int openInMemory(const char* name) {
  return ::memfd_create(name, MFD_CLOEXEC);
}

bool hasRoom(const std::filesystem::path& folder, uint64_t bytes) {
  const int file = ::open(folder.c_str(), O_TMPFILE | O_WRONLY | O_CLOEXEC, 0600);
  if (file < 0) return errno != ENOSPC && errno != EDQUOT;
  const int error = ::posix_fallocate(file, 0, static_cast<off_t>(bytes));
  ::close(file);
  return error != ENOSPC && error != EDQUOT;
}

int64_t fileSystemNumber(const char* path) {
  struct statfs status {};
  if (::statfs(path, &status) != 0) return -1;
  return static_cast<int64_t>(static_cast<uint64_t>(status.f_type) & 0xFFFFFFFF);
}

std::optional<uint64_t> residentPages(void* mapping, size_t bytes) {
  const auto page = static_cast<size_t>(::sysconf(_SC_PAGESIZE));
  std::vector<unsigned char> resident((bytes + page - 1) / page);
  if (::mincore(mapping, bytes, resident.data()) != 0) return std::nullopt;
  return static_cast<uint64_t>(
      std::count_if(resident.begin(), resident.end(), [](unsigned char flags) { return flags & 1; }));
}

int connectSockets(std::array<int, 2>& ends) {
  return ::socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends.data());
}

ssize_t sendQuietly(int socket, const void* from, size_t count) {
  return ::send(socket, from, count, MSG_NOSIGNAL);
}

std::filesystem::path programFile() {
  std::error_code error;
  return std::filesystem::read_symlink("/proc/self/exe", error);
}

std::vector<std::string> commandLine() {
  std::ifstream file("/proc/self/cmdline", std::ios::binary);
  std::vector<std::string> arguments;
  for (std::string argument; std::getline(file, argument, '\0');) arguments.push_back(argument);
  return arguments;
}

std::optional<double> secondsSinceStart() {
  // The start in clock ticks since boot is field 22 of /proc/self/stat. Counts the fields from the last
  // bracket on, because field 2, the program's name in brackets, may contain spaces and brackets.
  std::ifstream file("/proc/self/stat");
  std::string line;
  std::getline(file, line);
  std::istringstream fields(line.substr(line.rfind(')') + 1));
  std::string field;
  for (int n = 3; n < 22; ++n) fields >> field;
  double ticks = 0;
  if (!(fields >> ticks)) return std::nullopt;
  timespec now;
  ::clock_gettime(CLOCK_BOOTTIME, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec) -
         ticks / static_cast<double>(::sysconf(_SC_CLK_TCK));
}

ProcessNumbers processNumbers() {
  return {numberIn("/proc/self/io", "rchar:"), numberIn("/proc/self/io", "wchar:"),
          1024 * numberIn("/proc/self/status", "VmRSS:"), 1024 * numberIn("/proc/self/status", "VmHWM:")};
}

bool resetPeakMemory() {
  std::ofstream file("/proc/self/clear_refs");
  file << "5\n";
  file.close();
  return !file.fail();
}

uint64_t addressSpaceBytes() {
  uint64_t pages = 0;
  std::ifstream("/proc/self/statm") >> pages;
  return pages * static_cast<uint64_t>(::sysconf(_SC_PAGESIZE));
}

void endWithParent() {
  ::prctl(PR_SET_PDEATHSIG, SIGKILL);
}

void nameThread(const char* name) {
  ::pthread_setname_np(::pthread_self(), name);
}

std::string threadName() {
  std::array<char, 16> name{};
  ::pthread_getname_np(::pthread_self(), name.data(), name.size());
  return name.data();
}

int threadNumber() {
  return ::gettid();
}

bool isMainThread() {
  return ::gettid() == ::getpid();
}

void lowerThreadPriority(int nice) {
  ::setpriority(PRIO_PROCESS, 0, nice);  // on Linux each thread has its own
}

int ownSymbolsFirst() {
  return RTLD_DEEPBIND;
}

std::string processorName() {
  return valueIn("/proc/cpuinfo", "model name");
}

uint64_t availableMemory() {
  return 1024 * numberIn("/proc/meminfo", "MemAvailable");
}

bool fillRandom(std::span<unsigned char> bytes) {
  return ::getrandom(bytes.data(), bytes.size(), 0) == static_cast<ssize_t>(bytes.size());
}

void adviseHugePages(void* begin, size_t bytes) {
  ::madvise(begin, bytes, MADV_HUGEPAGE);
}

void discardPages(void* begin, size_t bytes) {
  ::madvise(begin, bytes, MADV_DONTNEED);
}

void returnBlocksFrom(size_t bytes) {
  ::mallopt(M_MMAP_THRESHOLD, static_cast<int>(bytes));
}

void trimHeap() {
  ::malloc_trim(0);
}

void limitHeaps(int most) {
  ::mallopt(M_ARENA_MAX, most);
}

void junkFreedMemory() {
  ::mallopt(M_PERTURB, 0xa5);
}

}  // namespace curvisplat::os
