// What an addition of scalars holds while it works: the cache's lock, and a folder for temporary files. Of several ranks
// that add together, rank 0 holds both, and each has a folder of its own in that folder.
#pragma once

#include <filesystem>
#include <memory>
#include <optional>

#include "preprocess/convert/scratch_folder.h"
#include "stream/base/ranks.h"
#include "stream/cache/cache_lock.h"

namespace curvisplat {

class AdditionWorkspace {
 public:
  /// `ranks`: all of them have to call it, and the cache is locked when it returns; null: this process alone. Removes the
  /// temporary files of additions that were killed. Throws Error if another program is changing the cache, or if a rank
  /// does not see the folder.
  AdditionWorkspace(const std::filesystem::path& cache, const std::filesystem::path& temporary_folder,
                    Ranks* ranks);
  /// Removes the folder.
  ~AdditionWorkspace();
  AdditionWorkspace(const AdditionWorkspace&) = delete;
  AdditionWorkspace& operator=(const AdditionWorkspace&) = delete;

  /// At rank 0.
  const CacheLock& lock() const { return *lock_; }
  /// The folder that all ranks see.
  const std::filesystem::path& shared() const { return shared_; }
  /// This rank's own.
  const std::filesystem::path& own() const { return own_; }

 private:
  std::optional<CacheLock> lock_;  // before the folder is made
  std::unique_ptr<ScratchFolder> folder_;
  std::filesystem::path shared_, own_;
};

}  // namespace curvisplat
