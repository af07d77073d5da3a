#include "tools/window/reports.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <new>

#include "stream/base/error.h"
#include "stream/base/progress.h"
#include "tests/support/expect_error.h"
#include "tools/view/history.h"
#include "tools/view/view_state.h"
#include "tools/window/window_commands.h"

namespace curvisplat {
namespace {

TEST(Toasts, GoAwayInTheOrderOfTheirEnds) {
  Toasts toasts;
  toasts.add("saved", 0);
  toasts.add("cannot be saved", 0, true);
  ASSERT_EQ(toasts.shown(1).size(), 2u);
  ASSERT_EQ(toasts.shown(30).size(), 1u);
  EXPECT_TRUE(toasts.shown(30)[0].is_error);
  EXPECT_TRUE(toasts.shown(100).empty());
  EXPECT_EQ(toasts.log().size(), 2u);
}

TEST(Toasts, TheSameTextIsOne) {
  Toasts toasts;
  EXPECT_TRUE(toasts.add("saved", 0));
  EXPECT_FALSE(toasts.add("saved", 3));
  ASSERT_EQ(toasts.shown(3).size(), 1u);
  EXPECT_GT(toasts.shown(3)[0].ends_s, 7);
  toasts.remove(0);
  EXPECT_TRUE(toasts.shown(3).empty());
}

/// Markers that are set one after another leave one message, which hides no more of the picture than the first.
TEST(Toasts, OneAboutTheSameTakesThePlaceOfTheLast) {
  Toasts toasts;
  toasts.add("cannot be read", 0, true, About::kMarker);
  toasts.add("saved", 0);
  toasts.add("marker 1", 0, false, About::kMarker);
  toasts.add("marker 2", 1, false, About::kMarker);
  ASSERT_EQ(toasts.shown(1).size(), 3u);
  EXPECT_EQ(toasts.shown(1)[2].text, "marker 2");
  EXPECT_EQ(toasts.log().size(), 4u);
}

/// Errors name options of the command line, which the window does not have.
TEST(Reports, SayWhereTheOptionsAre) {
  const std::string where =
      " (an option of \"curvisplat convert\" in a terminal; open the cache that it writes)";
  const std::string blank = "convert with --blank VALUE; otherwise scale the values";
  EXPECT_EQ(inWindowsWords(blank), blank + where);
  const std::string iblank = "read it without iblank (--iblank no)";
  EXPECT_EQ(inWindowsWords(iblank), iblank + where);
  const std::string grid = "left out: V, on another grid (x, y, z); select that grid with --scalar NAME";
  EXPECT_EQ(inWindowsWords(grid), grid + where);
  const std::string backend = "no memory is left; give --backend cpu";
  EXPECT_EQ(inWindowsWords(backend), backend + " (an option of \"curvisplat view\" in a terminal)");
  EXPECT_EQ(inWindowsWords("ask for a smaller --size"), "ask for a smaller size");
  for (const char* plain : {"--surface walls names no face", "it is drawn without them, by --scalar",
                            "a.xyz: is truncated", "wing--fine.cgns: cannot be read", "a -- b", "--"})
    EXPECT_EQ(inWindowsWords(plain), plain);
}

TEST(Toasts, TheSameTextIsNewAgainOnceItHasGone) {
  Toasts toasts;
  EXPECT_TRUE(toasts.add("saved", 0));
  EXPECT_TRUE(toasts.add("saved", 100));
}

/// Success ends what an earlier failure of the same said, and nothing else.
TEST(Reports, AnErrorGoesWhenTheSameSucceeds) {
  Toasts toasts;
  Reports reports(toasts, [] { return 1.0; });
  reports.attempt([] { throw Error("a.xyz: has no values"); }, About::kOpening);
  reports.attempt([] { throw Error("the disk is full"); }, About::kSaving);
  reports.attempt([] { throw Error("another"); });
  EXPECT_EQ(toasts.shown(1).size(), 3u);
  reports.settle(About::kNothing);
  EXPECT_EQ(toasts.shown(1).size(), 3u);
  reports.settle(About::kOpening);
  ASSERT_EQ(toasts.shown(1).size(), 2u);
  EXPECT_EQ(toasts.shown(1)[0].text, "the disk is full");
  reports.settle(About::kSaving);
  EXPECT_EQ(toasts.shown(1).size(), 1u);
  EXPECT_EQ(toasts.log().size(), 3u);
}

TEST(Reports, AnErrorIsSaidAndWorkGoesOn) {
  Toasts toasts;
  Reports reports(toasts, [] { return 1.0; });
  EXPECT_TRUE(reports.attempt([] {}));
  EXPECT_FALSE(reports.attempt([] { throw Error("a.splats: is gone"); }));
  EXPECT_FALSE(reports.attempt([] { throw std::filesystem::filesystem_error("of two\nlines", {}); }));
  EXPECT_FALSE(reports.attempt([] { throw std::bad_alloc(); }));
  ASSERT_EQ(toasts.shown(1).size(), 3u);
  EXPECT_EQ(toasts.shown(1)[0].text, "a.splats: is gone");
  EXPECT_EQ(toasts.shown(1)[1].text.find('\n'), std::string::npos);
  expectSays(toasts.shown(1)[2].text, "out of memory");
  for (const Toast& toast : toasts.shown(1)) EXPECT_TRUE(toast.is_error);
  EXPECT_THROW(reports.attempt([] { throw Interrupted(0, "interrupted"); }), Interrupted);
}

TEST(History, GoesBackAndForth) {
  Manifest manifest;
  manifest.upper = {1, 1, 1};
  manifest.variables = {{0, "density", "", 0, 1}};
  ViewState state = firstViewOf(manifest, {300, 200});
  History history(state, {});
  history.record(state, {});  // unchanged
  EXPECT_FALSE(history.canUndo());
  state.dark = false;
  history.record(state, {});
  state.lit = true;
  history.record(state, {});
  ASSERT_TRUE(history.canUndo());
  EXPECT_FALSE(history.undo()->state.lit);
  EXPECT_TRUE(history.undo()->state.dark);
  EXPECT_EQ(history.undo(), nullptr);
  const ViewState again = history.redo()->state;
  EXPECT_FALSE(again.dark);
  ViewState other = again;
  other.lod_pixels = 3;
  history.record(other, {});  // what could be redone is gone
  EXPECT_FALSE(history.canRedo());
  EXPECT_EQ(history.undo()->state.lod_pixels, 1);
}

/// Memory that was raised for a picture is no step of its own, and an undo does not take it back.
TEST(History, KeepsMemoryThatWasRaised) {
  Manifest manifest;
  manifest.upper = {1, 1, 1};
  manifest.variables = {{0, "density", "", 0, 1}};
  ViewState state = firstViewOf(manifest, {300, 200});
  History history(state, {});
  state.lit = true;
  history.record(state, {});
  const uint64_t raised = state.memory_bytes + (1 << 20);
  state.memory_bytes = raised;
  history.raiseMemory(raised);
  history.record(state, {});
  const ViewState before = history.undo()->state;
  EXPECT_FALSE(before.lit);
  EXPECT_EQ(before.memory_bytes, raised);
  EXPECT_FALSE(history.canUndo());
}

TEST(Commands, EachKeyHasOne) {
  for (const CommandInfo& info : commands()) {
    if (info.key == 0) continue;
    EXPECT_EQ(commandOf({info.key, info.shift, info.control}), info.command) << info.label;
    EXPECT_NE(std::string(info.key_name), "") << info.label;
  }
}

TEST(Commands, NoLetterAloneWritesAFileOrEndsTheWindow) {
  for (const Command command :
       {Command::kSavePicture, Command::kSavePictureAs, Command::kQuit, Command::kSaveView, Command::kOpen}) {
    const CommandInfo& info = infoOf(command);
    EXPECT_TRUE(info.key == 0 || info.control) << info.label;
  }
}

}  // namespace
}  // namespace curvisplat
