// The window on a series of time steps: slider, play and step keys.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "tests/end_to_end/window_fixture.h"
#include "tools/view/playback.h"

namespace curvisplat {
namespace {

namespace fs = std::filesystem;

TEST(Playback, StepsAndLoops) {
  Playback playback(3);
  EXPECT_FALSE(playback.isPlaying());
  EXPECT_FALSE(playback.next());
  EXPECT_TRUE(playback.advance(true));
  EXPECT_TRUE(playback.advance(true));
  EXPECT_EQ(playback.step(), 2u);
  EXPECT_TRUE(playback.advance(true));
  EXPECT_EQ(playback.step(), 0u);
  EXPECT_TRUE(playback.advance(false));
  EXPECT_EQ(playback.step(), 2u);
  playback.setLoop(false);
  EXPECT_FALSE(playback.advance(true));
  EXPECT_TRUE(playback.goTo(1));
  EXPECT_FALSE(playback.goTo(1));
  EXPECT_TRUE(playback.goTo(7));
  EXPECT_EQ(playback.step(), 2u);
}

TEST(Playback, GoesOnWhenTheStepHasBeenShown) {
  Playback playback(3);
  playback.setLoop(false);
  playback.setStepsPerSecond(10);
  EXPECT_FALSE(playback.tick(0));
  playback.toggle();
  EXPECT_EQ(playback.next(), StepPosition{1});
  EXPECT_FALSE(playback.tick(5));  // shown since now
  EXPECT_NEAR(playback.wait(5.06), 0.04, 1e-9);
  EXPECT_FALSE(playback.tick(5.06));
  EXPECT_TRUE(playback.tick(5.11));
  EXPECT_EQ(playback.step(), 1u);
  EXPECT_FALSE(playback.tick(6));  // however long its picture took
  EXPECT_TRUE(playback.tick(6.2));
  EXPECT_FALSE(playback.next());
  EXPECT_FALSE(playback.tick(7));
  EXPECT_TRUE(playback.tick(7.2));  // the end: drawn again, at rest
  EXPECT_FALSE(playback.isPlaying());
  EXPECT_EQ(playback.step(), 2u);
  playback.toggle();
  EXPECT_EQ(playback.step(), 0u);
  Playback steady(1);
  steady.toggle();
  EXPECT_FALSE(steady.isPlaying());
}

/// Steps 0 and 1 have one grid, and steps 2 and 3 have another.
TEST(Playback, StopsBetweenStepsOfOneGeometry) {
  Playback playback(4, {true, false, true});
  playback.setStepsPerSecond(10);
  EXPECT_FALSE(playback.goTo(StepPosition{0, 0.3})) << "does not interpolate yet";
  EXPECT_FALSE(playback.setInterpolates(true));
  EXPECT_TRUE(playback.goTo(StepPosition{0, 0.3}));
  EXPECT_EQ(playback.position(), (StepPosition{0, 0.3}));
  EXPECT_TRUE(playback.goTo(StepPosition{1, 0.3}));
  EXPECT_EQ(playback.position(), (StepPosition{1, 0}));
  EXPECT_TRUE(playback.goTo(StepPosition{3, 0.3}));
  EXPECT_EQ(playback.position(), (StepPosition{3, 0}));

  // Keys go to steps.
  playback.goTo(StepPosition{2, 0.6});
  playback.advance(false);
  EXPECT_EQ(playback.position(), (StepPosition{2, 0}));
  playback.goTo(StepPosition{0, 0.6});
  playback.advance(true);
  EXPECT_EQ(playback.position(), (StepPosition{1, 0}));

  // Plays at the same speed, with pictures between; from a place between two stops, the next stop follows.
  playback.goTo(StepPosition{0, 0.3});
  playback.toggle();
  double now_s = 0;
  std::vector<StepPosition> seen;
  std::vector<double> times_s;
  for (int n = 0; n < 9; ++n) {
    while (!playback.tick(now_s)) now_s += 0.001;
    seen.push_back(playback.position());
    times_s.push_back(now_s);
  }
  EXPECT_EQ(seen, (std::vector<StepPosition>{
                      {0, 0.5}, {0, 0.75}, {1}, {2}, {2, 0.25}, {2, 0.5}, {2, 0.75}, {3}, {0}}));
  EXPECT_NEAR(times_s[7] - times_s[3], 0.1, 0.01);
  EXPECT_NEAR(times_s[3] - times_s[2], 0.1, 0.01);

  playback.goTo(StepPosition{0, 0.5});
  EXPECT_TRUE(playback.setInterpolates(false));
  EXPECT_EQ(playback.position(), StepPosition{});
}

TEST(Playback, PlaysBackwards) {
  Playback playback(4, {true, false, true});
  playback.setStepsPerSecond(10);
  playback.setInterpolates(true);
  playback.setBackwards(true);
  playback.goTo(StepPosition{2, 0.6});
  playback.toggle();
  EXPECT_EQ(playback.next(), (StepPosition{2, 0.5}));  // which is read ahead
  double now_s = 0;
  std::vector<StepPosition> seen;
  std::vector<double> times_s;
  for (int n = 0; n < 9; ++n) {
    while (!playback.tick(now_s)) now_s += 0.001;
    seen.push_back(playback.position());
    times_s.push_back(now_s);
  }
  EXPECT_EQ(seen, (std::vector<StepPosition>{
                      {2, 0.5}, {2, 0.25}, {2}, {1}, {0, 0.75}, {0, 0.5}, {0, 0.25}, {0}, {3}}));
  EXPECT_NEAR(times_s[3] - times_s[2], 0.1, 0.01);  // between steps 2 and 1 there is nothing
  EXPECT_NEAR(times_s[7] - times_s[3], 0.1, 0.01);

  // Without a loop it ends at the first step, and begins again at the last.
  playback.setLoop(false);
  playback.goTo(0);
  EXPECT_FALSE(playback.next());
  playback.toggle();
  playback.toggle();
  EXPECT_TRUE(playback.isPlaying());
  EXPECT_EQ(playback.position(), StepPosition{3});
}

class WindowPlayback : public WindowTest {
 protected:
  void SetUp() override {
    WindowTest::SetUp();
    if (IsSkipped()) return;
    run({"generate", "wake", "--size", "32x24x12", "--steps", "4", "-o", "w"});
    run({"convert", "w.xyz", "w_%04d.fun", "-o", "a.splats", "--overwrite"});
  }
};

TEST_F(WindowPlayback, KeysChooseTheStepAndPlay) {
  open();
  const Image first = saveAndCopy();
  press("period");
  const Image second = saveAndCopy();
  press("comma");
  press("comma");  // round to the last
  const Image last = saveAndCopy();
  EXPECT_LT(difference(first, second), 60);
  EXPECT_LT(difference(second, last), 60);

  // Plays: pictures of other steps come by themselves. Stopped, the picture is of one step, and final.
  const Image before = shown(last.size);
  press("space");
  EXPECT_TRUE(eventually([&] { return difference(shown(last.size), before) < 60; }));
  press("space");
  const Image stopped = saveAndCopy();

  const auto commands = close();
  ASSERT_EQ(commands.size(), 4u);
  EXPECT_EQ(valueOf(commands[0], "--step"), "0");
  EXPECT_EQ(valueOf(commands[1], "--step"), "1");
  EXPECT_EQ(valueOf(commands[2], "--step"), "3");
  expectDraws(commands[0], first);
  expectDraws(commands[1], second);
  expectDraws(commands[2], last);
  expectDraws(commands[3], stopped);
}

TEST_F(WindowPlayback, ButtonsUnderThePictureGoToSteps) {
  open();
  placeOf("step 1 of 4");
  EXPECT_GT(placeOf("Last step").second, placeOf("picture", 0.5, 1).second);
  const Image first = saveAndCopy();
  click("Last step");
  placeOf("step 4 of 4");
  const Image last = saveAndCopy();
  click("Previous step");
  placeOf("step 3 of 4");
  press("Home");
  placeOf("step 1 of 4");
  const Image again = saveAndCopy();
  // A step that is chosen while it plays is looked at: playing ends.
  click("Play");
  EXPECT_TRUE(eventually([] { return hasWidget("hint Stop"); }));
  click("Last step");
  placeOf("step 4 of 4");
  moveTo(placeOf("Play"));
  EXPECT_TRUE(eventually([] { return hasWidget("hint Play"); }));
  const auto commands = close();
  ASSERT_EQ(commands.size(), 3u);
  EXPECT_EQ(valueOf(commands[1], "--step"), "3");
  EXPECT_EQ(valueOf(commands[2], "--step"), "0");
  expectDraws(commands[1], last);
  EXPECT_GE(difference(first, again), 50);
}

TEST_F(WindowPlayback, PlaysBackwards) {
  open();
  const Image first = saveAndCopy();
  press("comma");  // round to the last
  const Image last = saveAndCopy();
  EXPECT_LT(difference(first, last), 60);
  tab("Time");
  click("loop");
  click("backwards");
  moveTo(rest_);
  press("space");
  EXPECT_TRUE(eventually([&] { return difference(shown(first.size), first) >= 60; }));
  saveAndCopy();
  const auto commands = close();
  ASSERT_EQ(commands.size(), 3u);
  EXPECT_EQ(valueOf(commands[1], "--step"), "3");
  EXPECT_EQ(valueOf(commands[2], "--step"), "0");
}

TEST_F(WindowPlayback, RangesAreOfTheSeriesOrOfTheStep) {
  // The last node of the last step.
  const auto raise = [](const char* name) {
    std::fstream last(name, std::ios::binary | std::ios::in | std::ios::out);
    const float value = 5;
    last.seekp(-4, std::ios::end).write(reinterpret_cast<const char*>(&value), sizeof value);
  };
  raise("w_0003.fun");
  run({"convert", "w.xyz", "w_%04d.fun", "-o", "a.splats", "--overwrite"});
  open();
  saveAndCopy();
  for (const char* button : {"full range", "range of this step"}) {
    click(button);
    moveTo(rest_);
    saveAndCopy();
  }
  press("comma");  // round to the last
  click("range of this step");
  moveTo(rest_);
  saveAndCopy();
  tab("Time");
  placeOf("range of step 4: 0 to 5");
  const auto commands = close();
  ASSERT_EQ(commands.size(), 4u);
  EXPECT_EQ(valueOf(commands[1], "--range"), "0,5");
  EXPECT_LT(std::stod(valueOf(commands[2], "--range").substr(2)), 1);
  EXPECT_EQ(valueOf(commands[3], "--range"), "0,5");
}

TEST_F(WindowPlayback, OpensAtAStep) {
  open({"--step", "2"});
  const Image picture = saveAndCopy();
  const auto commands = close();
  ASSERT_EQ(commands.size(), 1u);
  EXPECT_EQ(valueOf(commands[0], "--step"), "2");
  expectDraws(commands[0], picture);
}

TEST_F(WindowPlayback, InterpolatesBetweenSteps) {
  open();
  tab("Time");
  click("interpolate between steps");
  click(placeOf("step", 0.5, 0.5));
  moveTo(rest_);
  const Image between = saveAndCopy();
  click("interpolate between steps");  // back to the step before
  moveTo(rest_);
  const Image step = saveAndCopy();
  const auto commands = close();
  ASSERT_EQ(commands.size(), 2u);
  EXPECT_EQ(valueOf(commands[1], "--step"), "1");
  EXPECT_NE(std::find(commands[0].begin(), commands[0].end(), "--interpolate"), commands[0].end());
  const double time = std::stod(valueOf(commands[0], "--time"));
  EXPECT_GT(time, 1.2);
  EXPECT_LT(time, 1.8);
  EXPECT_LT(difference(between, step), 60);
  expectDraws(commands[0], between);
  expectDraws(commands[1], step);
}

TEST_F(WindowPlayback, AScalarWithOwnBlanksIsShownAtTheSameStep) {
  fs::copy(fs::path(CURVISPLAT_TEST_DATA) / "caches/version_2/set_steps.splats", "sets.splats",
           fs::copy_options::recursive);
  cache_ = "sets";
  open({"--step", "1"});
  chooseScalar("s1");
  placeOf("scalar shown: s1");
  moveTo(rest_);
  const Image last = saveAndCopy();
  press("comma");
  const Image first = saveAndCopy();
  const auto commands = close();
  ASSERT_EQ(commands.size(), 2u);
  for (const auto& command : commands) EXPECT_EQ(valueOf(command, "--scalar"), "s1");
  EXPECT_EQ(valueOf(commands[0], "--step"), "1");
  EXPECT_EQ(valueOf(commands[1], "--step"), "0");
  EXPECT_LT(difference(first, last), 60);
  expectDraws(commands[0], last);
  expectDraws(commands[1], first);
}

/// A grid that moves: a shown face of it moves too, and the outline.
TEST_F(WindowPlayback, FacesMoveWithTheGrid) {
  constexpr int kNodes[3] = {16, 12, 8};
  for (int step = 0; step < 3; ++step) {
    std::ofstream file(fmt::format("m_{}.vts", step));
    const std::string extent = fmt::format("0 {} 0 {} 0 {}", kNodes[0] - 1, kNodes[1] - 1, kNodes[2] - 1);
    std::string points, values;
    for (int k = 0; k < kNodes[2]; ++k)
      for (int j = 0; j < kNodes[1]; ++j)
        for (int i = 0; i < kNodes[0]; ++i) {
          points += fmt::format("{} {} {} ", i, j, k + 1.5 * step * std::sin(0.4 * i));
          values += fmt::format("{} ", std::sin(0.3 * i) + 0.2 * j);
        }
    file << "<VTKFile type=\"StructuredGrid\" version=\"1.0\"><StructuredGrid WholeExtent=\"" << extent
         << "\"><Piece Extent=\"" << extent
         << "\"><PointData><DataArray type=\"Float32\" Name=\"f\" format=\"ascii\">" << values
         << "</DataArray></PointData><Points><DataArray type=\"Float32\" NumberOfComponents=\"3\" "
            "format=\"ascii\">"
         << points << "</DataArray></Points></Piece></StructuredGrid></VTKFile>\n";
  }
  run({"convert", "m_%d.vts", "-o", "a.splats", "--overwrite"});
  open({"--surface", "kmax", "--surface-colour", "#306090", "--volume", "off"}, {900, 600});
  const Image first = saveAndCopy();
  press("period");
  const Image second = saveAndCopy();
  press("comma");
  const Image again = saveAndCopy();
  const auto commands = close();
  ASSERT_EQ(commands.size(), 3u);
  EXPECT_LT(difference(first, second), 30);
  EXPECT_GT(difference(first, again), 60);
  expectDraws(commands[0], first);
  expectDraws(commands[1], second);  // with the outline of that step's data
}

}  // namespace
}  // namespace curvisplat
