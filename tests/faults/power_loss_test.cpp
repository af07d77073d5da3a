// What is left when the power goes at any moment of a conversion, an addition, or the writing of a picture: a
// cache that is whole, or none; the old one or the new one.
#include <gtest/gtest.h>

#include "render/image/image.h"
#include "render/image/image_file.h"
#include "stream/base/error.h"
#include "stream/cache/cache_reader.h"
#include "tests/faults/small_conversion.h"
#include "tests/support/power_loss.h"

namespace curvisplat {
namespace {

namespace fs = std::filesystem;
using faults::DiskState;
using faults::forEachPowerLoss;
using faults::RecordingSystemCalls;

class PowerLoss : public SmallConversion {
 protected:
  PowerLoss() { setUp(twoBlocks(8)); }

  /// Every folder that opens as a cache must be one of the two.
  void expectNoneWrong(const DiskState& state) {
    for (const auto& [name, files] : state) {
      if (name.empty() || !files.contains("manifest.json")) continue;  // nothing opens without
      if (holdsAllOf(files, one_) || holdsAllOf(files, both_)) continue;
      writeFiles(folder_ / "state", files);
      EXPECT_THROW(CacheReader{folder_ / "state"}, Error) << name;
    }
  }
  static bool holds(const DiskState& state, const Files& cache) {
    const auto found = state.find("a.splats");
    return found != state.end() && holdsAllOf(found->second, cache);
  }
};

TEST_F(PowerLoss, AConversionIsWholeOrNoCache) {
  RecordingSystemCalls recording;
  {
    const ScopedSystemCalls scope(recording);
    convertNow({0, 1}, {});
  }
  size_t states = 0;
  forEachPowerLoss(work_, {{"", {}}}, recording.calls(), [&](const DiskState& state, size_t call) {
    ++states;
    expectNoneWrong(state);
    // Once the conversion says that it is done, it is.
    EXPECT_TRUE(call < recording.calls().size() || holds(state, both_));
  });
  EXPECT_GT(states, recording.calls().size());
}

TEST_F(PowerLoss, AnOldCacheIsTheNewOneOrWhatItWas) {
  startWithOne();
  RecordingSystemCalls recording;
  {
    const ScopedSystemCalls scope(recording);
    convertNow({0, 1}, {true, false});
  }
  forEachPowerLoss(work_, {{"", {}}, {"a.splats", one_}}, recording.calls(),
                   [&](const DiskState& state, size_t call) {
                     expectNoneWrong(state);
                     const bool is_new = holds(state, both_);
                     EXPECT_TRUE(is_new || holds(state, one_)) << call;
                     EXPECT_TRUE(is_new || call < recording.calls().size());
                   });
}

TEST_F(PowerLoss, AnAdditionIsThereOrNot) {
  startWithOne();
  RecordingSystemCalls recording;
  {
    const ScopedSystemCalls scope(recording);
    addNow();
  }
  forEachPowerLoss(work_, {{"", {}}, {"a.splats", one_}}, recording.calls(),
                   [&](const DiskState& state, size_t call) {
                     const bool is_new = holds(state, added_);
                     EXPECT_TRUE(is_new || holds(state, one_)) << call;
                     EXPECT_TRUE(is_new || call < recording.calls().size());
                   });
}

TEST_F(PowerLoss, AConversionIsResumedFromWhateverIsLeft) {
  RecordingSystemCalls recording;
  {
    const ScopedSystemCalls scope(recording);
    convertNow({0, 1}, {});
  }
  faults::FaultySystemCalls unsynced;
  unsynced.is_unsynced = true;
  const ScopedSystemCalls scope(unsynced);
  int states = 0;
  forEachPowerLoss(work_, {{"", {}}}, recording.calls(), [&](const DiskState& state, size_t call) {
    if (++states % 4 != 0) return;  // every one is a conversion
    writeFiles(work_, {});
    for (const auto& [name, files] : state) writeFiles(work_ / name, files);
    try {
      convertNow({0, 1}, {false, true});
    } catch (const Error& error) {
      // Nothing of it was left but the cache.
      EXPECT_TRUE(holds(state, both_)) << call << ": " << error.what();
    }
    EXPECT_TRUE(holdsAllOf(filesOf(output_), both_)) << call;
  });
}

TEST_F(PowerLoss, APictureIsTheNewOneOrWhatItWas) {
  const Files old{{"a.png", "an old picture"}};
  writeFiles(work_, old);
  Image image({8, 8});
  std::fill(image.rgba.begin(), image.rgba.end(), 1.f);
  RecordingSystemCalls recording;
  {
    const ScopedSystemCalls scope(recording);
    writeImage(image, work_ / "a.png");
  }
  const std::string written = filesOf(work_).at("a.png");
  forEachPowerLoss(work_, {{"", old}}, recording.calls(), [&](const DiskState& state, size_t call) {
    const std::string& left = state.at("").at("a.png");
    EXPECT_TRUE(left == written || (left == old.at("a.png") && call < recording.calls().size())) << call;
  });
}

}  // namespace
}  // namespace curvisplat
