#include "stream/base/threads.h"

#include <utility>

#include "stream/base/error.h"
#include "stream/base/os.h"

namespace curvisplat {

void nameThisThread(const char* name) {
  os::nameThread(name);
}

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
    const MutexLock lock(mutex_);
    ending_ = true;
  }
  started_.notify_all();
  for (std::thread& thread : threads_) thread.join();
}

void WorkerTeam::start(std::function<void(unsigned)> job) {
  {
    const MutexLock lock(mutex_);
    CURVISPLAT_CHECK_OP(working_, ==, 0u);
    job_ = std::move(job);
    working_ = size();
    ++jobs_;
  }
  started_.notify_all();
}

void WorkerTeam::wait() {
  MutexLock lock(mutex_);
  while (working_ > 0) done_.wait(lock);
}

void WorkerTeam::loop(unsigned number, const char* name) {
  nameThisThread(name);
  uint64_t done = 0;
  MutexLock lock(mutex_);
  while (true) {
    while (!ending_ && jobs_ == done) started_.wait(lock);
    if (jobs_ == done) return;
    done = jobs_;
    lock.unlock();
    job_(number);
    lock.lock();
    if (--working_ == 0) done_.notify_all();
  }
}

}  // namespace curvisplat
