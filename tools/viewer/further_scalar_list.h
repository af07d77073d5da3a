// The scalars that a cache's sources have and the cache lacks: looked for on a thread of its own when someone asks, since
// opening the sources can take as long as reading them.
#pragma once

#include <filesystem>
#include <future>
#include <string>
#include <vector>

#include "tools/viewer/conversion_services.h"

namespace curvisplat {

/// What is known so far. For the main thread.
struct FurtherScalars {
  std::string from;                          // the names of the files; empty: there are none
  bool is_looking = false, is_busy = false;  // busy: one is being added
  std::vector<SourceScalar> scalars;
  std::string error;
  std::string note;  // why there are none and what to do, or empty
};

class FurtherScalarList {
 public:
  /// `files` may be empty: then there are none. Calls `wake` when something is found. Opens nothing yet.
  FurtherScalarList(const ConversionServices& services, std::filesystem::path cache,
                    std::vector<std::filesystem::path> files, void (*wake)());
  /// Does not wait for the thread, which may be reading for long: another view is to come at once. Any thread.
  ~FurtherScalarList();
  FurtherScalarList(const FurtherScalarList&) = delete;
  FurtherScalarList& operator=(const FurtherScalarList&) = delete;
  /// Waits for the threads of all lists that are gone. Before what `wake` needs ends.
  static void waitForThreads();

  /// Looks, if nobody has asked before.
  void look();
  const FurtherScalars& known();
  const std::vector<std::filesystem::path>& files() const { return files_; }

 private:
  const ConversionServices services_;
  const std::filesystem::path cache_;
  const std::vector<std::filesystem::path> files_;
  void (*const wake_)();
  bool asked_ = false;
  FurtherScalars known_;
  std::future<std::vector<SourceScalar>> found_;
};

}  // namespace curvisplat
