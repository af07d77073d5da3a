// Exchanges of two ranks are tested where they are used (tests/preprocess, tests/render). Here: calls that an
// exception leaves.
#include "stream/base/ranks.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <stdexcept>

namespace curvisplat {
namespace {

struct Stopped : std::runtime_error {
  Stopped() : std::runtime_error("stopped") {}
};

/// One of two ranks, whose other ends no call from the `last`-th on. MPI may work on such a call whenever it is called.
class EndlessTransport final : public RankTransport {
 public:
  explicit EndlessTransport(int last) : last_(last) {}

  unsigned rank() const override { return 0; }
  unsigned count() const override { return 2; }
  void beginSizes(const uint64_t* out, uint64_t* in) override {
    work_ = [out, in] { in[1] = out[1]; };
    ++calls_;
  }
  void beginExchange(const std::span<const std::byte>* out, const std::span<std::byte>* in) override {
    work_ = [from = out[1], to = in[1]] { std::copy(from.begin(), from.end(), to.begin()); };
    ++calls_;
  }
  void beginSum(std::span<int64_t> values) override {
    work_ = [values] {
      for (int64_t& value : values) value *= 2;
    };
    ++calls_;
  }
  bool isDone() override {
    if (calls_ > last_) return false;
    work_();
    return true;
  }
  void announceFailure() override { work_(); }
  unsigned failedCount() override { return 0; }
  void finish() override {}
  void abort(int) override { std::abort(); }

 private:
  const int last_;
  int calls_ = 0;
  std::function<void()> work_;
};

/// The ranks of `job`, whose call after the first `last` is left by an exception. Then all of the call's memory is used.
void leaveCall(int last, const std::function<void(Ranks& ranks)>& job) {
  SCOPED_TRACE(last);
  Ranks ranks(std::make_unique<EndlessTransport>(last));
  ranks.whileWaiting([] { throw Stopped(); });
  EXPECT_THROW(job(ranks), Stopped);
  ranks.announceFailure();
}

// The address sanitizer sees what this test is about.
TEST(Ranks, KeepTheMemoryOfACallThatAnExceptionLeaves) {
  for (const int last : {0, 1}) {  // the call that exchanges sizes, and the next
    leaveCall(last, [](Ranks& ranks) { ranks.gather(Ranks::Bytes(1000)); });
    leaveCall(last, [](Ranks& ranks) { ranks.broadcast(Ranks::Bytes(1000)); });
    leaveCall(last, [](Ranks& ranks) { ranks.exchange({Ranks::Bytes(10), Ranks::Bytes(100'000)}); });
    leaveCall(last, [](Ranks& ranks) {
      Messages to, from;
      to.begin(std::vector<uint64_t>{10, 100'000});
      std::fill(to.of(1).begin(), to.of(1).end(), std::byte{1});
      ranks.exchange(to, from);
    });
  }
  leaveCall(0, [](Ranks& ranks) {
    std::vector<int64_t> values(100);
    ranks.sum(std::span(values));
  });
}

TEST(Ranks, ExchangeAndSumBetweenTwo) {
  Ranks ranks(std::make_unique<EndlessTransport>(100));
  const Ranks::Bytes bytes(7, std::byte{3});
  EXPECT_EQ(ranks.exchange({{}, bytes}), (std::vector<Ranks::Bytes>{{}, bytes}));
  Messages to, from;
  for (const uint64_t count : {5u, 50u, 3u}) {
    to.begin(std::vector<uint64_t>{0, count});
    std::fill(to.of(1).begin(), to.of(1).end(), std::byte(count));
    ranks.exchange(to, from);
    EXPECT_EQ(from.of(0).size(), 0u);
    EXPECT_TRUE(std::ranges::equal(from.of(1), to.of(1)));
  }
  std::vector<int64_t> values{1, 2, 3};
  ranks.sum(std::span(values));
  EXPECT_EQ(values, (std::vector<int64_t>{2, 4, 6}));
}

}  // namespace
}  // namespace curvisplat
