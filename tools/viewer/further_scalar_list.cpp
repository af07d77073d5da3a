#include "tools/viewer/further_scalar_list.h"

#include <chrono>
#include <exception>
#include <utility>

#include "stream/base/thread_name.h"

namespace curvisplat {

FurtherScalarList::FurtherScalarList(const ConversionServices& services, std::filesystem::path cache,
                                     std::vector<std::filesystem::path> files, void (*wake)())
    : services_(services), cache_(std::move(cache)), files_(std::move(files)), wake_(wake) {
  for (const std::filesystem::path& file : files_) {
    if (!known_.from.empty()) known_.from += ' ';
    known_.from += file.filename().string();
  }
}

void FurtherScalarList::look() {
  if (files_.empty() || std::exchange(asked_, true)) return;
  known_.is_looking = true;
  found_ = std::async(std::launch::async, [this] {
    nameThisThread("scalars");
    struct Wake {
      void (*wake)();
      ~Wake() { wake(); }
    } const at_the_end{wake_};
    return services_.further_scalars(cache_, files_);
  });
}

const FurtherScalars& FurtherScalarList::known() {
  if (!found_.valid() || found_.wait_for(std::chrono::seconds(0)) != std::future_status::ready) return known_;
  known_.is_looking = false;
  try {
    known_.scalars = found_.get();
  } catch (const std::exception& error) {
    known_.error = error.what();
  }
  return known_;
}

}  // namespace curvisplat
