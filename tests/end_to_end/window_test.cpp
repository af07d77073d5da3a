// The window, as a person uses it: opened on a display, moved with the mouse, looked at.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <memory>
#include <optional>
#include <sstream>
#include <string>
#include <vector>

#include "render/image.h"
#include "tests/support/run_program.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/virtual_display.h"

namespace curvisplat {
namespace {

namespace fs = std::filesystem;

constexpr ImageSize kScreen{1000, 700};
constexpr int kPanel = 338;  // the picture begins right of it

class WindowTest : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = std::make_unique<TemporaryFolder>();
    old_folder_ = fs::current_path();
    fs::current_path(folder_->path());  // where pictures are saved
    setenv("XDG_CONFIG_HOME", file("config").c_str(), 1);
    run({"generate", "half-annulus", "--size", "48x24x24", "-o", "a"});
    // A second scalar: the same file again under another name.
    fs::copy_file("a.fun", "b.fun");
    run({"convert", "a.xyz", "a.fun", "b.fun", "-o", "a.splats", "--scalar", "f", "--scalar", "1"});
  }
  static void TearDownTestSuite() {
    fs::current_path(old_folder_);
    folder_.reset();
  }
  void SetUp() override {
    if (const std::string missing = VirtualDisplay::missing(); !missing.empty())
      GTEST_SKIP() << missing << " is not installed";
    display_.emplace(kScreen);
    fs::remove_all("config");
    for (int n = 1; n < 20; ++n) fs::remove(picture(n));
  }

  static std::string file(const std::string& name) { return (*folder_ / name).string(); }
  static void run(const std::vector<std::string>& arguments) {
    const ProgramResult result = runProgram(arguments);
    ASSERT_EQ(result.status, 0) << result.err;
  }
  static std::string picture(int number) { return fmt::format("a_{:04}.png", number); }

  void open(std::vector<std::string> options = {}) {
    options.insert(options.begin(), {"view", "a.splats", "--size", "900x600"});
    window_ = std::make_unique<RunningProgram>(options);
    act({"mousemove", "600", "300"});
    // The panels are dark grey, the screen behind the window is black.
    ASSERT_TRUE(eventually([&] { return display_->screenshot().pixel(10, 590)[0] > 0.01f; }));
  }
  void act(const std::vector<std::string>& words) { display_->act(words); }
  void drag(int button, int dx, int dy, int x = 600, int y = 300) {
    const std::string number = std::to_string(button);
    act({"mousemove", std::to_string(x), std::to_string(y), "mousedown", number});
    for (int step = 1; step <= 4; ++step)
      act({"mousemove", std::to_string(x + step * dx / 4), std::to_string(y + step * dy / 4)});
    act({"mouseup", number, "mousemove", "600", "300"});
  }
  /// The final picture, as saved by `p`.
  Image save() {
    const std::string name = picture(++saved_);
    EXPECT_TRUE(eventually([&] {
      if (!fs::exists(name)) act({"key", "p"});  // a key may come before the window hears
      return eventually([&] { return fs::exists(name); }, 5);
    }));
    return readImage(name);
  }
  ProgramResult close() {
    act({"key", "Escape"});
    return window_->wait();
  }

  static double difference(const Image& a, const Image& b) {
    return a.size.width == b.size.width && a.size.height == b.size.height ? compareImages(a, b).psnr_db : 0;
  }
  /// The part of the screen where the window shows the picture.
  Image shown(ImageSize size) const {
    const Image screen = display_->screenshot();
    Image part(size);
    for (int y = 0; y < size.height; ++y)
      for (int x = 0; x < size.width; ++x) std::copy_n(screen.pixel(kPanel + x, y), 4, part.pixel(x, y));
    return part;
  }

  static std::unique_ptr<TemporaryFolder> folder_;
  static fs::path old_folder_;
  std::optional<VirtualDisplay> display_;
  std::unique_ptr<RunningProgram> window_;
  int saved_ = 0;
};
std::unique_ptr<TemporaryFolder> WindowTest::folder_;
fs::path WindowTest::old_folder_;

std::vector<std::string> linesOf(const std::string& text) {
  std::vector<std::string> lines;
  std::istringstream stream(text);
  for (std::string line; std::getline(stream, line);) lines.push_back(line);
  return lines;
}

/// The words of a shell command without its first, which is the program's name.
std::vector<std::string> wordsOf(const std::string& command) {
  const ProgramResult result =
      RunningProgram({"sh", "-c", "set -- " + command + "; shift; printf '%s\\n' \"$@\""}, "/usr/bin/env")
          .wait();
  return linesOf(result.out);
}

TEST_F(WindowTest, ShowsWhatIsDoneToIt) {
  open();
  const Image first = save();
  EXPECT_EQ(first.size.width, 900 - kPanel);
  EXPECT_EQ(first.size.height, 600);
  // What is on the screen is what was saved: 8 bits, with the scalar bar and the axes.
  EXPECT_TRUE(eventually([&] { return difference(shown(first.size), first) > 45; }, 5))
      << difference(shown(first.size), first);

  drag(1, 120, 60);
  const Image rotated = save();
  EXPECT_LT(difference(first, rotated), 30);
  drag(2, 80, -40);
  const Image panned = save();
  EXPECT_LT(difference(rotated, panned), 30);
  act({"click", "--repeat", "4", "4"});  // the wheel
  const Image zoomed = save();
  EXPECT_LT(difference(panned, zoomed), 30);
  act({"key", "r"});
  const Image reset = save();
  EXPECT_LT(difference(zoomed, reset), 30);

  act({"key", "x"});
  const Image along_x = save();
  act({"key", "o"});
  const Image perspective = save();
  EXPECT_LT(difference(along_x, perspective), 45);

  // A new opacity point, high above the curve.
  act({"mousemove", "100", "50", "click", "1", "mousemove", "600", "300"});
  const Image edited = save();
  EXPECT_LT(difference(perspective, edited), 35);

  act({"key", "c"});
  const ProgramResult result = close();
  EXPECT_EQ(result.status, 0) << result.err;
  const std::vector<std::string> said = linesOf(result.out);
  ASSERT_EQ(said.size(), 1u) << result.out;
  EXPECT_NE(said[0].find("--view-angle"), std::string::npos) << said[0];
  // The command draws what was saved.
  run(wordsOf(said[0]));
  EXPECT_GE(difference(readImage("picture.png"), edited), 50);
}

TEST_F(WindowTest, ComesBackAsItWasLeft) {
  open();
  drag(1, 90, -30);
  act({"key", "o"});
  const Image before = save();
  EXPECT_EQ(close().status, 0);
  open();
  EXPECT_GE(difference(save(), before), 50);
  EXPECT_EQ(close().status, 0);
}

TEST_F(WindowTest, ShowsAnotherScalarFromItsList) {
  open();
  save();
  act({"mousemove", "100", "17", "click", "1"});
  eventually([&] { return display_->screenshot().pixel(150, 40)[2] > 0.5f; }, 1);  // the list is open
  act({"mousemove", "60", "58", "click", "1", "mousemove", "600", "300"});
  save();
  act({"key", "c"});
  const ProgramResult result = close();
  EXPECT_NE(result.out.find("--scalar 1"), std::string::npos) << result.out;
}

TEST_F(WindowTest, FollowsTheWindowsSize) {
  open();
  save();
  act({"search", "--onlyvisible", "--name", "curvisplat", "windowsize", "800", "500"});
  eventually([&] { return display_->screenshot().pixel(10, 590)[0] < 0.01f; });
  const Image resized = save();
  EXPECT_EQ(resized.size.width, 800 - kPanel);
  EXPECT_EQ(resized.size.height, 500);
  EXPECT_EQ(close().status, 0);
}

TEST_F(WindowTest, EndsWithALineWhereTheCacheIsDamagedUnderIt) {
  fs::copy("a.splats", "damaged.splats");
  fs::resize_file("damaged.splats/geometry.bin", 10);
  const ProgramResult result = runProgram({"view", "damaged.splats"});
  EXPECT_EQ(result.status, 1) << result.err;
  EXPECT_NE(result.err.find("geometry.bin"), std::string::npos) << result.err;
  fs::remove_all("damaged.splats");
}

TEST_F(WindowTest, SaysWhatIsWrongWithAStateFile) {
  std::ofstream("state.json") << "{\"curvisplat_view\": 1}";
  const ProgramResult result = runProgram({"view", "a.splats", "--state", "state.json"});
  EXPECT_EQ(result.status, 1);
  EXPECT_NE(result.err.find("state.json: field variable"), std::string::npos) << result.err;
}

TEST_F(WindowTest, WithoutADisplaySaysSo) {
  display_.reset();
  unsetenv("WAYLAND_DISPLAY");
  const ProgramResult result = runProgram({"view", "a.splats"});
  EXPECT_EQ(result.status, 1);
  EXPECT_EQ(lineCount(result.err), 1) << result.err;
  EXPECT_NE(result.err.find("no window can be opened"), std::string::npos) << result.err;
}

}  // namespace
}  // namespace curvisplat
