// Times between two steps: values are blends of the steps' values, and pictures those of such values.
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <memory>
#include <string>
#include <vector>

#include "preprocess/addition/convert_series.h"
#include "render/frame/step_player.h"
#include "stream/cache/cache_reader.h"
#include "tests/reference/function_grid.h"
#include "tests/support/run_program.h"
#include "tests/support/temporary_folder.h"

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

class Interpolation : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = std::make_unique<TemporaryFolder>();
    convertSteps("series.splats", kSteps, [](uint64_t step) { return static_cast<double>(step); });
    convertSteps("between.splats", 1, [](uint64_t) { return 1.25; });
  }
  static void TearDownTestSuite() { folder_.reset(); }

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

  static inline std::unique_ptr<TemporaryFolder> folder_;
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

/// Of a field that is linear in time, leaves at a time between are those of the field at that time.
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

class InterpolationCommand : public testing::Test {
 protected:
  std::string file(const std::string& name) const { return (folder / name).string(); }
  void run(const std::vector<std::string>& arguments) {
    const ProgramResult result = runProgram(arguments);
    ASSERT_EQ(result.status, 0) << result.err;
  }
  ProgramResult render(const std::string& output, std::vector<std::string> more) {
    more.insert(more.begin(), {"render", file("w.splats"), "-o", file(output), "--size", "60x50", "--range",
                               "0,1", "--opacity-unit", "0.5"});
    return runProgram(more);
  }
  std::string bytesOf(const std::string& name) const {
    std::ifstream in(folder / name, std::ios::binary);
    return {std::istreambuf_iterator<char>(in), {}};
  }

  const TemporaryFolder folder;
};

TEST_F(InterpolationCommand, DrawsTimesBetweenSteps) {
  run({"generate", "wake", "--size", "40x30x16", "--steps", "3", "-o", file("w")});
  run({"convert", file("w.xyz"), file("w_%04d.fun"), "-o", file("w.splats")});
  const std::vector<std::string> view{"--view", "+z"};
  const auto draw = [&](const std::string& output, std::vector<std::string> more) {
    more.insert(more.end(), view.begin(), view.end());
    const ProgramResult result = render(output, more);
    EXPECT_EQ(result.status, 0) << result.err;
  };
  draw("s0.pfm", {"--step", "0"});
  draw("s1.pfm", {"--step", "1"});
  draw("s2.pfm", {"--step", "2"});
  draw("t1.pfm", {"--time", "1", "--interpolate"});
  draw("half.pfm", {"--time", "0.5", "--interpolate"});
  EXPECT_TRUE(bytesOf("t1.pfm") == bytesOf("s1.pfm"));
  EXPECT_FALSE(bytesOf("half.pfm") == bytesOf("s0.pfm"));
  EXPECT_FALSE(bytesOf("half.pfm") == bytesOf("s1.pfm"));

  const ProgramResult late = render("late.pfm", {"--time", "7", "--view", "+z"});
  EXPECT_TRUE(bytesOf("late.pfm") == bytesOf("s2.pfm"));
  EXPECT_NE(late.err.find("note: --time 7: the series has times from 0 to 2; step 2 is taken"),
            std::string::npos)
      << late.err;

  draw("f%d.pfm", {"--steps", "all", "--interpolate", "--frames", "5"});
  EXPECT_TRUE(bytesOf("f0.pfm") == bytesOf("s0.pfm"));
  EXPECT_TRUE(bytesOf("f1.pfm") == bytesOf("half.pfm"));
  EXPECT_TRUE(bytesOf("f2.pfm") == bytesOf("s1.pfm"));
  EXPECT_TRUE(bytesOf("f4.pfm") == bytesOf("s2.pfm"));
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
  ASSERT_EQ(render("p%d.pfm", {"--path", file("path.json"), "--frames", "5", "--interpolate"}).status, 0);
  ASSERT_EQ(render("n%d.pfm", {"--path", file("path.json"), "--frames", "5"}).status, 0);
  EXPECT_TRUE(bytesOf("p2.pfm") == bytesOf("n2.pfm"));  // at step 1
  EXPECT_FALSE(bytesOf("p1.pfm") == bytesOf("p0.pfm"));
  EXPECT_FALSE(bytesOf("p1.pfm") == bytesOf("p2.pfm"));
  EXPECT_TRUE(bytesOf("n1.pfm") == bytesOf("n0.pfm"));  // the nearest; of two equally near the earlier

  const ProgramResult both = render("q%d.pfm", {"--path", file("path.json"), "--steps", "all"});
  EXPECT_EQ(both.status, 2);
  EXPECT_NE(both.err.find("leave out --step, --time and --steps"), std::string::npos) << both.err;
  write(R"(, "series_time": 0)", "");
  const ProgramResult half = render("q%d.pfm", {"--path", file("path.json")});
  EXPECT_EQ(half.status, 1);
  EXPECT_NE(half.err.find("key frame 1 has no series_time"), std::string::npos) << half.err;
}

TEST_F(InterpolationCommand, NeedsOneGridAndATime) {
  run({"generate", "wake", "--size", "40x30x16", "--steps", "2", "--moving", "-o", file("w")});
  run({"convert", file("w_%04d.xyz"), file("w_%04d.fun"), "-o", file("w.splats")});
  const ProgramResult moving = render("a.pfm", {"--time", "0.5", "--interpolate"});
  EXPECT_EQ(moving.status, 1);
  EXPECT_NE(moving.err.find("steps 0 and 1 have different grids"), std::string::npos) << moving.err;
  EXPECT_EQ(lineCount(moving.err), 1) << moving.err;
  EXPECT_EQ(render("a.pfm", {"--interpolate"}).status, 2);
  EXPECT_EQ(render("a%d.pfm", {"--steps", "all", "--frames", "3"}).status, 2);  // nothing to spread
}

}  // namespace
}  // namespace curvisplat
