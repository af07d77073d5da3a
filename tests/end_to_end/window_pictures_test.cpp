// Pictures that the window saves in another size than it shows.
#include <csignal>
#include <functional>

#include "tests/end_to_end/window_fixture.h"

namespace curvisplat {
namespace {

// Drawing waits for its turn on a busy machine: what is waited for here has no time of its own, only ctest's.
constexpr double kLong = 400;

class WindowPictures : public WindowTest {
 protected:
  static bool isOpen() { return hasWidget("file name"); }
  /// Clicks until `done`: a click may come before the window hears. Not again before the window has drawn a frame since, so
  /// that a slow window does not get the second click for something else.
  void clickUntil(const std::string& widget, const std::function<bool()>& done) {
    ASSERT_TRUE(eventually(
        [&] {
          if (const auto place = placeNow(widget, 0.5, 0.5)) click(*place);
          return eventually(done, 20);
        },
        kLong))
        << widget;
  }
  /// The name has the focus when the dialog appears.
  void openDialog(const std::string& name) {
    choose("File", "Save picture as...");
    ASSERT_TRUE(eventually(isOpen, kLong));
    press("ctrl+a");
    act({"type", name});
  }
  Image accept(const std::string& name) {
    clickUntil("file accept", [] { return !isOpen(); });
    EXPECT_TRUE(eventually([&] { return std::filesystem::exists(name); }, kLong)) << name;
    return readImage(name);
  }
};

/// The same as the command draws in that size.
TEST_F(WindowPictures, AreSavedInTwiceTheSize) {
  open();
  saveAndCopy();
  const ImageSize shown = pictureSize();
  openDialog("twice.png");
  clickUntil("picture size twice that",
             [&] { return hasWidget(fmt::format("picture of {} x {}", 2 * shown.width, 2 * shown.height)); });
  const Image twice = accept("twice.png");
  EXPECT_EQ(twice.size.width, 2 * shown.width);
  EXPECT_EQ(twice.size.height, 2 * shown.height);
  const auto commands = close();
  ASSERT_EQ(commands.size(), 1u);
  std::vector<std::string> command = commands[0];
  for (size_t n = 0; n + 1 < command.size(); ++n)
    if (command[n] == "--size") command[n + 1] = fmt::format("{}x{}", twice.size.width, twice.size.height);
  expectDraws(command, twice);
}

/// As if a frame took so long that all of it came before the next one: Control and A, letters, Return.
TEST_F(WindowPictures, HaveTheNameThatWasTypedDuringOneFrame) {
  open();
  save();
  openDialog("slow");
  window_->signal(SIGSTOP);
  press("ctrl+a");
  act({"type", "slow xy.png"});
  press("Return");
  window_->signal(SIGCONT);
  EXPECT_TRUE(eventually([] { return !isOpen() && std::filesystem::exists("slow xy.png"); }, kLong));
  EXPECT_FALSE(std::filesystem::exists("a.png"));
  close();
}

/// Letters, a click into another field, letters there and Return, all during one frame that is slow.
TEST_F(WindowPictures, HaveTheSizeThatWasTypedDuringOneFrame) {
  open();
  save();
  openDialog("slow");
  const Place width = placeOf("picture width");
  window_->signal(SIGSTOP);
  press("ctrl+a");
  act({"type", "narrow.png"});
  click(width);
  press("ctrl+a");
  act({"type", "200"});
  press("Tab");
  window_->signal(SIGCONT);
  EXPECT_TRUE(eventually([] { return hasWidget("picture of 200 x"); }, kLong));
  EXPECT_EQ(accept("narrow.png").size.width, 200);
  close();
}

/// What is typed before the dialog has been drawn: the keys that open it and the name come during one frame.
TEST_F(WindowPictures, HaveTheNameThatWasTypedBeforeTheDialogOpened) {
  open();
  save();
  window_->signal(SIGSTOP);
  press("ctrl+shift+s");
  press("ctrl+a");
  act({"type", "early.png"});
  press("Return");
  window_->signal(SIGCONT);
  EXPECT_TRUE(eventually([] { return std::filesystem::exists("early.png"); }, kLong));
  EXPECT_TRUE(eventually([] { return !isOpen(); }, kLong));
  close();
}

/// A narrower picture has all that the window shows: the outline's box was whole in it, so nothing reaches the border.
TEST_F(WindowPictures, ThatAreNarrowerHoldWhatIsShown) {
  open();
  save();
  const ImageSize shown = pictureSize();
  openDialog("whole.png");
  click("picture width");
  press("ctrl+a");
  act({"type", "200"});
  press("Tab");
  EXPECT_TRUE(eventually([] { return hasWidget("picture of 200 x"); }, kLong));
  const Image narrow = accept("whole.png");
  EXPECT_EQ(narrow.size.width, 200);
  EXPECT_EQ(narrow.size.height, shown.height);
  for (int y = 0; y < narrow.size.height; ++y) {
    EXPECT_EQ(narrow.pixel(0, y)[0], 1) << y;
    EXPECT_EQ(narrow.pixel(199, y)[0], 1) << y;
  }
  close();
}

}  // namespace
}  // namespace curvisplat
