// A picture, from the cache to its file, and exported files of every format, frames and a movie, on a disk
// that fails at every call: a line that says so, or the right picture or file; never a part of one under its
// name, and nothing beside it.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <string>

#include "render/export/gaussian_files.h"
#include "render/export/gaussian_splats.h"
#include "render/export/vdb_file.h"
#include "render/frame/frame.h"
#include "render/image/image.h"
#include "render/image/image_file.h"
#include "stream/base/error.h"
#include "stream/cache/cache_reader.h"
#include "tests/support/fault_sweep.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/test_caches.h"
#include "tools/output/frame_output.h"

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

  /// Draws as `curvisplat render` does.
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

/// A brick that cannot be read is not taken for a damaged one; one that has been cut off is.
TEST_F(RenderSweep, KeepGoingIsForDamageNotForAFailingDisk) {
  keep_going_ = true;
  for (const Fault& fault : {faults::kFailsOnce, faults::kFailsFromThenOn}) {
    faults::FaultSweep sweep = drawing();
    sweep.check = [&, check = sweep.check](const FaultOutcome& outcome) {
      check(outcome);
      EXPECT_TRUE(!outcome.error.empty() || statistics_.bricks_unreadable.empty());
    };
    EXPECT_GE(sweep.run(fault), 7) << fault.name;
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

constexpr ImageSize kSize{40, 30};
constexpr int kFrames = 3;

class ExportSweep : public ::testing::Test {
 protected:
  ExportSweep() {
    writeLatticeCache(cache_, 0, {1, 0.5, 0.25});
    cache_files_ = filesOf(cache_);
  }

  static TransferFunction function() { return TransferFunction::preset("viridis", 0, 56, 8); }

  /// The files in made_, without the random number that OpenVDB gives each file (36 digits after 21 bytes).
  Files made() const {
    Files files = filesOf(made_);
    for (auto& [name, bytes] : files)
      if (name.ends_with(".vdb") && bytes.size() > 57) bytes.replace(21, 36, "");
    return files;
  }

  /// Exports as `curvisplat export` does.
  void exportTo(const fs::path& file) const {
    const CacheReader cache(cache_);
    Progress progress;
    if (file.extension() == ".vdb") {
      VdbOptions options;
      options.voxels = 16;
      options.memory_bytes = 64 << 20;
      options.threads = 2;
      writeVdb(cache, 0, options, file, progress);
    } else {
      writeGaussians(gaussianSplats(cache, 0, function(), 20'000, progress), file);
    }
  }

  /// Draws frames as `curvisplat render --orbit` does.
  void drawFrames(const fs::path& name) const {
    const CacheReader cache(cache_);
    const Manifest& manifest = cache.manifest();
    FrameRenderer renderer(cache, 0, function(), Backend::kCpu);
    FrameOptions options;
    options.size = kSize;
    options.lod_pixels = 0;
    options.threads = 2;
    options.memory_bytes = 64 << 20;
    const auto output = makeFrameOutput(name, true, kSize, 25);
    Camera camera =
        Camera::named("iso", manifest.lower, manifest.upper, kSize, Projection::kOrthographic, 30);
    for (int frame = 0; frame < kFrames; ++frame) {
      camera.parallel_scale *= 0.9;
      FrameStatistics statistics;
      output->write(static_cast<uint64_t>(frame), renderer.render(camera, options, statistics));
    }
    output->finish();
  }

  /// The sweep of a job that writes `expected`, in this order, where there was nothing, or `old`.
  faults::FaultSweep writing(const std::function<void()>& job, const Files& expected,
                             const Files& old) const {
    faults::FaultSweep sweep;
    sweep.in_message = folder_.path().string();
    sweep.to_be_cut = cache_.string();
    sweep.prepare = [this, old] {
      if (filesOf(cache_) != cache_files_) writeFiles(cache_, cache_files_);
      writeFiles(made_, old);
    };
    sweep.job = job;
    sweep.stride = 23;  // mostly reads, which RenderSweep tries
    sweep.check = [this, expected, old](const FaultOutcome& outcome) {
      const Files files = made();
      bool all = true;  // so far
      for (const auto& [name, bytes] : expected) {
        const auto found = files.find(name);
        const bool is_new = found != files.end() && found->second == bytes;
        const bool is_old =
            (found == files.end() ? "" : found->second) == (old.contains(name) ? old.at(name) : "");
        EXPECT_TRUE(is_new || is_old) << name << ": " << outcome.error;
        EXPECT_TRUE(all || !is_new) << name << " after a file that failed: " << outcome.error;
        all = all && is_new;
      }
      EXPECT_TRUE(all || !outcome.error.empty());
      if (outcome.has_refused_removal) return;
      for (const auto& [name, bytes] : files)
        EXPECT_TRUE(expected.contains(name)) << name << " is left: " << outcome.error;
    };
    return sweep;
  }

  const TemporaryFolder folder_;
  const fs::path cache_ = folder_ / "a.splats", made_ = folder_ / "made";
  Files cache_files_;
};

TEST_F(ExportSweep, AFileIsRightOrNotThere) {
  for (const std::string file : {"a.ply", "a.spz", "a.glb", "a.vdb"}) {
    const auto job = [&] { exportTo(made_ / file); };
    writeFiles(made_, {});
    job();
    const Files expected = made();
    ASSERT_EQ(expected.size(), 1u);
    ASSERT_GT(expected.begin()->second.size(), 1000u);
    for (const Fault& fault : kFaults) {
      // OpenVDB writes by a stream of its own, after curvisplat has made the file.
      const bool has_none = file == "a.vdb" && fault.at == faults::kIsFull.at;
      EXPECT_GE(writing(job, expected, {{file, "an old file"}}).run(fault), has_none ? 0 : 1)
          << file << ": " << fault.name;
      if (HasFailure()) return;
    }
    EXPECT_GE(writing(job, expected, {}).run(faults::kFailsOnce), 7) << file;
    if (HasFailure()) return;
  }
}

TEST_F(ExportSweep, FramesAreRightOrNotThere) {
  for (const std::string name : {"a%d.png", "a.html"}) {
    const auto job = [&] { drawFrames(made_ / name); };
    writeFiles(made_, {});
    job();
    const Files expected = made();
    ASSERT_EQ(expected.size(), name == "a.html" ? size_t{1} : size_t{kFrames});
    for (const Fault& fault : kFaults) {
      EXPECT_GE(writing(job, expected, {{name == "a.html" ? "a.html" : "a1.png", "an old file"}}).run(fault),
                1)
          << name << ": " << fault.name;
      if (HasFailure()) return;
    }
  }
}

/// The calls of ours: ffmpeg makes others.
TEST_F(ExportSweep, AMovieIsRightOrNotThere) {
  if (std::system("ffmpeg -version > /dev/null 2>&1") != 0) GTEST_SKIP() << "ffmpeg is not installed";
  const auto job = [&] { drawFrames(made_ / "a.gif"); };
  writeFiles(made_, {});
  job();
  const Files expected = made();
  ASSERT_EQ(expected.size(), 1u);
  faults::FaultSweep sweep = writing(job, expected, {{"a.gif", "an old movie"}});
  for (const Fault& fault :
       {faults::kFailsOnce, faults::kFailsFromThenOn, faults::kFailsToSync, faults::kFailsToRename}) {
    EXPECT_GE(sweep.run(fault), 1) << fault.name;
    if (HasFailure()) return;
  }
}

}  // namespace
}  // namespace curvisplat
