// The window, as a person uses it: moved with the mouse and the keys, its panels edited, left and opened
// again.
#include <cmath>
#include <csignal>
#include <fstream>
#include <glm/geometric.hpp>
#include <glm/trigonometric.hpp>
#include <glm/vec3.hpp>
#include <iterator>

#include "tests/end_to_end/window_fixture.h"

namespace curvisplat {
namespace {

namespace fs = std::filesystem;

glm::dvec3 pointIn(const std::string& text) {
  glm::dvec3 point;
  char comma;
  std::istringstream(text) >> point.x >> comma >> point.y >> comma >> point.z;
  return point;
}

/// The camera of a `render` command.
struct SeenFrom {
  glm::dvec3 position, focal_point;
  double parallel_scale = 0, view_angle = 0;  // 0: the other projection

  glm::dvec3 forward() const { return glm::normalize(focal_point - position); }
};

constexpr double kRounded = 1e-4;  // of the data's size: commands have six digits

class WindowsCamera : public WindowTest {
 protected:
  static SeenFrom cameraOf(const Words& command) {
    const auto number = [&](const std::string& option) {
      const std::string value = valueOf(command, option);
      return value.empty() ? 0 : std::stod(value);
    };
    return {pointIn(valueOf(command, "--position")), pointIn(valueOf(command, "--focal-point")),
            number("--parallel-scale"), number("--view-angle")};
  }
  /// One camera for each saveAndCopy().
  std::vector<SeenFrom> closeAndSee() {
    std::vector<SeenFrom> cameras;
    for (const auto& command : close()) cameras.push_back(cameraOf(command));
    return cameras;
  }
};

TEST_F(WindowTest, ShowsEachChange) {
  open();
  const Image first = save();
  EXPECT_EQ(first.size.width, pictureSize().width);
  EXPECT_EQ(first.size.height, pictureSize().height);
  // What is on the screen is what was saved: 8 bits, with the scalar bar and the axes.
  EXPECT_TRUE(eventually([&] { return difference(shown(first.size), first) > 45; }))
      << difference(shown(first.size), first);

  dragPicture(1, 0.2, 0.1);
  const Image rotated = save();
  EXPECT_LT(difference(first, rotated), 30);
  press("o");
  const Image orthographic = save();
  EXPECT_LT(difference(rotated, orthographic), 45);
  addPoint();
  // The edit is on the screen, without anything else that would make it draw.
  EXPECT_TRUE(eventually([&] { return difference(shown(first.size), orthographic) < 40; }));
  const Image edited = saveAndCopy();
  EXPECT_LT(difference(orthographic, edited), 40);

  const auto commands = close();
  ASSERT_EQ(commands.size(), 1u);
  EXPECT_NE(valueOf(commands[0], "--parallel-scale"), "");
  expectDraws(commands[0], edited);
}

/// Compute shaders draw in a context of the window's: nothing is read back, neither while the picture moves nor at rest, before
/// it is saved.
TEST_F(WindowTest, ShowsPicturesOfTheCardWithoutReadingThem) {
  const std::string system = run({"info", "--system", "--json"}).out;
  const size_t at = system.find("\"egl\"");
  const std::string egl = system.substr(at, system.find('}', at) - at);
  if (egl.find("compute shaders") == std::string::npos || egl.find("llvmpipe") == std::string::npos)
    GTEST_SKIP() << "EGL has no compute shaders here, or others than the virtual display";
  open({"--backend", "egl"});
  const auto is_final = [] { return hasWidget("state final"); };
  ASSERT_TRUE(eventually(is_final, 400));
  EXPECT_TRUE(hasWidget("read back 0"));
  const Image first = shown(pictureSize());
  for (const double across : {0.2, -0.1, 0.15}) dragPicture(1, across, 0.1);
  ASSERT_TRUE(eventually([&] { return difference(shown(first.size), first) < 30 && is_final(); }));
  EXPECT_TRUE(hasWidget("read back 0"));
  // What is on the screen before a picture was ever read is what is saved.
  const Image moved = shown(first.size), rotated = save();
  EXPECT_GT(difference(moved, rotated), 45);
  EXPECT_FALSE(hasWidget("read back 0"));
  close();
}

TEST_F(WindowsCamera, DragsAndTheWheelMoveIt) {
  open();
  press("o");
  const Image first = saveAndCopy();
  dragPicture(1, 0.1, 0);
  const Image rotated = saveAndCopy();
  const Place panned_by = dragPicture(2, 0.13, -0.07);
  const Image panned = saveAndCopy();
  const Place zoomed_by = dragPicture(3, 0, -0.09);
  const Image zoomed = saveAndCopy();
  act({"click", "--repeat", "4", "5"});  // the wheel, towards the user
  const Image further = saveAndCopy();
  act({"keydown", "shift"});
  const Place middle = placeOf("picture");
  drag(1, middle, {middle.first - panned_by.first, middle.second - panned_by.second});
  act({"keyup", "shift"});
  const Image panned_back = saveAndCopy();
  press("r");
  const Image whole = saveAndCopy();

  const std::vector<SeenFrom> seen = closeAndSee();
  ASSERT_EQ(seen.size(), 7u);
  EXPECT_LE(glm::length(seen[1].focal_point - seen[0].focal_point), kRounded);
  EXPECT_NEAR(glm::length(seen[1].position - seen[1].focal_point),
              glm::length(seen[0].position - seen[0].focal_point), kRounded);
  EXPECT_LT(glm::dot(seen[1].forward(), seen[0].forward()), 0.99);
  EXPECT_LT(difference(first, rotated), 30);

  const glm::dvec3 shift = seen[2].focal_point - seen[1].focal_point;
  // The data follows the mouse: a pixel is 2 parallel scales over the height.
  const double pixel = 2 * seen[1].parallel_scale / first.size.height;
  EXPECT_NEAR(glm::length(shift), pixel * std::hypot(panned_by.first, panned_by.second), kRounded);
  EXPECT_NEAR(glm::dot(shift, seen[1].forward()), 0, kRounded);
  EXPECT_LE(glm::length(seen[2].position - seen[1].position - shift), kRounded);
  EXPECT_LT(difference(rotated, panned), 30);

  EXPECT_NEAR(seen[3].parallel_scale, seen[2].parallel_scale / std::pow(1.01, -zoomed_by.second), kRounded);
  EXPECT_LE(glm::length(seen[3].focal_point - seen[2].focal_point), kRounded);
  EXPECT_LT(difference(panned, zoomed), 30);
  EXPECT_NEAR(seen[4].parallel_scale, seen[3].parallel_scale * std::pow(1.1, 4), kRounded);
  EXPECT_LT(difference(zoomed, further), 30);

  const double larger = seen[4].parallel_scale / seen[1].parallel_scale;
  EXPECT_LE(glm::length(seen[5].focal_point - seen[4].focal_point + larger * shift), kRounded);
  EXPECT_LT(difference(further, panned_back), 30);
  EXPECT_LE(glm::length(seen[6].forward() - seen[5].forward()), kRounded);
  // The window opened closer to what can be seen; now all of the data is shown, from its middle.
  EXPECT_NEAR(seen[6].focal_point.x, -0.5, 0.01);
  EXPECT_GT(seen[6].parallel_scale, seen[0].parallel_scale);
  EXPECT_LT(difference(panned_back, whole), 30);
}

TEST_F(WindowsCamera, KeysLookAlongTheAxes) {
  open();
  save();  // it hears
  const std::vector<std::pair<std::string, glm::dvec3>> keys{{"x", {-1, 0, 0}},
                                                             {"y", {0, -1, 0}},
                                                             {"z", {0, 0, -1}},
                                                             {"shift+x", {1, 0, 0}},
                                                             {"shift+y", {0, 1, 0}},
                                                             {"shift+z", {0, 0, 1}},
                                                             {"i", -glm::dvec3(std::sqrt(1.0 / 3))}};
  for (const auto& [key, forward] : keys) {
    press(key);
    saveAndCopy();
  }
  press("o");
  saveAndCopy();
  press("o");
  saveAndCopy();
  const std::vector<SeenFrom> seen = closeAndSee();
  ASSERT_EQ(seen.size(), keys.size() + 2);
  for (size_t n = 0; n < keys.size(); ++n)
    EXPECT_LE(glm::length(seen[n].forward() - keys[n].second), kRounded) << keys[n].first;
  const size_t last = keys.size() - 1;
  EXPECT_EQ(seen[last + 1].view_angle, 0);
  EXPECT_EQ(seen[last + 2].view_angle, seen[last].view_angle);
  EXPECT_GT(seen[last + 2].view_angle, 0);
  EXPECT_NEAR(glm::length(seen[last + 2].position - seen[last].position), 0, kRounded);
}

/// The key does so in a window that opened as the one before it was left, too.
TEST_F(WindowsCamera, TheFirstViewComesBack) {
  open();
  const Image first = save();
  press("y");
  dragPicture(1, 0.2, 0.1);
  EXPECT_LT(difference(first, save()), 30);
  press("shift+r");
  EXPECT_EQ(save().rgba, first.rgba);
  press("x");
  EXPECT_LT(difference(first, save()), 30);
  close();
  open();
  EXPECT_LT(difference(first, save()), 30);
  press("shift+r");
  EXPECT_EQ(save().rgba, first.rgba);
  close();
}

/// A drag turns the data again, as it did before the flight. It goes across, since a slanting drag depends on its steps.
TEST_F(WindowsCamera, TheFirstViewEndsFlight) {
  for (const Words& options : {Words{}, Words{"--view", "+x"}}) {  // in perspective, and orthographic
    if (!options.empty() && !faults::isWholeSweep()) continue;
    open(options);
    saveAndCopy();
    dragPicture(1, 0.2, 0);
    saveAndCopy();
    press("f");
    press("shift+r");
    saveAndCopy();
    dragPicture(1, 0.2, 0);
    saveAndCopy();
    const std::vector<SeenFrom> seen = closeAndSee();
    ASSERT_EQ(seen.size(), 4u);
    EXPECT_GT(glm::length(seen[1].position - seen[0].position), 0.5);
    for (const size_t n : {0u, 1u}) {
      EXPECT_LE(glm::length(seen[n + 2].position - seen[n].position), kRounded) << n;
      EXPECT_LE(glm::length(seen[n + 2].focal_point - seen[n].focal_point), kRounded) << n;
      EXPECT_EQ(seen[n + 2].view_angle, seen[n].view_angle);
    }
  }
}

TEST_F(WindowsCamera, ArrowsTurnTheCameraAsTheOptionsDo) {
  open();
  press("z");
  saveAndCopy();
  press("i");
  saveAndCopy();
  for (const char* key : {"Right", "Up", "shift+Up"}) {
    press(key);
    saveAndCopy();
  }
  const std::vector<SeenFrom> seen = closeAndSee();
  ASSERT_EQ(seen.size(), 5u);
  const double degrees = glm::radians(15.0);
  // From (1, 1, 1), about z; then towards z.
  const double around = std::atan(1.0) + degrees, up = std::asin(1 / std::sqrt(3.0));
  const auto forwardFrom = [](double azimuth, double elevation) {
    return -glm::dvec3(std::cos(azimuth) * std::cos(elevation), std::sin(azimuth) * std::cos(elevation),
                       std::sin(elevation));
  };
  EXPECT_LE(glm::length(seen[2].forward() - forwardFrom(around, up)), kRounded);
  EXPECT_LE(glm::length(seen[3].forward() - forwardFrom(around, up + degrees)), kRounded);
  const auto distance = [](const SeenFrom& from) { return glm::length(from.position - from.focal_point); };
  EXPECT_NEAR(distance(seen[3]) / distance(seen[4]), 1.2, 0.01);  // perspective
}

TEST_F(WindowsCamera, FliesThroughTheData) {
  open();
  press("f");
  Image before = saveAndCopy();
  for (const char* key : {"w", "s", "d", "a", "e", "q"}) {
    act({"keydown", key});
    EXPECT_TRUE(eventually([&] { return difference(shown(before.size), before) < 40; })) << key;
    act({"keyup", key});
    before = saveAndCopy();
  }
  dragPicture(1, 0.1, 0.03);  // looks around
  saveAndCopy();
  act({"click", "4"});
  saveAndCopy();
  const std::vector<SeenFrom> seen = closeAndSee();
  ASSERT_EQ(seen.size(), 9u);
  EXPECT_GT(seen[0].view_angle, 0);
  const glm::dvec3 forward = seen[0].forward();
  // Along forward, right and up; the focal point comes along.
  const glm::dvec3 right = glm::normalize(glm::cross(forward, glm::dvec3(0, 0, 1)));
  const std::vector<glm::dvec3> directions{
      forward, -forward, right, -right, glm::cross(right, forward), -glm::cross(right, forward)};
  for (size_t n = 0; n < directions.size(); ++n) {
    const glm::dvec3 way = seen[n + 1].position - seen[n].position;
    EXPECT_GT(glm::dot(way, directions[n]), 0.001) << n;
    EXPECT_LE(glm::length(way - glm::dot(way, directions[n]) * directions[n]), kRounded) << n;
    EXPECT_LE(glm::length(seen[n + 1].focal_point - seen[n].focal_point - way), kRounded) << n;
  }
  EXPECT_LE(glm::length(seen[7].position - seen[6].position), kRounded);
  EXPECT_LT(glm::dot(seen[7].forward(), seen[6].forward()), 0.9999);
  EXPECT_GT(glm::dot(seen[8].position - seen[7].position, seen[7].forward()), 0.001);
}

TEST_F(WindowTest, RangesThatCannotBeAreSaidAndTheOldOneStays) {
  open();
  const Image before = save();
  const auto type = [&](const char* number) {
    click(placeOf("range", 0.15));
    press("ctrl+a");
    act({"type", "--", number});
    press("Return");
  };
  type("5");  // above the upper end
  EXPECT_TRUE(eventually([] { return hasWidget("message range 5 to "); }));
  type("-1");
  save();
  click("log scale");
  EXPECT_TRUE(eventually([] { return hasWidget("message log scale: the range begins at -1"); }));
  press("ctrl+z");
  EXPECT_GE(difference(save(), before), 50);
  close();
}

/// Numbers hold when their field is left by a click, and both ends of a range when both have been left.
TEST_F(WindowTest, TypedNumbersHoldWithoutReturn) {
  open();
  const Image whole = save();
  click(placeOf("range", 0.15));
  press("ctrl+a");
  act({"type", "2"});  // above the upper end
  press("Tab");
  press("ctrl+a");
  act({"type", "3"});
  click(placeOf("range", -0.3));  // beside the fields
  const Image above = saveAndCopy();
  EXPECT_LT(difference(whole, above), 45);
  const auto commands = close();
  ASSERT_EQ(commands.size(), 1u);
  EXPECT_EQ(valueOf(commands[0], "--range"), "2,3");
}

TEST_F(WindowTest, ACommandDrawsScaleRangeAndClipBox) {
  open();
  save();
  chooseScalar("volume");  // volumes: above zero, as a logarithm needs
  const Image linear = save();
  click("log scale");
  placeOf("scale logarithmic");
  const Image logarithmic = save();
  EXPECT_LT(difference(linear, logarithmic), 40);
  click(placeOf("range", 0.15));
  act({"type", "2e-5"});
  press("Return");
  const Image ranged = save();
  EXPECT_LT(difference(logarithmic, ranged), 45);
  tab("Objects");
  click("Clip box");
  save();
  click("clip");
  save();
  drag(1, placeOf("clip x", 0.15), placeOf("clip x", 0.8));
  save();
  tab("View");
  click("dark");
  const Image clipped = saveAndCopy();
  EXPECT_LT(difference(ranged, clipped), 20);
  const auto commands = close();
  ASSERT_EQ(commands.size(), 1u);
  EXPECT_EQ(valueOf(commands[0], "--scalar"), "volume");
  EXPECT_NE(valueOf(commands[0], "--clip-box"), "");
  EXPECT_EQ(valueOf(commands[0], "--background"), "white");
  const std::string text = bytesOfFile(valueOf(commands[0], "--tf"));
  expectSays(text, "\"UseLogScale\": 1");
  expectSays(text, "2e-05");
  expectDraws(commands[0], clipped);
}

TEST_F(WindowTest, SavesAndLoadsAFunction) {
  open();
  const Image chosen = save();
  click("ramp");
  const Image preset = save();
  EXPECT_LT(difference(chosen, preset), 35);
  click("clear");
  const Image nothing = save();
  EXPECT_LT(difference(nothing, preset), 35);
  click("band");
  const Image band = save();
  EXPECT_LT(difference(band, nothing), 35);
  click("high");
  moveTo(placeOf("curve", 0.7, 1));
  EXPECT_TRUE(eventually([] { return hasWidget("point: "); }));
  const Image high = save();
  EXPECT_LT(difference(high, nothing), 35);
  EXPECT_LT(difference(high, band), 35);
  click("automatic");
  EXPECT_TRUE(eventually([&] { return difference(save(), chosen) >= 50; }));
  click("ramp");
  save();
  addPoint();
  const Image edited = save();
  EXPECT_LT(difference(preset, edited), 35);
  click("save");
  placeOf("file name");
  press("Return");  // function.json is offered
  EXPECT_TRUE(eventually([&] { return fs::exists("function.json"); }));
  click("ramp");
  EXPECT_GE(difference(save(), preset), 50);
  click("load");
  click("file function.json");
  click("file accept");
  const Image loaded = saveAndCopy();
  EXPECT_GE(difference(loaded, edited), 50);
  // The command has a file of its own, beside the picture.
  const auto command = close().at(0);
  EXPECT_EQ(valueOf(command, "--tf"), "a_colours.json");
  expectDraws(command, edited);
  fs::remove("function.json");
}

/// Longer than Control: its repetitions are no letters of the name.
TEST_F(WindowTest, AHeldKeyOfACommandWritesNothing) {
  open();
  save();
  for (const char* const key : {"ctrl", "shift", "s"}) act({"keydown", key});
  for (const char* const key : {"shift", "ctrl"}) act({"keyup", key});
  placeOf("file name");
  act({"sleep", "1.5"});  // the display repeats a key after 0.66 s
  act({"keyup", "s"});
  act({"type", "held.png"});
  press("Return");
  EXPECT_TRUE(eventually([] { return !hasWidget("file name"); }));
  EXPECT_TRUE(eventually([] { return fs::exists("held.png"); }));
  close();
}

TEST_F(WindowTest, ComesBackAsItWasLeft) {
  if (!faults::isWholeSweep())
    GTEST_SKIP() << "OpensAStateFile and ClosesInOrderWhenASignalAsksItTo come back, too";
  open();
  dragPicture(1, 0.15, -0.05);
  press("o");
  const Image before = save();
  close();
  open();
  EXPECT_GE(difference(save(), before), 50);
  close();
}

TEST_F(WindowTest, OpensAStateFile) {
  open();
  const Image first = save();
  dragPicture(1, 0.15, -0.05);
  tab("View");
  click("dark");
  const Image before = save();
  close();
  const auto remembered = fs::directory_iterator("config/curvisplat/views")->path();
  fs::copy_file(remembered, "mine.json", fs::copy_options::overwrite_existing);
  fs::remove_all("config");
  open();
  EXPECT_GE(difference(save(), first), 50);
  close();
  open({"--state", "mine.json"});
  EXPECT_GE(difference(save(), before), 50);
  close();
}

TEST_F(WindowTest, ClosesInOrderWhenASignalAsksItTo) {
  open();
  for (const int signal : {SIGTERM, SIGINT, SIGHUP}) {
    if (signal == SIGINT && !faults::isWholeSweep()) continue;
    dragPicture(1, 0.07, 0.02);
    const Image before = save();
    window_->signal(signal);
    const ProgramResult result = window_->wait();
    EXPECT_EQ(result.status, 128 + signal) << result.err;
    expectSays(result.err, "interrupted");
    open();
    EXPECT_GE(difference(save(), before), 50) << signal;
  }
  close();
}

TEST_F(WindowTest, ShowsAnotherScalarFromItsList) {
  if (!faults::isWholeSweep())
    GTEST_SKIP() << "WindowSession.LeavesAScreenshotOfEveryStep does so, and so does "
                    "ACommandDrawsScaleRangeAndClipBox";
  open();
  const Image f = save();
  chooseScalar("volume");
  const Image volume = saveAndCopy();
  EXPECT_LT(difference(f, volume), 25);
  const auto commands = close();
  ASSERT_EQ(commands.size(), 1u);
  EXPECT_EQ(valueOf(commands[0], "--scalar"), "volume");
  expectDraws(commands[0], volume);
}

TEST_F(WindowTest, FollowsTheWindowsSize) {
  if (!faults::isWholeSweep())
    GTEST_SKIP() << "WindowSession.LeavesAScreenshotOfEveryStep resizes its window, too";
  open();
  save();
  resize({800, 500});
  const Image resized = saveAndCopy();
  EXPECT_EQ(resized.size.width, pictureSize().width);
  EXPECT_EQ(resized.size.height, pictureSize().height);
  // The first view shows all of the data in a narrow picture, too.
  resize({600, 650});
  const Image narrow = save();
  size_t differing = 0;
  for (int y = 1; y < narrow.size.height; ++y)
    differing += !std::equal(narrow.pixel(0, y), narrow.pixel(0, y) + 3, narrow.pixel(0, 0));
  EXPECT_EQ(differing, 0u);
  expectDraws(close().at(0), resized);
}

}  // namespace
}  // namespace curvisplat
