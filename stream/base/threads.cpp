#include "stream/base/threads.h"

#include <cerrno>
#include <system_error>
#include <utility>

#include "stream/base/error.h"
#include "stream/base/os.h"

namespace curvisplat {

void nameThisThread(const char* name) {
  os::nameThread(name);
}

int errorOfThreads(unsigned count, size_t spare_bytes) {
  Mutex mutex;  // guards `ending`
  bool ending = false;
  ConditionVariable changed;
  std::vector<std::thread> threads;
  int error = 0;
  try {
    threads.reserve(count);
    while (threads.size() < count)
      threads.emplace_back([&] {
        MutexLock lock(mutex);
        while (!ending) changed.wait(lock);
      });
    requireSpareMemory(spare_bytes);
  } catch (const std::system_error& failure) {
    error = failure.code().value();
  } catch (const std::bad_alloc&) {
    error = ENOMEM;
  }
  {
    const MutexLock lock(mutex);
    ending = true;
  }
  changed.notify_all();
  for (std::thread& thread : threads) thread.join();
  return error;
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
