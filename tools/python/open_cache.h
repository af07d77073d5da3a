// An open cache as Python sees it: what it holds, and pictures of it.
#pragma once

#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <sys/types.h>

#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "render/frame/step_player.h"
#include "stream/cache/cache_reader.h"
#include "tools/python/picture_arguments.h"

namespace curvisplat::python {

struct DrawnPicture {
  pybind11::array_t<float> rgba;  // (height, width, 4), premultiplied
  std::string chosen;             // options of `curvisplat render` that draw the same picture
  std::vector<std::string> notes, warnings;
  pybind11::dict channels;  // (height, width) by name
  FrameStatistics statistics;
};

/// A share of the data's volume for each of `bins` intervals from `low` to `high`.
struct HistogramArguments {
  std::string scalar;
  double low = 0, high = 1;
  bool log = false;
  size_t bins = 0;
};

/// One call at a time: a second thread gets a UsageError, as does a process that was forked, which lacks the threads. Threads and decoded bricks are kept from one picture of a
/// scalar to the next.
class OpenCache {
 public:
  /// Throws Error.
  explicit OpenCache(const std::filesystem::path& path);
  ~OpenCache();
  OpenCache(const OpenCache&) = delete;
  OpenCache& operator=(const OpenCache&) = delete;

  const CacheReader& reader() const { return reader_; }
  const std::filesystem::path& path() const { return path_; }
  /// The cache is busy as long as the result lives. With the interpreter's lock. Throws UsageError if it is.
  class Use {
   public:
    explicit Use(bool& busy) : busy_(busy) {}
    ~Use() { busy_ = false; }
    Use(const Use&) = delete;
    Use& operator=(const Use&) = delete;

   private:
    bool& busy_;
  };
  Use use();
  /// Throws UsageError and Error as `curvisplat render` does, and what stops runInterruptibly().
  DrawnPicture render(const PictureArguments& arguments, const pybind11::object& progress);
  /// Of the step that was drawn last. Throws UsageError for a range that is empty, or not above zero where `log`.
  std::vector<double> histogram(const HistogramArguments& arguments) const;
  /// Ends threads and gives back their memory; the next picture starts them again.
  void release();

 private:
  void goTo(const StepPosition& position);
  FrameRenderer& rendererOf(const DrawnScalars& scalars, Backend backend);

  const std::filesystem::path path_;
  const pid_t process_;
  CacheReader reader_;
  std::unique_ptr<StepPlayer> player_;  // of reader_
  size_t variable_ = 0;                 // of the opacities
  bool two_scalars_ = false;
  Backend backend_ = Backend::kAutomatic;
  bool busy_ = false;  // touched with the interpreter's lock held
};

}  // namespace curvisplat::python
