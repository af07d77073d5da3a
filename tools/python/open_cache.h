// An open cache as Python sees it, and pictures of it. PictureArguments are what the package's render()
// passes, as the arguments of `curvisplat render`: values come as text, so that the two read them alike.
//
// One call at a time uses an OpenCache; its threads and decoded bricks are kept from one picture of a scalar
// to the next. Call all functions with the interpreter's lock, which the members are guarded by; those that read files give it up
// meanwhile, and drawing goes on without it (interruptible.h). Facts about the cache can be read at any time, also from a
// function of Python that shows the progress of a picture: they are of the step that was drawn last, until the picture is done.
#pragma once

#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <sys/types.h>

#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "render/frame/frame.h"
#include "stream/cache/cache_reader.h"
#include "tools/options/annotation_arguments.h"
#include "tools/options/frame_arguments.h"
#include "tools/options/frame_sequence.h"
#include "tools/options/opacity_arguments.h"
#include "tools/options/picture_choice.h"
#include "tools/options/scene_arguments.h"

namespace curvisplat::python {

/// The text of each option.
using Options = std::map<std::string, std::string>;

/// Everything a picture is drawn with. What the function and the camera leave out is chosen from the data.
struct PictureArguments {
  ScalarArguments scalar;
  OpacityArguments opacity;
  CameraArguments camera;
  FrameOptions frame;
  SurfaceArguments surfaces;
  AnnotationArguments annotations;
  StepArguments steps;  // of one step
  ValueChannels channels;
  Backend backend = Backend::kAutomatic;
  std::optional<std::string> vertical_scale = std::nullopt;
};

CameraArguments cameraArguments(const Options& camera);

/// `others`: lists, flags and numbers. Throws UsageError as the command does.
PictureArguments pictureArguments(const Options& function, const Options& camera, const Options& frame,
                                  const pybind11::dict& others);

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

/// An open cache. While one call uses it, another one gets a UsageError, as does a process that was forked,
/// which lacks the threads.
class OpenCache {
 public:
  /// `mirror`: kept as long as the cache, if its files come from elsewhere.
  explicit OpenCache(CacheReader reader, std::shared_ptr<void> mirror = nullptr);
  ~OpenCache();
  OpenCache(const OpenCache&) = delete;
  OpenCache& operator=(const OpenCache&) = delete;

  /// The cache at the step that was drawn last, which stays as it is when another one is drawn.
  std::shared_ptr<const CacheReader> reader() const { return shown_; }
  /// The cache of CacheReader::ownBlanks(set), open as long as this one. Several threads may open it at once; one of them is kept.
  /// Throws Error as opening it does, and UsageError in a process that was forked.
  OpenCache& ownBlanks(size_t set);
  /// All caches of scalars with blanks of their own. Throws as ownBlanks().
  std::vector<OpenCache*> allOwnBlanks();
  /// The cache with the scalar: this one, or the one of scalars with blanks of their own. Throws as ownBlanks().
  OpenCache& withScalar(const std::string& name);
  /// Keeps the cache busy during its lifetime.
  class Use {
   public:
    explicit Use(bool& busy) : busy_(busy) {}
    ~Use() { busy_ = false; }
    Use(const Use&) = delete;
    Use& operator=(const Use&) = delete;

   private:
    bool& busy_;
  };
  /// Covers the caches of scalars with blanks of their own, too. Throws UsageError if the cache is busy.
  Use use();
  /// Call it while use() holds, for a scalar of this cache (withScalar()). Throws UsageError and Error as `curvisplat render` does, and what stops runInterruptibly().
  DrawnPicture render(const PictureArguments& arguments, const pybind11::object& progress);
  /// The histogram of the step that was drawn last. Throws UsageError for a range that is empty, or not above
  /// zero where `log`.
  std::vector<double> histogram(const HistogramArguments& arguments) const;
  /// Ends threads and gives back their memory; the next picture starts them again. Throws as use().
  void release();

 private:
  void requireOwnProcess() const;
  void goTo(const StepPosition& position);
  void endPlayer();
  FrameRenderer& rendererOf(const DrawnScalars& scalars, Backend backend);

  const std::shared_ptr<void> mirror_;                       // first: it goes last
  std::map<size_t, std::unique_ptr<OpenCache>> own_blanks_;  // by number in the manifest; none is removed
  const pid_t process_;
  std::shared_ptr<const CacheReader> shown_;
  CacheReader reader_;                  // goes from step to step; for what uses the cache
  std::unique_ptr<StepPlayer> player_;  // of reader_
  size_t variable_ = 0;                 // of the opacities
  bool two_scalars_ = false;
  Backend backend_ = Backend::kAutomatic;
  bool busy_ = false;
};

}  // namespace curvisplat::python
