// Times between two steps: values are blends of the steps' values, and pictures those of such values. Going
// from step to step with one renderer draws what a renderer of each step alone draws, bit for bit.
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <memory>
#include <string>
#include <vector>

#include "preprocess/addition/convert_series.h"
#include "render/frame/frame.h"
#include "stream/cache/cache_reader.h"
#include "tests/reference/function_grid.h"
#include "tests/support/program_test.h"

namespace curvisplat {
namespace {

namespace fs = std::filesystem;

constexpr uint64_t kSteps = 5;

/// A field that is linear in time. The step's time is its number.
std::unique_ptr<GridSource> fieldAt(double time) {
  return std::make_unique<FunctionGridSource>(
      std::vector{gridBlock(40, 30, 20)}, 1, [time](const GridNode& node) {
        const auto i = static_cast<double>(node.i), j = static_cast<double>(node.j),
                   k = static_cast<double>(node.k);
        NodeValues values;
        values.position = {i + 0.1 * std::sin(j), j, k};
        values.scalars = {
            static_cast<float>(std::sin(0.2 * i) + time * std::cos(0.15 * j + 0.1 * k) - 0.3 * time)};
        return values;
      });
}

class Interpolation : public ProgramSuite<Interpolation> {
 protected:
  static void prepare() {
    convertSteps("series.splats", kSteps, [](uint64_t step) { return static_cast<double>(step); });
    convertSteps("between.splats", 1, [](uint64_t) { return 1.25; });
  }

  static void convertSteps(const char* name, uint64_t count, double (*time)(uint64_t)) {
    SeriesInput input;
    input.count = count;
    input.name = [](uint64_t step) { return std::to_string(step); };
    input.open = [time](uint64_t step) { return fieldAt(time(step)); };
    input.scalars = [](const GridDescription&) { return std::vector<uint32_t>{0}; };
    SeriesOptions options;
    options.convert.output = cache(name);
    options.convert.memory_bytes = uint64_t{1} << 30;
    Progress progress;
    convertSeries(input, options, progress, [](const SeriesEvent&) {});
  }
  static fs::path cache(const char* name = "series.splats") { return *folder_ / name; }
  static Image draw(FrameRenderer& renderer, const CacheReader& reader) {
    FrameOptions options;
    options.size = {80, 60};
    options.memory_bytes = uint64_t{512} << 20;
    options.threads = 2;
    FrameStatistics statistics;
    return renderer.render(Camera::named("iso", reader.manifest().lower, reader.manifest().upper, {80, 60},
                                         Projection::kOrthographic),
                           options, statistics);
  }
  static TransferFunction function() { return TransferFunction::preset("viridis", -3, 3, 3); }
};

TEST_F(Interpolation, FindsTimesBetweenSteps) {
  Series series;
  for (const double time : {1.0, 2.0, 4.0}) series.add({time, 0, 0, 0, {}});
  EXPECT_EQ(series.between(0), (StepPosition{0, 0}));
  EXPECT_EQ(series.between(1), (StepPosition{0, 0}));
  EXPECT_EQ(series.between(1.25), (StepPosition{0, 0.25}));
  EXPECT_EQ(series.between(2), (StepPosition{1, 0}));
  EXPECT_EQ(series.between(3), (StepPosition{1, 0.5}));
  EXPECT_EQ(series.between(4), (StepPosition{2, 0}));
  EXPECT_EQ(series.between(9), (StepPosition{2, 0}));
  EXPECT_EQ(series.timeAt({1, 0.5}), 3);
  EXPECT_EQ(series.timeAt({2, 0}), 4);
}

TEST_F(Interpolation, BlendsWhatTheTwoStepsHave) {
  const CacheReader first(cache()), a = first.atStep(1), b = first.atStep(2), between = first.at({1, 0.25});
  EXPECT_EQ(between.time(), 1.25);
  EXPECT_EQ(between.manifest().steps.front().time, 1.25);
  for (uint32_t brick = 0; brick < between.bricks().size(); ++brick) {
    SplatVariable of_a, of_b, found;
    a.readVariable(brick, 0, of_a);
    b.readVariable(brick, 0, of_b);
    between.readVariable(brick, 0, found);
    const BrickVariable& bounds = between.brickVariables(0)[brick];
    for (size_t n = 0; n < found.size(); ++n) {
      EXPECT_NEAR(found.mean[n], 0.75 * of_a.mean[n] + 0.25 * of_b.mean[n], 1e-6);
      EXPECT_NEAR(found.slope1[n], 0.75 * of_a.slope1[n] + 0.25 * of_b.slope1[n], 1e-6);
      EXPECT_NEAR(std::sqrt(found.variance[n]),
                  0.75 * std::sqrt(of_a.variance[n]) + 0.25 * std::sqrt(of_b.variance[n]), 1e-6);
      EXPECT_GE(found.mean[n], bounds.min);
      EXPECT_LE(found.mean[n], bounds.max);
      EXPECT_LE(std::hypot(found.slope0[n], found.slope1[n], found.slope2[n]),
                bounds.largest_slope * 1.000001);
      EXPECT_LE(std::sqrt(found.variance[n]), bounds.largest_deviation * 1.000001);
    }
  }
}

/// Leaves at a time between two steps are those of the field at that time, if it is linear in time.
TEST_F(Interpolation, IsExactForAFieldLinearInTime) {
  const CacheReader between = CacheReader(cache()).at({1, 0.25}), wanted(cache("between.splats"));
  ASSERT_EQ(between.bricks().size(), wanted.bricks().size());
  double largest = 0, span = 0;
  for (uint32_t brick = 0; brick < between.bricks().size(); ++brick) {
    if (!between.bricks()[brick].isLeaf()) continue;
    SplatVariable found, truth;
    between.readVariable(brick, 0, found);
    wanted.readVariable(brick, 0, truth);
    const BrickVariable& of_brick = wanted.brickVariables(0)[brick];
    span = std::max<double>(span, of_brick.max - of_brick.min);
    for (size_t n = 0; n < found.size(); ++n)
      largest = std::max<double>(largest, std::abs(found.mean[n] - truth.mean[n]));
  }
  EXPECT_LT(largest, 3 * span / 65535);  // each of the three is rounded to its codes
}

TEST_F(Interpolation, DrawsTheSameWhateverWasDrawnBefore) {
  const StepPosition positions[] = {{0, 0},    {0, 0.5}, {1, 0},   {2, 0.75},
                                    {2, 0.25}, {3, 0},   {0, 0.5}, {1, 0.5}};
  CacheReader reader(cache());
  StepPlayer player(reader, {0, function()}, Backend::kCpu);
  for (const StepPosition& position : positions) {
    SCOPED_TRACE(position.step + position.part);
    const CacheReader alone = CacheReader(cache()).at(position);
    FrameRenderer renderer(alone, 0, function(), Backend::kCpu);
    player.goTo(position);
    EXPECT_EQ(draw(player.renderer(), reader).rgba, draw(renderer, alone).rgba);
  }
}

class InterpolationCommand : public ProgramTest {
 protected:
  Words render(const std::string& output, const Words& more) const {
    return Words{"render", file("w.splats"), "-o",  file(output),     "--size",
                 "60x50",  "--range",        "0,1", "--opacity-unit", "0.5"} +
           more;
  }
};

TEST_F(InterpolationCommand, DrawsTimesBetweenSteps) {
  run({"generate", "wake", "--size", "40x30x16", "--steps", "3", "-o", file("w")});
  run({"convert", file("w.xyz"), file("w_%04d.fun"), "-o", file("w.splats")});
  const Words view{"--view", "+z"};
  const auto draw = [&](const std::string& output, Words more) {
    more.insert(more.end(), view.begin(), view.end());
    run(render(output, more));
  };
  draw("s0.pfm", {"--step", "0"});
  draw("s1.pfm", {"--step", "1"});
  draw("s2.pfm", {"--step", "2"});
  draw("t1.pfm", {"--time", "1", "--interpolate"});
  draw("half.pfm", {"--time", "0.5", "--interpolate"});
  EXPECT_TRUE(bytesOfFile(file("t1.pfm")) == bytesOfFile(file("s1.pfm")));
  EXPECT_FALSE(bytesOfFile(file("half.pfm")) == bytesOfFile(file("s0.pfm")));
  EXPECT_FALSE(bytesOfFile(file("half.pfm")) == bytesOfFile(file("s1.pfm")));

  const ProgramResult late = runProgram(render("late.pfm", {"--time", "7", "--view", "+z"}));
  EXPECT_TRUE(bytesOfFile(file("late.pfm")) == bytesOfFile(file("s2.pfm")));
  expectSays(late.err, "note: --time 7: the series has times from 0 to 2; step 2 is taken");

  const ProgramResult beyond = runProgram(render("g%d.pfm", {"--steps", "1:9", "--view", "+z"}));
  EXPECT_TRUE(bytesOfFile(file("g1.pfm")) == bytesOfFile(file("s2.pfm")));
  expectSays(beyond.err, "note: --steps 1:9: the last step is 2");

  draw("f%d.pfm", {"--steps", "all", "--interpolate", "--frames", "5"});
  EXPECT_TRUE(bytesOfFile(file("f0.pfm")) == bytesOfFile(file("s0.pfm")));
  EXPECT_TRUE(bytesOfFile(file("f1.pfm")) == bytesOfFile(file("half.pfm")));
  EXPECT_TRUE(bytesOfFile(file("f2.pfm")) == bytesOfFile(file("s1.pfm")));
  EXPECT_TRUE(bytesOfFile(file("f4.pfm")) == bytesOfFile(file("s2.pfm")));
  EXPECT_FALSE(fs::exists(file("f5.pfm")));
}

TEST_F(InterpolationCommand, FollowsTheTimesOfAPath) {
  run({"generate", "wake", "--size", "40x30x16", "--steps", "3", "-o", file("w")});
  run({"convert", file("w.xyz"), file("w_%04d.fun"), "-o", file("w.splats")});
  const auto write = [&](const char* first, const char* second) {
    const std::string camera =
        R"("position": [3,0,20], "focal_point": [3,0,2], "view_up": [0,1,0], "parallel_scale": 5)";
    std::ofstream(file("path.json")) << R"({"key_frames": [{"time": 0, )" << camera << first
                                     << R"(}, {"time": 4, )" << camera << second << "}]}";
  };
  write(R"(, "series_time": 0)", R"(, "series_time": 2)");
  run(render("p%d.pfm", {"--path", file("path.json"), "--frames", "5", "--interpolate"}));
  run(render("n%d.pfm", {"--path", file("path.json"), "--frames", "5"}));
  EXPECT_TRUE(bytesOfFile(file("p2.pfm")) == bytesOfFile(file("n2.pfm")));  // at step 1
  EXPECT_FALSE(bytesOfFile(file("p1.pfm")) == bytesOfFile(file("p0.pfm")));
  EXPECT_FALSE(bytesOfFile(file("p1.pfm")) == bytesOfFile(file("p2.pfm")));
  EXPECT_TRUE(bytesOfFile(file("n1.pfm")) ==
              bytesOfFile(file("n0.pfm")));  // the nearest; of two equally near the earlier

  const ProgramResult both = runProgram(render("q%d.pfm", {"--path", file("path.json"), "--steps", "all"}));
  EXPECT_EQ(both.status, 2);
  expectSays(both.err, "leave out --step, --time and --steps");
  write(R"(, "series_time": 0)", "");
  const ProgramResult half = runProgram(render("q%d.pfm", {"--path", file("path.json")}));
  EXPECT_EQ(half.status, 1);
  expectSays(half.err, "key frame 1 has no series_time");
}

TEST_F(InterpolationCommand, NeedsOneGridAndATime) {
  run({"generate", "wake", "--size", "40x30x16", "--steps", "2", "--moving", "-o", file("w")});
  run({"convert", file("w_%04d.xyz"), file("w_%04d.fun"), "-o", file("w.splats")});
  const ProgramResult moving = runProgram(render("a.pfm", {"--time", "0.5", "--interpolate"}));
  EXPECT_EQ(moving.status, 1);
  expectSays(moving.err, "steps 0 and 1 have different grids");
  EXPECT_EQ(lineCount(moving.err), 1) << moving.err;
  EXPECT_EQ(runProgram(render("a.pfm", {"--interpolate"})).status, 2);
  EXPECT_EQ(runProgram(render("a%d.pfm", {"--steps", "all", "--frames", "3"})).status,
            2);  // nothing to spread
}

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

class StepPlayerTest : public ProgramSuite<StepPlayerTest> {
 protected:
  static constexpr uint64_t kSteps = 6;

  static void prepare() {
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
  /// The picture by a reader and a renderer of that step alone.
  static Image alone(uint64_t step) {
    const CacheReader reader(cache(), step);
    FrameRenderer renderer(reader, 0, function(), Backend::kCpu);
    FrameStatistics statistics;
    return renderer.render(camera(CacheReader(cache())), options(512 << 20), statistics);
  }
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
  FrameOptions stored = options(512 << 20);
  stored.lod_pixels = 0;  // bricks whose layers are merged depend on the values, and are decoded again
  FrameStatistics first, second;
  player.renderer().render(view, stored, first);
  player.goTo({1});
  player.renderer().render(view, stored, second);
  EXPECT_GT(first.bricks_read, 0u);
  EXPECT_EQ(second.bricks_read, 0u);  // whole bricks: values alone are read
  EXPECT_EQ(second.bricks_cached, first.bricks_read);
}

TEST_F(StepPlayerTest, KeepsGeometryOnTheCard) {
  CacheReader reader(cache());
  const Camera view = camera(reader);
  FrameOptions stored = options(512 << 20);
  stored.lod_pixels = 0;
  stored.card_memory_bytes = uint64_t{64} << 20;
  std::unique_ptr<StepPlayer> player;
  try {
    player = std::make_unique<StepPlayer>(reader, DrawnScalars(0, function()), Backend::kEgl);
  } catch (const Error& error) {
    GTEST_SKIP() << error.what();
  }
  if (player->renderer().backendName().find("compute shaders") == std::string::npos) GTEST_SKIP();
  const auto sentAt = [&](uint64_t step) {
    player->goTo({step});
    FrameStatistics statistics;
    const Image image = player->renderer().render(view, stored, statistics);
    EXPECT_GT(statistics.card_splats, 0u);
    FrameStatistics by_processor;
    FrameRenderer alone(reader, 0, function(), Backend::kCpu);
    EXPECT_GE(compareImages(image, alone.render(view, stored, by_processor)).psnr_db, 60) << step;
    return statistics.card_sent_bytes;
  };
  const uint64_t first = sentAt(0), second = sentAt(1);
  EXPECT_GT(second, 0u);
  EXPECT_LT(2 * second, first);  // 5 of 17 numbers a splat, and less of pieces
  EXPECT_EQ(sentAt(0), 0u);
  EXPECT_EQ(sentAt(1), 0u);
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
