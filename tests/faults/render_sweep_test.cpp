// A picture, from the cache to its file, on a disk that fails at every call: a line that says so, or the
// right picture; never a part of one under its name.
#include <gtest/gtest.h>

#include "render/frame/frame.h"
#include "render/image/image.h"
#include "render/image/image_file.h"
#include "stream/base/error.h"
#include "stream/cache/cache_reader.h"
#include "tests/support/fault_sweep.h"
#include "tests/support/folder_files.h"
#include "tests/support/lattice_cache.h"
#include "tests/support/temporary_folder.h"

namespace curvisplat {
namespace {

namespace fs = std::filesystem;
using faults::Fault;
using faults::FaultOutcome;
using faults::kFaults;

class RenderSweep : public ::testing::Test {
 protected:
  RenderSweep() {
    writeLatticeCache(cache_, 0, {1, 0.5, 0.25});
    cache_files_ = filesOf(cache_);
    writeFiles(pictures_, {});
    draw();
    picture_ = filesOf(pictures_).at("a.png");
  }

  /// As `curvisplat render` does.
  void draw() {
    const CacheReader cache(cache_);
    const Manifest& manifest = cache.manifest();
    FrameRenderer renderer(cache, 0, TransferFunction::preset("viridis", 0, 56, 8), Backend::kCpu);
    FrameOptions options;
    options.size = {40, 30};
    options.lod_pixels = 0;
    options.threads = 2;
    options.memory_bytes = 64 << 20;
    options.keep_going = keep_going_;
    const Camera camera =
        Camera::named("iso", manifest.lower, manifest.upper, options.size, Projection::kOrthographic, 30);
    const Image image = renderer.render(camera, options, statistics_);
    writeImage(image, pictures_ / "a.png");
  }

  faults::FaultSweep drawing() {
    faults::FaultSweep sweep;
    sweep.in_message = folder_.path().string();
    sweep.to_be_cut = cache_.string();
    sweep.prepare = [this] {
      if (filesOf(cache_) != cache_files_) writeFiles(cache_, cache_files_);
      writeFiles(pictures_, {{"a.png", "an old picture"}});
    };
    sweep.job = [this] { draw(); };
    sweep.check = [this](const FaultOutcome& outcome) {
      const Files files = filesOf(pictures_);
      const bool is_new = files.at("a.png") == picture_;
      EXPECT_TRUE(is_new || (!outcome.error.empty() && files.at("a.png") == "an old picture"))
          << outcome.error;
      EXPECT_TRUE(files.size() == 1 || outcome.has_refused_removal);
    };
    return sweep;
  }

  const TemporaryFolder folder_;
  const fs::path cache_ = folder_ / "a.splats", pictures_ = folder_ / "pictures";
  Files cache_files_;
  std::string picture_;
  bool keep_going_ = false;
  FrameStatistics statistics_;
};

TEST_F(RenderSweep, APictureIsRightOrNotThere) {
  for (const Fault& fault : kFaults) {
    EXPECT_GE(drawing().run(fault), 1) << fault.name;
    if (HasFailure()) return;
  }
}

/// What cannot be read is not taken for a damaged brick; what has been cut off is.
TEST_F(RenderSweep, KeepGoingIsForDamageNotForAFailingDisk) {
  keep_going_ = true;
  for (const Fault& fault : {faults::kFailsOnce, faults::kFailsFromThenOn}) {
    faults::FaultSweep sweep = drawing();
    sweep.check = [&, check = sweep.check](const FaultOutcome& outcome) {
      check(outcome);
      EXPECT_TRUE(!outcome.error.empty() || statistics_.bricks_unreadable.empty());
    };
    EXPECT_GE(sweep.run(fault), 10) << fault.name;
    if (HasFailure()) return;
  }
  int64_t stood_in_for = 0;
  faults::FaultSweep sweep = drawing();
  sweep.check = [&](const FaultOutcome& outcome) {
    if (outcome.error.empty()) stood_in_for += !statistics_.bricks_unreadable.empty();
  };
  sweep.run(faults::kIsCutOff);
  EXPECT_GT(stood_in_for, 0);
}

TEST_F(RenderSweep, ShortInterruptedAndSlowReadsGiveTheSamePicture) {
  for (const bool is_slow : {false, true}) {
    writeFiles(pictures_, {});
    faults::FaultySystemCalls faulty;
    faulty.is_slow = is_slow;
    faulty.largest_transfer = 777;
    faulty.interrupt_every = 3;
    {
      const ScopedSystemCalls scope(faulty);
      draw();
    }
    EXPECT_EQ(filesOf(pictures_).at("a.png"), picture_);
  }
}

}  // namespace
}  // namespace curvisplat
