// Threads of low priority for work that the window goes on beside.
//
// TBB has one set of threads for the whole program, and they draw the pictures. Linux lets an ordinary user lower a thread's
// priority, but not raise it again: a thread that converted at low priority would draw at low priority ever after, and one of
// normal priority takes the cores from the window. So background work has threads of its own. Its loops run in an arena that
// TBB's threads do not enter.
#pragma once

#include <tbb/task_arena.h>
#include <tbb/task_group.h>

#include <deque>
#include <functional>
#include <thread>
#include <vector>

namespace curvisplat {

class BackgroundThreads {
 public:
  /// Starts one thread fewer than the machine has cores: the thread that calls run() is the last. `nice`: as nice(1), 0 to 19.
  explicit BackgroundThreads(int nice);
  /// Ends them. Not while run() runs.
  ~BackgroundThreads();
  BackgroundThreads(const BackgroundThreads&) = delete;
  BackgroundThreads& operator=(const BackgroundThreads&) = delete;

  /// Does `work` in the calling thread, which has this priority from now on, and its parallel loops in all of these threads.
  /// Throws what `work` throws.
  void run(const std::function<void()>& work);

 private:
  void end();

  const int nice_;
  tbb::task_arena arena_;
  std::deque<tbb::task_group> ends_;       // what each thread waits for, doing the arena's work meanwhile
  std::vector<tbb::task_handle> keeping_;  // the tasks of these groups, which nobody runs
  std::vector<std::thread> threads_;
};

}  // namespace curvisplat
