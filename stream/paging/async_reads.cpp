#include "stream/paging/async_reads.h"

#include <fcntl.h>
#include <fmt/format.h>

#include <cerrno>
#include <cstring>
#include <deque>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "stream/base/error.h"
#include "stream/base/file.h"
#include "stream/base/mirror.h"
#include "stream/base/mutex.h"
#include "stream/base/os.h"
#include "stream/base/threads.h"
#include "stream/base/trace.h"

namespace curvisplat {

DirectFile::DirectFile(std::filesystem::path path, bool direct) : path_(std::move(path)) {
  buffered_fd_ = openRetrying(path_, O_RDONLY);
  if (buffered_fd_ < 0)
    throw Error("{}: cannot be opened for reading: {}", path_.string(), std::strerror(errno));
  os::expectRandomReads(buffered_fd_);
  if (direct && os::directFlag() != 0 && !isMirrored(path_))
    direct_fd_ = openRetrying(path_, O_RDONLY | os::directFlag());
}

DirectFile::~DirectFile() {
  if (direct_fd_ >= 0) SystemCalls::current().close(direct_fd_);
  SystemCalls::current().close(buffered_fd_);
}

namespace {

/// Reads by threads that each wait in pread.
class ThreadReads : public AsyncReads {
 public:
  explicit ThreadReads(unsigned depth) : name_(fmt::format("pread on {} threads", depth)) {
    try {
      for (unsigned n = 0; n < depth; ++n) threads_.emplace_back([this] { loop(); });
    } catch (...) {
      stop();
      throw;
    }
  }

  ~ThreadReads() override { stop(); }

  const char* name() const override { return name_.c_str(); }

  void submit(const AsyncRead& read) override {
    {
      const MutexLock lock(mutex_);
      waiting_.push_back(read);
    }
    submitted_.notify_one();
  }

  std::optional<AsyncReadEnd> wait() override {
    MutexLock lock(mutex_);
    while (!woken_ && ended_.empty()) changed_.wait(lock);
    if (ended_.empty()) {
      woken_ = false;
      return {};
    }
    const AsyncReadEnd end = ended_.front();
    ended_.pop_front();
    return end;
  }

  void wake() override {
    {
      const MutexLock lock(mutex_);
      woken_ = true;
    }
    changed_.notify_one();
  }

 private:
  void loop() {
    nameThisThread("read");
    MutexLock lock(mutex_);
    while (true) {
      while (!stopping_ && waiting_.empty()) submitted_.wait(lock);
      if (waiting_.empty()) return;
      const AsyncRead read = waiting_.front();
      waiting_.pop_front();
      lock.unlock();
      ssize_t got;
      int error;
      {
        const TraceScope trace("read");
        got = SystemCalls::current().pread(read.fd, read.to, read.count, static_cast<int64_t>(read.offset));
        error = errno;
      }
      lock.lock();
      ended_.push_back({read.tag, got < 0 ? -error : got});
      changed_.notify_one();
    }
  }

  void stop() {
    {
      const MutexLock lock(mutex_);
      stopping_ = true;
    }
    submitted_.notify_all();
    for (std::thread& thread : threads_) thread.join();
  }

  const std::string name_;
  Mutex mutex_;
  std::deque<AsyncRead> waiting_ GUARDED_BY(mutex_);
  std::deque<AsyncReadEnd> ended_ GUARDED_BY(mutex_);
  bool woken_ GUARDED_BY(mutex_) = false, stopping_ GUARDED_BY(mutex_) = false;
  ConditionVariable submitted_;  // a read waits for a thread, or all are to stop
  ConditionVariable changed_;    // a read has ended, or the owner is to wake
  std::vector<std::thread> threads_;
};

}  // namespace

std::unique_ptr<AsyncReads> makeThreadReads(unsigned depth) {
  return std::make_unique<ThreadReads>(depth);
}

}  // namespace curvisplat
