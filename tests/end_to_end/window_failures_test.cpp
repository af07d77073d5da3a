// Failures of the window: if it cannot open, it ends with one line and status 1; if its cache goes bad under
// it, it lives and says so. Then odd circumstances: it is closed while it loads, has too little memory, or
// nowhere to remember the view.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "stream/base/file.h"
#include "stream/cache/cache_reader.h"
#include "tests/end_to_end/window_fixture.h"
#include "tests/support/run_program.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/virtual_display.h"

namespace curvisplat {
namespace {

namespace fs = std::filesystem;

class NoWindow : public WindowTest {
 protected:
  static void expectFailure(const ProgramResult& result, const Words& parts) {
    EXPECT_EQ(result.status, 1) << result.err;
    const Words lines = linesOf(result.err);
    ASSERT_FALSE(lines.empty());
    for (const std::string& part : parts) EXPECT_NE(lines.back().find(part), std::string::npos) << result.err;
    // Before it there is nothing but the window's OpenGL.
    for (size_t n = 0; n + 1 < lines.size(); ++n)
      EXPECT_TRUE(lines[n].starts_with("curvisplat: window: OpenGL") ||
                  lines[n].starts_with("curvisplat: warning: "))
          << result.err;
  }
  static ProgramResult system() { return runProgram({"info", "--system"}); }
};

TEST_F(NoWindow, WithoutADisplay) {
  display_.reset();
  unsetenv("WAYLAND_DISPLAY");
  const ProgramResult result = runProgram({"view", "a.splats"});
  EXPECT_EQ(lineCount(result.err), 1) << result.err;
  expectFailure(result, {"cannot open a window", "DISPLAY", "curvisplat render"});
  expectSays(system().out, "display    none");
  expectSays(system().out, "window     not available: cannot open a window");
}

TEST_F(NoWindow, WhereOpenGlIsTooOld) {
  expectSays(system().out, "window     OpenGL");
  setenv("MESA_GL_VERSION_OVERRIDE", "2.1", 1);
  const ProgramResult result = runProgram({"view", "a.splats"});
  const std::string report = system().out;
  unsetenv("MESA_GL_VERSION_OVERRIDE");
  EXPECT_EQ(lineCount(result.err), 1) << result.err;
  expectFailure(result, {"cannot open a window", "it needs OpenGL 3.3"});
  expectSays(report, "window     not available: cannot open a window");
}

TEST_F(NoWindow, OnADisplayWithoutOpenGl) {
  display_.reset();
  display_.emplace(kScreen, Words{"-extension", "GLX"});
  const ProgramResult result = runProgram({"view", "a.splats"});
  EXPECT_EQ(lineCount(result.err), 1) << result.err;
  expectFailure(result, {"cannot open a window", "GLX", "it needs OpenGL 3.3"});
}

TEST_F(NoWindow, OfAnUnfinishedCache) {
  fs::copy("a.splats", "part.splats");
  fs::remove("part.splats/manifest.json");
  const ProgramResult result = runProgram({"view", "part.splats"});
  EXPECT_EQ(lineCount(result.err), 1) << result.err;
  expectFailure(result, {"part.splats"});
  fs::remove_all("part.splats");
}

TEST_F(NoWindow, OfACacheThatIsDamaged) {
  fs::copy("a.splats", "damaged.splats");
  fs::resize_file("damaged.splats/geometry.bin", 10);
  expectFailure(runProgram({"view", "damaged.splats"}), {"geometry.bin"});
  fs::remove_all("damaged.splats");
}

TEST_F(NoWindow, FromOptionsThatTheCacheRefuses) {
  std::ofstream("state.json") << "{\"curvisplat_view\": 1}";
  const std::vector<std::pair<Words, const char*>> refused{
      {{"--state", "state.json"}, "state.json: variable is missing"},
      {{"--state", "none.json"}, "none.json"},
      {{"--scalar", "none"}, "no scalar 'none'"}};
  for (const auto& [options, text] : refused) {
    const ProgramResult result = runProgram(Words{"view", "a.splats"} + options);
    EXPECT_EQ(lineCount(result.err), 1) << result.err;  // not even "window: OpenGL"
    expectFailure(result, {text});
  }
}

/// A cache of its own: what the window reads for its second scalar was not read before.
class WindowOnACopy : public NoWindow {
 protected:
  void SetUp() override {
    NoWindow::SetUp();
    if (IsSkipped()) return;
    cache_ = "copy";
    fs::remove_all("copy.splats");
    make();
    open();
    save();
  }
  virtual void make() { fs::copy("a.splats", "copy.splats"); }
  void TearDown() override { fs::remove_all("copy.splats"); }
  void chooseSecondScalar() {
    chooseScalar("volume");
    moveTo(rest_);  // no tooltip of the panels lies over the picture
  }
  static bool hasMessage(const std::string& part) {
    const std::string places = readTextFile("widgets");
    for (const std::string& line : linesOf(places))
      if (const size_t at = line.find(" message "); at != line.npos && line.find(part, at) != line.npos)
        return true;
    return false;
  }
};

class WindowOnTwoLevels : public WindowOnACopy {
 protected:
  void make() override {
    run({"generate", "half-annulus", "--size", "96x48x48", "-o", "b"});
    run({"convert", "b.xyz", "b.fun", "-o", "copy.splats", "--scalar", "f", "--scalar", "volume"});
  }
};

/// All bricks of the finest level lose their values.
TEST_F(WindowOnTwoLevels, DrawsWithoutTheBricksThatAreDamaged) {
  {
    const CacheReader cache("copy.splats");
    std::fstream file(cache.valuesPath(1), std::ios::in | std::ios::out | std::ios::binary);
    for (uint32_t n = 0; n < cache.bricks().size(); ++n) {
      if (!cache.bricks()[n].isLeaf()) continue;
      file.seekp(static_cast<std::streamoff>(cache.brickVariables(1)[n].values.offset));
      file.put('\x55').put('\x5a').put('\xa5');
    }
  }
  chooseSecondScalar();
  EXPECT_TRUE(eventually([] { return hasMessage("bricks cannot be read; coarser data is drawn there"); }));
  const Image coarser = saveAndCopy();
  EXPECT_TRUE(eventually([] { return hasMessage("damaged brick"); }));  // that picture is without them
  const Words command = close().back();
  EXPECT_EQ(command.back(), "--keep-going");
  expectDraws(command, coarser);
}

TEST_F(WindowOnACopy, LivesAndSaysSoWhereAFileBecomesShorter) {
  // Above the messages.
  const ImageSize part{pictureSize().width, pictureSize().height * 6 / 10};
  save();  // the picture is final by then
  const Image before = shown(part);
  fs::resize_file("copy.splats/geometry.bin", 100);
  chooseSecondScalar();
  EXPECT_TRUE(eventually([] { return hasMessage("geometry.bin"); }));
  press("ctrl+s");
  EXPECT_TRUE(eventually([] { return hasMessage("was not saved"); }));
  EXPECT_GE(difference(shown(part), before), 50);  // what it has
  close();
}

TEST_F(WindowOnACopy, LivesAndSaysSoWhereBytesChange) {
  {
    std::fstream file("copy.splats/geometry.bin", std::ios::in | std::ios::out | std::ios::binary);
    const std::string zeros(4096, '\0');
    for (uintmax_t at = 0; at + zeros.size() < fs::file_size("copy.splats/geometry.bin"); at += zeros.size())
      file.write(zeros.data(), static_cast<std::streamsize>(zeros.size()));
  }
  chooseSecondScalar();
  EXPECT_TRUE(eventually([] { return hasMessage("geometry.bin") && hasMessage("brick"); }));
  close();
}

TEST_F(WindowOnACopy, LivesAndSaysSoWhereItIsDeleted) {
  fs::remove_all("copy.splats");
  chooseSecondScalar();
  EXPECT_TRUE(eventually([] { return hasWidget("message "); }));
  close();
}

class WindowLimitsTest : public ProgramSuite<WindowLimitsTest> {
 protected:
  static void prepare() { madeCache(file("a"), "half-annulus", "128x64x64"); }
  void SetUp() override {
    if (const std::string missing = VirtualDisplay::missing(); !missing.empty())
      GTEST_SKIP() << missing << " is not installed";
    display_.emplace(kScreen);
    setenv("XDG_CONFIG_HOME", file("config").c_str(), 1);
  }

  static constexpr ImageSize kScreen{700, 400};

  /// A window as large as the screen, with the mouse over it.
  std::unique_ptr<RunningProgram> open(const Words& options = {}) const {
    const std::string size = fmt::format("{}x{}", kScreen.width, kScreen.height);
    auto window = std::make_unique<RunningProgram>(Words{"view", file("a.splats"), "--size", size} + options);
    display_->act({"mousemove", std::to_string(kScreen.width / 2), std::to_string(kScreen.height / 2)});
    EXPECT_TRUE(eventually([&] { return display_->screenshot().pixel(10, kScreen.height - 10)[0] > 0.01f; }));
    return window;
  }
  ProgramResult closed(RunningProgram& window) const {
    display_->act({"key", "ctrl+q"});
    return window.wait();
  }

  std::optional<VirtualDisplay> display_;
};

// Leaks are for the address sanitizer to find, which then ends the program with another status.
TEST_F(WindowLimitsTest, ClosesWhileItLoads) {
  for (const char* zoom : {"0", "3", "9"}) {
    SCOPED_TRACE(zoom);
    const auto window = open({"--memory", "80M"});
    // Each turn of the wheel is another picture, which is given up for the next.
    if (std::string(zoom) != "0") display_->act({"click", "--repeat", zoom, "4"});
    const ProgramResult result = closed(*window);
    EXPECT_EQ(result.status, 0) << result.err;
    EXPECT_EQ(lineCount(result.err), 1) << result.err;  // which OpenGL the window has
  }
}

TEST_F(WindowLimitsTest, TooLittleMemoryIsReported) {
  const auto window = open({"--memory", "1M"});
  // Another size, another word: the window lives.
  const ImageSize smaller{kScreen.width - 100, kScreen.height - 100};
  display_->act({"search", "--onlyvisible", "--name", "curvisplat", "windowsize",
                 std::to_string(smaller.width), std::to_string(smaller.height)});
  EXPECT_TRUE(eventually(
      [&] { return display_->screenshot().pixel(smaller.width + 50, smaller.height + 50)[0] < 0.01f; }));
  const ProgramResult result = closed(*window);
  EXPECT_EQ(result.status, 0) << result.err;
  expectSays(result.err, "warning: this picture needs ");
  expectSays(result.err, "raise \"memory\" under View");
}

TEST_F(WindowLimitsTest, WithNowhereToRememberItOpens) {
  setenv("XDG_CONFIG_HOME", "/proc/self/fd/none", 1);
  const auto window = open();
  const ProgramResult result = closed(*window);
  EXPECT_EQ(result.status, 0) << result.err;
  expectSays(result.err, "warning: cannot save the view");
}

}  // namespace
}  // namespace curvisplat
