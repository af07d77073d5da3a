// The window under odd circumstances: closed while it loads, too little memory, nowhere to remember the view.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "tests/support/run_program.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/virtual_display.h"

namespace curvisplat {
namespace {

class WindowLimitsTest : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = std::make_unique<TemporaryFolder>();
    for (const std::vector<std::string>& arguments : std::vector<std::vector<std::string>>{
             {"generate", "half-annulus", "--size", "128x64x64", "-o", file("a")},
             {"convert", file("a.xyz"), file("a.fun"), "-o", file("a.splats")}}) {
      const ProgramResult result = runProgram(arguments);
      ASSERT_EQ(result.status, 0) << result.err;
    }
  }
  static void TearDownTestSuite() { folder_.reset(); }
  void SetUp() override {
    if (const std::string missing = VirtualDisplay::missing(); !missing.empty())
      GTEST_SKIP() << missing << " is not installed";
    display_.emplace(kScreen);
    setenv("XDG_CONFIG_HOME", file("config").c_str(), 1);
  }

  static constexpr ImageSize kScreen{700, 400};

  static std::string file(const std::string& name) { return (*folder_ / name).string(); }

  /// A window as large as the screen, with the mouse over it.
  std::unique_ptr<RunningProgram> open(std::vector<std::string> options = {}) const {
    options.insert(options.begin(),
                   {"view", file("a.splats"), "--size", fmt::format("{}x{}", kScreen.width, kScreen.height)});
    auto window = std::make_unique<RunningProgram>(options);
    display_->act({"mousemove", std::to_string(kScreen.width / 2), std::to_string(kScreen.height / 2)});
    EXPECT_TRUE(eventually([&] { return display_->screenshot().pixel(10, kScreen.height - 10)[0] > 0.01f; }));
    return window;
  }
  ProgramResult closed(RunningProgram& window) const {
    display_->act({"key", "ctrl+q"});
    return window.wait();
  }

  static std::unique_ptr<TemporaryFolder> folder_;
  std::optional<VirtualDisplay> display_;
};
std::unique_ptr<TemporaryFolder> WindowLimitsTest::folder_;

// What leaks is for the address sanitizer to say, which then ends the program with another status.
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
  EXPECT_NE(result.err.find("warning: --memory 1 MiB: too little"), std::string::npos) << result.err;
  EXPECT_NE(result.err.find("give at least"), std::string::npos) << result.err;
}

TEST_F(WindowLimitsTest, WithNowhereToRememberItOpens) {
  setenv("XDG_CONFIG_HOME", "/proc/self/fd/none", 1);
  const auto window = open();
  const ProgramResult result = closed(*window);
  EXPECT_EQ(result.status, 0) << result.err;
  EXPECT_NE(result.err.find("warning: cannot save the view"), std::string::npos) << result.err;
}

}  // namespace
}  // namespace curvisplat
