#include "stream/base/worker_team.h"

#include <utility>

#include "stream/base/check.h"
#include "stream/base/thread_name.h"

namespace curvisplat {

WorkerTeam::WorkerTeam(unsigned count, const char* name) {
  try {
    for (unsigned n = 0; n < count; ++n) threads_.emplace_back([this, n, name] { loop(n, name); });
  } catch (...) {
    end();
    throw;
  }
}

WorkerTeam::~WorkerTeam() {
  wait();
  end();
}

void WorkerTeam::end() {
  {
    const std::lock_guard lock(mutex_);
    ending_ = true;
  }
  started_.notify_all();
  for (std::thread& thread : threads_) thread.join();
}

void WorkerTeam::start(std::function<void(unsigned)> job) {
  {
    const std::lock_guard lock(mutex_);
    CURVISPLAT_CHECK_OP(working_, ==, 0u);
    job_ = std::move(job);
    working_ = size();
    ++jobs_;
  }
  started_.notify_all();
}

void WorkerTeam::wait() {
  std::unique_lock lock(mutex_);
  done_.wait(lock, [this] { return working_ == 0; });
}

void WorkerTeam::loop(unsigned number, const char* name) {
  nameThisThread(name);
  uint64_t done = 0;
  std::unique_lock lock(mutex_);
  while (true) {
    started_.wait(lock, [&] { return ending_ || jobs_ != done; });
    if (jobs_ == done) return;
    done = jobs_;
    lock.unlock();
    job_(number);
    lock.lock();
    if (--working_ == 0) done_.notify_all();
  }
}

}  // namespace curvisplat
