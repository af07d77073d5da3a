// RankTransport by MPI: a plug-in, loaded where the program was started by mpirun or srun. It needs nothing of
// curvisplat's libraries, so it can be built again for the MPI of a cluster.
//
// Calls do not block: isDone() tests. MPI's default error handler ends all ranks if MPI fails.
#include <mpi.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <memory>
#include <string_view>
#include <utility>
#include <vector>

#include "stream/base/ranks.h"

namespace curvisplat {
namespace {

constexpr int kExchangeTag = 1, kFailureTag = 2;
// MPI counts in int.
constexpr size_t kMaxMessage = size_t{1} << 30;

class MpiTransport final : public RankTransport {
 public:
  MpiTransport() {
    // A picture's splats are exchanged by a thread of their own, while the one that runs the job calls nothing.
    int granted = 0;
    MPI_Init_thread(nullptr, nullptr, MPI_THREAD_SERIALIZED, &granted);
    if (granted < MPI_THREAD_SERIALIZED) {
      std::fprintf(stderr,
                   "curvisplat: this MPI does not support MPI_THREAD_SERIALIZED, which curvisplat needs\n");
      MPI_Abort(MPI_COMM_WORLD, 1);
    }
    int rank = 0, count = 1;
    MPI_Comm_rank(MPI_COMM_WORLD, &rank);
    MPI_Comm_size(MPI_COMM_WORLD, &count);
    rank_ = static_cast<unsigned>(rank);
    count_ = static_cast<unsigned>(count);
    MPI_Comm_dup(MPI_COMM_WORLD, &work_);
    MPI_Comm_dup(MPI_COMM_WORLD, &failures_);
  }

  unsigned rank() const override { return rank_; }
  unsigned count() const override { return count_; }

  void beginSizes(const uint64_t* out, uint64_t* in) override {
    MPI_Ialltoall(out, 1, MPI_UINT64_T, in, 1, MPI_UINT64_T, work_, newRequest());
  }

  void beginExchange(const std::span<const std::byte>* out, const std::span<std::byte>* in) override {
    for (unsigned n = 0; n < count_; ++n) {
      if (n == rank_) {
        if (!out[n].empty()) std::memcpy(in[n].data(), out[n].data(), out[n].size());
        continue;
      }
      forMessages(in[n].size(), [&](size_t at, int bytes) {
        MPI_Irecv(in[n].data() + at, bytes, MPI_BYTE, static_cast<int>(n), kExchangeTag, work_, newRequest());
      });
    }
    for (unsigned n = 0; n < count_; ++n) {
      if (n == rank_) continue;
      forMessages(out[n].size(), [&](size_t at, int bytes) {
        MPI_Isend(out[n].data() + at, bytes, MPI_BYTE, static_cast<int>(n), kExchangeTag, work_,
                  newRequest());
      });
    }
  }

  void beginSum(std::span<int64_t> values) override {
    forMessages(values.size_bytes(), [&](size_t at, int bytes) {
      const size_t first = at / sizeof(int64_t);
      const int values_of_message = bytes / static_cast<int>(sizeof(int64_t));
      MPI_Iallreduce(MPI_IN_PLACE, values.data() + first, values_of_message, MPI_INT64_T, MPI_SUM, work_,
                     newRequest());
    });
  }

  bool isDone() override {
    int done = 0;
    MPI_Testall(static_cast<int>(requests_.size()), requests_.data(), &done, MPI_STATUSES_IGNORE);
    if (done) requests_.clear();
    return done != 0;
  }

  void announceFailure() override {
    if (std::exchange(announced_, true)) return;
    for (unsigned n = 0; n < count_; ++n) {
      MPI_Request request;  // the message is empty, and nobody waits for it
      if (n != rank_) MPI_Isend(nullptr, 0, MPI_BYTE, static_cast<int>(n), kFailureTag, failures_, &request);
    }
  }

  unsigned failedCount() override {
    int found = 0;
    MPI_Status status;
    while (MPI_Iprobe(MPI_ANY_SOURCE, kFailureTag, failures_, &found, &status), found) {
      MPI_Recv(nullptr, 0, MPI_BYTE, status.MPI_SOURCE, kFailureTag, failures_, MPI_STATUS_IGNORE);
      ++failed_count_;
    }
    return failed_count_;
  }

  void finish() override {
    MPI_Comm_free(&work_);
    MPI_Comm_free(&failures_);
    MPI_Finalize();
  }

  void abort(int status) override {
    MPI_Abort(MPI_COMM_WORLD, status);
    std::abort();
  }

 private:
  MPI_Request* newRequest() {
    requests_.emplace_back();
    return &requests_.back();
  }
  template <typename Use>
  static void forMessages(size_t bytes, const Use& use) {
    for (size_t at = 0; at < bytes; at += kMaxMessage)
      use(at, static_cast<int>(std::min(kMaxMessage, bytes - at)));
  }

  unsigned rank_ = 0, count_ = 1, failed_count_ = 0;
  bool announced_ = false;
  MPI_Comm work_ = MPI_COMM_NULL, failures_ = MPI_COMM_NULL;
  std::vector<MPI_Request> requests_;  // of the call under way
};

}  // namespace
}  // namespace curvisplat

/// Starts MPI. Null if the program that asks is of another version: its RankTransport may be another.
extern "C" __attribute__((visibility("default"))) curvisplat::RankTransport* curvisplatStartMpi(
    const char* version) {
  if (std::string_view(version) != CURVISPLAT_VERSION) return nullptr;
  return std::make_unique<curvisplat::MpiTransport>().release();
}
