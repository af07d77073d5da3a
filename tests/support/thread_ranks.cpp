#include "tests/support/thread_ranks.h"

#include <algorithm>
#include <cstdlib>
#include <exception>
#include <stdexcept>
#include <thread>
#include <utility>
#include <vector>

#include "stream/base/mutex.h"

namespace curvisplat {
namespace {

/// The memory that the ranks share. A call is made of two meetings: when all have come, each takes what is
/// for it; when all have taken it, the call ends.
struct Meeting {
  explicit Meeting(unsigned ranks) : sent(ranks) {}

  Mutex mutex;
  struct Sent {
    const uint64_t* sizes = nullptr;
    const std::span<const std::byte>* bytes = nullptr;
    std::span<int64_t> values;
  };
  std::vector<Sent> sent GUARDED_BY(mutex);
  uint64_t came GUARDED_BY(mutex) = 0, took GUARDED_BY(mutex) = 0;
  int failed GUARDED_BY(mutex) = -1;  // the first
  unsigned failed_count GUARDED_BY(mutex) = 0;
};

class ThreadTransport final : public RankTransport {
 public:
  ThreadTransport(Meeting& meeting, unsigned rank, unsigned count)
      : meeting_(meeting), rank_(rank), count_(count) {}

  unsigned rank() const override { return rank_; }
  unsigned count() const override { return count_; }

  void beginSizes(const uint64_t* out, uint64_t* in) override {
    begin({out, nullptr, {}}, [this, in](const std::vector<Meeting::Sent>& sent) {
      for (unsigned n = 0; n < count_; ++n) in[n] = sent[n].sizes[rank_];
    });
  }
  void beginExchange(const std::span<const std::byte>* out, const std::span<std::byte>* in) override {
    begin({nullptr, out, {}}, [this, in](const std::vector<Meeting::Sent>& sent) {
      for (unsigned n = 0; n < count_; ++n) {
        const auto from = sent[n].bytes[rank_];
        if (from.size() != in[n].size()) throw std::runtime_error("a message has another size");
        std::copy(from.begin(), from.end(), in[n].begin());
      }
    });
  }
  void beginSum(std::span<int64_t> values) override {
    own_.assign(values.begin(), values.end());
    begin({nullptr, nullptr, own_}, [values](const std::vector<Meeting::Sent>& sent) {
      std::fill(values.begin(), values.end(), 0);
      for (const Meeting::Sent& one : sent) {
        if (one.values.size() != values.size()) throw std::runtime_error("a sum has another size");
        for (size_t n = 0; n < values.size(); ++n) values[n] += one.values[n];
      }
    });
  }
  bool isDone() override {
    const MutexLock lock(meeting_.mutex);
    if (meeting_.failed >= 0) throw std::runtime_error("another rank has failed");
    if (take_ && meeting_.came == calls_ * count_) {
      take_(meeting_.sent);
      take_ = {};
      ++meeting_.took;
    }
    return !take_ && meeting_.took == calls_ * count_;
  }
  void announceFailure() override {
    const MutexLock lock(meeting_.mutex);
    if (meeting_.failed < 0) meeting_.failed = static_cast<int>(rank_);
    if (!std::exchange(announced_, true)) ++meeting_.failed_count;
  }
  unsigned failedCount() override {
    const MutexLock lock(meeting_.mutex);
    return meeting_.failed_count - announced_;
  }
  void finish() override {}
  void abort(int) override { std::abort(); }

 private:
  using Take = std::function<void(const std::vector<Meeting::Sent>&)>;

  void begin(const Meeting::Sent& sent, Take take) {
    const MutexLock lock(meeting_.mutex);
    take_ = std::move(take);
    ++calls_;
    meeting_.sent[rank_] = sent;
    ++meeting_.came;
  }

  Meeting& meeting_;
  const unsigned rank_, count_;
  std::vector<int64_t> own_;
  bool announced_ = false;
  Take take_;
  uint64_t calls_ = 0;
};

}  // namespace

void runRanks(unsigned count, const std::function<void(Ranks& ranks)>& job) {
  Meeting meeting(count);
  std::vector<std::exception_ptr> failures(count);
  std::vector<std::thread> threads;
  for (unsigned rank = 0; rank < count; ++rank)
    threads.emplace_back([&, rank] {
      Ranks ranks(std::make_unique<ThreadTransport>(meeting, rank, count));
      try {
        job(ranks);
      } catch (...) {
        failures[rank] = std::current_exception();
        ranks.transport()->announceFailure();
      }
    });
  for (std::thread& thread : threads) thread.join();
  int first = -1;
  {
    const MutexLock lock(meeting.mutex);
    first = meeting.failed;
  }
  if (first >= 0) std::rethrow_exception(failures[static_cast<size_t>(first)]);
}

}  // namespace curvisplat
