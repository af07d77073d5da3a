#include "tools/viewer/further_scalar_list.h"

#include <chrono>
#include <exception>
#include <utility>

#include "stream/base/mutex.h"
#include "stream/base/thread_name.h"

namespace curvisplat {
namespace {

/// What the threads of lists that are gone will find, and nobody asks for.
struct LeftThreads {
  Mutex mutex;
  std::vector<std::future<std::vector<SourceScalar>>> found GUARDED_BY(mutex);
};
LeftThreads& leftThreads() {
  static LeftThreads left;
  return left;
}

bool isReady(const std::future<std::vector<SourceScalar>>& found) {
  return found.wait_for(std::chrono::seconds(0)) == std::future_status::ready;
}

}  // namespace

FurtherScalarList::FurtherScalarList(const ConversionServices& services, std::filesystem::path cache,
                                     std::vector<std::filesystem::path> files, void (*wake)())
    : services_(services), cache_(std::move(cache)), files_(std::move(files)), wake_(wake) {
  for (const std::filesystem::path& file : files_) {
    if (!known_.from.empty()) known_.from += ' ';
    known_.from += file.filename().string();
  }
}

FurtherScalarList::~FurtherScalarList() {
  LeftThreads& left = leftThreads();
  const MutexLock lock(left.mutex);
  std::erase_if(left.found, isReady);
  if (found_.valid() && !isReady(found_)) left.found.push_back(std::move(found_));
}

void FurtherScalarList::waitForThreads() {
  LeftThreads& left = leftThreads();
  const MutexLock lock(left.mutex);
  left.found.clear();
}

void FurtherScalarList::look() {
  if (files_.empty() || std::exchange(asked_, true)) return;
  known_.is_looking = true;
  // Of its own copies: the thread can outlive the list.
  found_ = std::async(std::launch::async,
                      [look = services_.further_scalars, cache = cache_, files = files_, wake = wake_] {
                        nameThisThread("scalars");
                        struct Wake {
                          void (*call)();
                          ~Wake() { call(); }
                        } const at_the_end{wake};
                        return look(cache, files);
                      });
}

const FurtherScalars& FurtherScalarList::known() {
  if (!found_.valid() || !isReady(found_)) return known_;
  known_.is_looking = false;
  try {
    known_.scalars = found_.get();
  } catch (const std::exception& error) {
    known_.error = error.what();
  }
  return known_;
}

}  // namespace curvisplat
