// makeUringReads() of async_reads.h. uring_reads_left_out.cpp stands in for this file where there is no io_uring.
#include <liburing.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstdlib>
#include <cstring>

#include "stream/base/error.h"
#include "stream/paging/async_reads.h"

namespace curvisplat {
namespace {

constexpr uint64_t kWakeTag = ~uint64_t{0};

// The kernel answers EAGAIN or EBUSY if it has no memory. After this many in a row, reading has
// failed.
constexpr unsigned kMaxRefusals = 1000;

/// Two connected sockets that do not block.
using Sockets = std::array<int, 2>;

/// Reads by io_uring. A poll of a socket is always under way beside the reads: writing to the other socket
/// wakes the owner. (An event counter would do as well, but if writing to it failed, nothing could wake the
/// owner. Shutting down the connection can.)
class UringReads : public AsyncReads {
 public:
  /// Takes over `ring` and `sockets`.
  UringReads(const io_uring& ring, const Sockets& sockets) : ring_(ring), sockets_(sockets) { listen(); }

  ~UringReads() override {
    // The kernel writes to the reads' memory until they end. Those that it was never told of have not begun.
    // The poll ends with the connection.
    disconnect();
    for (unsigned in_kernel = under_way_ + (listening_ ? 1 : 0) - io_uring_sq_ready(&ring_); in_kernel > 0;) {
      io_uring_cqe* end = nullptr;
      if (io_uring_wait_cqe(&ring_, &end) != 0) continue;  // interrupted
      io_uring_cqe_seen(&ring_, end);
      --in_kernel;
    }
    io_uring_queue_exit(&ring_);
    for (const int socket : sockets_) ::close(socket);
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
      if (result < 0 && result != -EINTR && !(is_put_off && ++put_off < kMaxRefusals))
        throw Error("reading with io_uring failed: {}", std::strerror(-result));
    }
    const AsyncReadEnd ended{io_uring_cqe_get_data64(end), end->res};
    io_uring_cqe_seen(&ring_, end);
    if (ended.tag == kWakeTag) {
      listening_ = false;
      if (!drain()) throw Error("reading with io_uring failed: its thread can no longer be woken");
      listen();
      return {};
    }
    --under_way_;
    return ended;
  }

  void wake() override {
    const char any = 0;
    ssize_t written;
    do {
      written = ::send(sockets_[1], &any, 1, MSG_NOSIGNAL);
    } while (written < 0 && errno == EINTR);
    // A full socket (EAGAIN) wakes anyway.
    if (written < 0 && errno != EAGAIN) disconnect();
  }

 private:
  void listen() {
    io_uring_sqe* entry = nextEntry();
    io_uring_prep_poll_add(entry, sockets_[0], POLLIN);
    io_uring_sqe_set_data64(entry, kWakeTag);
    listening_ = true;
  }

  /// Reads what has woken. Returns false after disconnect().
  bool drain() {
    std::array<char, 256> ignored;
    ssize_t got;
    do {
      got = ::read(sockets_[0], ignored.data(), ignored.size());
    } while (got > 0 || (got < 0 && errno == EINTR));
    return got < 0;
  }

  void disconnect() { ::shutdown(sockets_[1], SHUT_RDWR); }

  io_uring_sqe* nextEntry() {
    io_uring_sqe* entry = io_uring_get_sqe(&ring_);
    CURVISPLAT_CHECK(entry && "no more reads at once than the depth");
    return entry;
  }

  /// Queues a read. The next wait() submits it to the kernel.
  void put(const AsyncRead& read) {
    io_uring_sqe* entry = nextEntry();
    io_uring_prep_read(entry, read.fd, read.to, static_cast<unsigned>(read.count), read.offset);
    io_uring_sqe_set_data64(entry, read.tag);
  }

  io_uring ring_;
  const Sockets sockets_;  // the poll's, wake()'s
  bool listening_ = false;
  unsigned under_way_ = 0;
};

/// Whether the kernel takes what is submitted. A container may allow io_uring_setup but not io_uring_enter.
bool canSubmit(io_uring& ring) {
  io_uring_prep_nop(io_uring_get_sqe(&ring));
  int result;
  do {
    result = io_uring_submit_and_wait(&ring, 1);
  } while (result == -EINTR);
  io_uring_cqe* end = nullptr;
  if (result < 0 || io_uring_peek_cqe(&ring, &end) != 0) return false;
  io_uring_cqe_seen(&ring, end);
  return true;
}

/// Valgrind (3.19) lets no other thread run while one waits in io_uring_enter. It preloads libraries of its own.
bool underValgrind() {
  const char* const preloaded = std::getenv("LD_PRELOAD");
  return preloaded && std::strstr(preloaded, "/vgpreload_");
}

}  // namespace

std::unique_ptr<AsyncReads> makeUringReads(unsigned depth) {
  if (underValgrind()) return nullptr;
  io_uring ring;
  if (io_uring_queue_init(depth + 1, &ring, 0) != 0) return nullptr;
  // Kernels before 5.6 have io_uring without plain reads.
  io_uring_probe* probe = io_uring_get_probe_ring(&ring);
  const bool reads = probe && io_uring_opcode_supported(probe, IORING_OP_READ);
  if (probe) io_uring_free_probe(probe);
  Sockets sockets{-1, -1};
  if (!reads || !canSubmit(ring) ||
      ::socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0, sockets.data()) < 0) {
    io_uring_queue_exit(&ring);
    return nullptr;
  }
  return std::make_unique<UringReads>(ring, sockets);
}

}  // namespace curvisplat
