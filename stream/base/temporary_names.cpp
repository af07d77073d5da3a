#include "stream/base/temporary_names.h"

#include <fmt/format.h>
#include <sys/file.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <span>

#include "stream/base/checksum.h"
#include "stream/base/file.h"
#include "stream/base/open_retrying.h"

namespace curvisplat {
namespace {

constexpr size_t kMachineDigits = 8, kRandomDigits = 8;

std::string machineDigits() {
  std::array<char, 256> name{};
  ::gethostname(name.data(), name.size() - 1);
  const std::string_view host(name.data());
  return fmt::format("{:016x}", checksumOf(std::as_bytes(std::span(host)))).substr(0, kMachineDigits);
}

}  // namespace

std::string TemporaryNames::of(uint32_t random) const {
  return fmt::format("{}{}{:08x}{}", begin, machineDigits(), random, end);
}

bool TemporaryNames::areOfThisMachine(std::string_view name) const {
  return name.size() == begin.size() + kMachineDigits + kRandomDigits + end.size() &&
         name.starts_with(std::string(begin) + machineDigits()) && name.ends_with(end);
}

bool lockNew(int fd) {
  const bool busy = ::flock(fd, LOCK_EX | LOCK_NB) < 0 && errno == EWOULDBLOCK;
  if (busy) return false;
  struct stat status {};
  // If it cannot be examined, the next call on it or its name fails with a reason; another file would be no better.
  return ::fstat(fd, &status) < 0 || status.st_nlink > 0;
}

void removeAbandoned(const std::filesystem::path& folder, const TemporaryNames& names, int flags,
                     bool (*is_ours)(const struct stat&)) noexcept {
  try {
    std::error_code error;
    for (std::filesystem::directory_iterator entry(folder, error), end; !error && entry != end;
         entry.increment(error)) {
      if (!names.areOfThisMachine(entry->path().filename().string())) continue;
      const int fd = openRetrying(entry->path(), flags, 0);
      if (fd < 0) continue;
      struct stat status {};
      if (::fstat(fd, &status) == 0 && is_ours(status) && ::flock(fd, LOCK_EX | LOCK_NB) == 0)
        removeAll(entry->path());
      SystemCalls::current().close(fd);
    }
  } catch (...) {
    // They are in nobody's way.
  }
}

}  // namespace curvisplat
