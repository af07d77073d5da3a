#include <liburing.h>
#include <sys/eventfd.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>

#include "stream/base/check.h"
#include "stream/base/error.h"
#include "stream/paging/async_reads.h"

namespace curvisplat {
namespace {

constexpr uint64_t kWakeTag = ~uint64_t{0};

// The kernel may put off what it has no memory for; so many times in a row, it has broken off.
constexpr unsigned kMaxPutOff = 1000;

/// A read of an event counter is always under way beside the others: adding to the counter is what wakes.
class UringReads : public AsyncReads {
 public:
  /// `ring` and `event` become its own.
  UringReads(const io_uring& ring, int event) : ring_(ring), event_(event) { listen(); }

  ~UringReads() override {
    // Until they end, the reads' memory is the kernel's; those that it was never told of have not begun. One more
    // is under way beside them, which wake() ends.
    wake();
    for (unsigned in_kernel = under_way_ + 1 - io_uring_sq_ready(&ring_); in_kernel > 0;) {
      io_uring_cqe* end = nullptr;
      if (io_uring_wait_cqe(&ring_, &end) != 0) continue;  // interrupted
      io_uring_cqe_seen(&ring_, end);
      --in_kernel;
    }
    io_uring_queue_exit(&ring_);
    ::close(event_);
  }

  const char* name() const override { return "io_uring"; }

  void submit(const AsyncRead& read) override {
    put(read);
    ++under_way_;
  }

  std::optional<AsyncReadEnd> wait() override {
    io_uring_cqe* end = nullptr;
    for (unsigned put_off = 0; io_uring_peek_cqe(&ring_, &end) != 0;) {
      const int result = io_uring_submit_and_wait(&ring_, 1);
      const bool is_put_off = result == -EAGAIN || result == -EBUSY;
      if (result < 0 && result != -EINTR && !(is_put_off && ++put_off < kMaxPutOff))
        throw Error("reading by io_uring broke off: {}", std::strerror(-result));
    }
    const AsyncReadEnd ended{io_uring_cqe_get_data64(end), end->res};
    io_uring_cqe_seen(&ring_, end);
    if (ended.tag == kWakeTag) {
      listen();
      return {};
    }
    --under_way_;
    return ended;
  }

  void wake() override {
    const uint64_t one = 1;
    // Fails only where the counter is full, and then it wakes anyway.
    [[maybe_unused]] const ssize_t written = ::write(event_, &one, sizeof one);
  }

 private:
  void listen() { put({event_, 0, reinterpret_cast<std::byte*>(&counter_), sizeof counter_, kWakeTag}); }

  /// Told to the kernel by the next wait().
  void put(const AsyncRead& read) {
    io_uring_sqe* entry = io_uring_get_sqe(&ring_);
    CURVISPLAT_CHECK(entry && "no more reads at once than the depth");
    io_uring_prep_read(entry, read.fd, read.to, static_cast<unsigned>(read.count), read.offset);
    io_uring_sqe_set_data64(entry, read.tag);
  }

  io_uring ring_;
  const int event_;
  uint64_t counter_ = 0;
  unsigned under_way_ = 0;
};

}  // namespace

std::unique_ptr<AsyncReads> makeUringReads(unsigned depth) {
  io_uring ring;
  if (io_uring_queue_init(depth + 1, &ring, 0) != 0) return nullptr;
  // Kernels before 5.6 have io_uring without plain reads.
  io_uring_probe* probe = io_uring_get_probe_ring(&ring);
  const bool reads = probe && io_uring_opcode_supported(probe, IORING_OP_READ);
  if (probe) io_uring_free_probe(probe);
  const int event = reads ? ::eventfd(0, EFD_CLOEXEC) : -1;
  if (event < 0) {
    io_uring_queue_exit(&ring);
    return nullptr;
  }
  return std::make_unique<UringReads>(ring, event);
}

}  // namespace curvisplat
