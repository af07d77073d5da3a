// A session from the beginning to the end, with a screenshot after every step: for people to look at, too.
#include "render/image/image_file.h"
#include "tests/end_to_end/window_fixture.h"

namespace curvisplat {
namespace {

namespace fs = std::filesystem;

class WindowSession : public WindowTest {
 protected:
  static constexpr ImageSize kWhole{1280, 800};

  void SetUp() override {
    WindowTest::SetUp();
    if (IsSkipped()) return;
    display_.emplace(kWhole);
    fs::remove_all(folder());
    fs::create_directories(folder());
  }
  /// Beside the program, in the build's folder.
  static fs::path folder() {
    return fs::path(CURVISPLAT_PROGRAM).parent_path().parent_path() / "window_session";
  }

  /// Waits for the final picture and keeps what is on the screen then.
  Image look(const std::string& name) {
    const Image picture = save();
    EXPECT_TRUE(eventually([&] { return difference(shown(picture.size), picture) > 45; }, 60)) << name;
    Image screen = display_->screenshot();
    writeImage(screen, folder() / (name + ".png"));
    return screen;
  }
};

TEST_F(WindowSession, LeavesAScreenshotOfEveryStep) {
  open({}, kWhole);
  Image before = look("1_opened");
  const auto shows = [&](const std::string& name, double below_db) {
    Image after = look(name);
    EXPECT_LT(difference(before, after), below_db) << name;
    before = std::move(after);
  };
  dragPicture(1, 0.15, 0.08);
  shows("2_rotated", 25);
  moveTo(placeOf("picture"));
  act({"click", "--repeat", "5", "4"});
  shows("3_zoomed", 25);
  addPoint();
  shows("4_opacity_edited", 35);
  chooseScalar("volume");
  shows("5_another_scalar", 35);
  click("dark");
  shows("6_dark", 15);
  resize({900, 640});
  shows("7_resized", 35);
  const Image picture = saveAndCopy();
  writeImage(picture, folder() / "8_saved.png");
  const auto command = close().at(0);
  EXPECT_EQ(valueOf(command, "--scalar"), "volume");
  expectDraws(command, picture);
}

}  // namespace
}  // namespace curvisplat
