// Going from step to step with one renderer draws what a renderer of each step alone draws, bit for bit.
#include "render/frame/step_player.h"

#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <memory>
#include <vector>

#include "preprocess/addition/convert_series.h"
#include "stream/cache/cache_reader.h"
#include "tests/reference/function_grid.h"
#include "tests/support/temporary_folder.h"

namespace curvisplat {
namespace {

/// A block whose scalar moves along i; from step 4 on the grid is another.
std::unique_ptr<GridSource> stepOf(uint64_t step) {
  return std::make_unique<FunctionGridSource>(
      std::vector{gridBlock(40, 30, 30)}, 1, [step](const GridNode& node) {
        const auto i = static_cast<double>(node.i), j = static_cast<double>(node.j),
                   k = static_cast<double>(node.k);
        NodeValues values;
        values.position = {i + 0.1 * std::sin(j) + (step >= 4 ? 0.05 * k : 0), j, k};
        const double t = static_cast<double>(step);
        // A different range at each step, as simulations have.
        values.scalars = {
            static_cast<float>((1 + 0.1 * t) * std::sin(0.2 * i - 0.3 * t) * std::cos(0.1 * j))};
        return values;
      });
}

class StepPlayerTest : public testing::Test {
 protected:
  static constexpr uint64_t kSteps = 6;

  static void SetUpTestSuite() {
    folder_ = std::make_unique<TemporaryFolder>();
    SeriesInput input;
    input.count = kSteps;
    input.name = [](uint64_t step) { return std::to_string(step); };
    input.open = stepOf;
    input.scalars = [](const GridDescription&) { return std::vector<uint32_t>{0}; };
    SeriesOptions options;
    options.convert.output = cache();
    options.convert.memory_bytes = uint64_t{1} << 30;
    Progress progress;
    convertSeries(input, options, progress, [](const SeriesEvent&) {});
  }
  static void TearDownTestSuite() { folder_.reset(); }

  static std::filesystem::path cache() { return *folder_ / "a.splats"; }
  static TransferFunction function() { return TransferFunction::preset("viridis", -1, 1, 3); }
  static FrameOptions options(uint64_t memory_bytes) {
    FrameOptions options;
    options.size = {80, 60};
    options.memory_bytes = memory_bytes;
    options.threads = 2;
    return options;
  }
  static Camera camera(const CacheReader& reader) {
    return Camera::named("iso", reader.manifest().lower, reader.manifest().upper, {80, 60},
                         Projection::kOrthographic);
  }
  /// By a reader and a renderer of that step alone.
  static Image alone(uint64_t step) {
    const CacheReader reader(cache(), step);
    FrameRenderer renderer(reader, 0, function(), Backend::kCpu);
    FrameStatistics statistics;
    return renderer.render(camera(CacheReader(cache())), options(512 << 20), statistics);
  }

  static inline std::unique_ptr<TemporaryFolder> folder_;
};

TEST_F(StepPlayerTest, DrawsEachStepAsAlone) {
  std::vector<Image> wanted;
  for (uint64_t step = 0; step < kSteps; ++step) wanted.push_back(alone(step));
  EXPECT_NE(wanted[0].rgba, wanted[1].rgba);
  ASSERT_EQ(CacheReader(cache()).series().geometries(), 2u);
  // Enough memory to keep all bricks, and so little that most are read again.
  for (const uint64_t memory : {uint64_t{512} << 20, uint64_t{64} << 20})
    for (const bool ahead : {false, true}) {
      CacheReader reader(cache());
      const Camera view = camera(reader);
      StepPlayer player(reader, {0, function()}, Backend::kCpu);
      for (const uint64_t step : std::vector<uint64_t>{0, 1, 2, 3, 2, 0, 3, 4, 5, 4, 1, 1, 5}) {
        player.goTo({step});
        if (ahead) player.renderer().prefetch(view, options(memory));
        FrameStatistics statistics;
        EXPECT_EQ(player.renderer().render(view, options(memory), statistics).rgba, wanted[step].rgba)
            << "step " << step << ", memory " << memory << ", ahead " << ahead;
        EXPECT_EQ(reader.step(), step);
      }
    }
}

TEST_F(StepPlayerTest, KeepsDecodedGeometry) {
  CacheReader reader(cache());
  const Camera view = camera(reader);
  StepPlayer player(reader, {0, function()}, Backend::kCpu);
  FrameStatistics first, second;
  player.renderer().render(view, options(512 << 20), first);
  player.goTo({1});
  player.renderer().render(view, options(512 << 20), second);
  EXPECT_GT(first.bricks_read, 0u);
  EXPECT_EQ(second.bricks_read, 0u);  // whole bricks: values alone are read
  EXPECT_EQ(second.bricks_cached, first.bricks_read);
}

TEST_F(StepPlayerTest, DecodesValuesThatOthersArePredictedFromOnce) {
  const CacheReader first(cache());
  const uint32_t bricks = static_cast<uint32_t>(first.bricks().size());
  KeptValues kept(64 << 20);
  // Backwards: steps 0 and 1 are decoded for step 2.
  for (const uint64_t step : std::vector<uint64_t>{2, 1, 0}) {
    const CacheReader reader = first.atStep(step);
    for (uint32_t brick = 0; brick < bricks; ++brick) {
      SplatVariable with, without;
      reader.readVariable(brick, 0, with, nullptr, &kept);
      reader.readVariable(brick, 0, without);
      EXPECT_EQ(with.mean, without.mean);
      EXPECT_EQ(with.slope2, without.slope2);
      EXPECT_EQ(with.variance, without.variance);
    }
  }
  EXPECT_GE(kept.statistics().hits, 2u * bricks);
}

}  // namespace
}  // namespace curvisplat
