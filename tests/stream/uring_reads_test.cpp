// io_uring where the kernel refuses a part of it. Each case is a process of its own, whose system calls a
// filter (seccomp) lets fail.
#include <gtest/gtest.h>
#include <linux/filter.h>
#include <linux/seccomp.h>
#include <sys/prctl.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <cstddef>
#include <functional>
#include <initializer_list>
#include <thread>
#include <vector>

#include "stream/base/error.h"
#include "stream/paging/async_reads.h"
#include "tests/support/sanitizers.h"

namespace curvisplat {
namespace {

constexpr unsigned kHangSeconds = 30;
enum Ending : int { kGood = 10, kBad, kNoFilter };

/// Lets these calls of this thread, and of those that it starts, fail. Returns false where that is forbidden.
bool refuse(std::initializer_list<long> calls, int error) {
  std::vector<sock_filter> filter{BPF_STMT(BPF_LD | BPF_W | BPF_ABS, offsetof(seccomp_data, nr))};
  for (const long call : calls) {
    filter.push_back(BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, static_cast<unsigned>(call), 0, 1));
    filter.push_back(BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_ERRNO | static_cast<unsigned>(error)));
  }
  filter.push_back(BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_ALLOW));
  const sock_fprog program{static_cast<unsigned short>(filter.size()), filter.data()};
  return ::prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) == 0 &&
         ::prctl(PR_SET_SECCOMP, SECCOMP_MODE_FILTER, &program) == 0;
}

/// What `run` returns in a process of its own; the negative signal if that kills it, as after a hang.
int inProcess(const std::function<int()>& run) {
  const pid_t child = ::fork();
  if (child == 0) {
    ::alarm(kHangSeconds);
    ::_exit(run());
  }
  int status = 0;
  EXPECT_EQ(::waitpid(child, &status, 0), child);
  return WIFEXITED(status) ? WEXITSTATUS(status) : -WTERMSIG(status);
}

class UringReads : public ::testing::Test {
 protected:
  void SetUp() override {
    if (!makeUringReads(4)) GTEST_SKIP() << "this kernel, or this container, refuses io_uring";
    if (inProcess([] { return refuse({SYS_acct}, EPERM) ? kGood : kNoFilter; }) == kNoFilter)
      GTEST_SKIP() << "this container refuses filters of system calls";
  }
};

TEST_F(UringReads, AreNotUsedWhereReadsCannotBeSubmitted) {
  const auto run = []() -> int {
    if (!refuse({SYS_io_uring_enter}, EPERM)) return kNoFilter;
    return makeUringReads(4) ? kBad : kGood;
  };
  EXPECT_EQ(inProcess(run), kGood);
}

TEST_F(UringReads, EndWithAnErrorIfTheirThreadCannotBeWoken) {
  if (kHasThreadSanitizer) GTEST_SKIP() << "the forked process starts a thread";
  const auto run = []() -> int {
    const auto reads = makeUringReads(4);
    // Not write: sanitizers need it for themselves.
    if (!reads || !refuse({SYS_sendto, SYS_sendmsg}, EIO)) return kNoFilter;
    std::thread waking([&] { reads->wake(); });
    int ending = kBad;
    try {
      reads->wait();
    } catch (const Error&) {
      ending = kGood;
    }
    waking.join();
    return ending;
  };
  EXPECT_EQ(inProcess(run), kGood);
}

TEST_F(UringReads, WakeOnceForAnyNumberOfCalls) {
  const auto reads = makeUringReads(4);
  for (int n = 0; n < 100'000; ++n) reads->wake();  // more than the socket's buffer takes
  EXPECT_FALSE(reads->wait().has_value());
  std::thread waking([&] { reads->wake(); });
  EXPECT_FALSE(reads->wait().has_value());
  waking.join();
}

}  // namespace
}  // namespace curvisplat
