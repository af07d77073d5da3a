// Movies that the window saves: the pictures that `render` draws.
#include <cmath>

#include "render/image/image_file.h"
#include "tests/end_to_end/window_fixture.h"

namespace curvisplat {
namespace {

namespace fs = std::filesystem;

class WindowMovie : public WindowTest {
 protected:
  void SetUp() override {
    WindowTest::SetUp();
    if (IsSkipped()) return;
    fs::remove_all("movie");
    fs::create_directory("movie");
  }
  void TearDown() override { cache_ = "a"; }

  /// Chooses it from the menu and types the name; waits until it is saved, or does not.
  void saveMovie(const std::string& item, const std::string& name) {
    choose("File", item);
    answer(name);
  }
  static bool isSaved() {
    return eventually([] { return hasWidget("message saved ") && !hasWidget("movie"); }, 300);
  }
  static size_t filesIn(const fs::path& folder) {
    return static_cast<size_t>(std::distance(fs::directory_iterator(folder), {}));
  }
  /// The frames of a command as render draws them into movie/r_NNNN.png, in the size of the window's.
  static void draw(std::vector<std::string> command, const std::vector<std::string>& more) {
    const ImageSize size = readImage("movie/m_0000.png").size;
    for (size_t n = 0; n + 1 < command.size(); ++n) {
      if (command[n] == "-o") command[n + 1] = "movie/r_%04d.png";
      if (command[n] == "--size") command[n + 1] = fmt::format("{}x{}", size.width, size.height);
    }
    command.insert(command.end(), more.begin(), more.end());
    run(command);
  }
  static void expectSame(int frame) {
    const Image ours = readImage(fmt::format("movie/m_{:04}.png", frame));
    EXPECT_GE(difference(ours, readImage(fmt::format("movie/r_{:04}.png", frame))), 50) << frame;
  }
};

/// A small window, so that 90 pictures are quick.
TEST_F(WindowMovie, OnceAroundIsWhatRenderDraws) {
  open({"--scalar", "volume"}, {600, 420});
  press("h");  // without the panels
  ASSERT_TRUE(eventually([] { return !hasWidget("curve"); }));
  saveMovie("Save movie: once around...", "movie/m.png");
  placeOf("stop movie");
  press("x");  // the movie is of what was shown then
  EXPECT_TRUE(isSaved());
  press("ctrl+z");
  press("ctrl+shift+c");
  save();
  const auto command = close().at(0);
  EXPECT_EQ(filesIn("movie"), 90u);
  EXPECT_EQ(valueOf(command, "--orbit"), "360");
  draw(command, {});
  for (const int frame : {0, 30, 89}) expectSame(frame);
  EXPECT_LT(difference(readImage("movie/m_0000.png"), readImage("movie/m_0030.png")), 40);
}

TEST_F(WindowMovie, AllTimeStepsAreItsFrames) {
  run({"generate", "wake", "--size", "32x24x12", "--steps", "4", "-o", "w"});
  run({"convert", "w.xyz", "w_%04d.fun", "-o", "steps.splats", "--overwrite"});
  cache_ = "steps";
  open({"--step", "2"});
  saveMovie("Save movie: all time steps...", "movie/m.png");
  EXPECT_TRUE(isSaved());
  saveAndCopy();
  std::vector<std::string> command = close().at(0);
  EXPECT_EQ(filesIn("movie"), 4u);
  const auto step = std::find(command.begin(), command.end(), "--step");
  ASSERT_NE(step, command.end());
  command.erase(step, step + 2);
  draw(command, {"--steps", "all"});
  for (int frame = 0; frame < 4; ++frame) expectSame(frame);
}

TEST_F(WindowMovie, OneThatIsStoppedLeavesNothing) {
  if (!fs::exists("/usr/bin/ffmpeg")) GTEST_SKIP() << "ffmpeg is not installed";
  open();
  saveMovie("Save movie: once around...", "movie/m.mp4");
  click("stop movie");
  EXPECT_TRUE(eventually([] { return hasWidget("message Stopped. The movie was not saved."); }));
  EXPECT_EQ(filesIn("movie"), 0u);
  save();  // the window goes on
  close();
}

TEST_F(WindowMovie, IsAFileThatPlays) {
  if (!fs::exists("/usr/bin/ffmpeg")) GTEST_SKIP() << "ffmpeg is not installed";
  open({}, {601, 421});  // H.264 needs an even size
  saveMovie("Save movie: once around...", "movie/m.mp4");
  EXPECT_TRUE(isSaved());
  close();
  const ProgramResult frames = RunningProgram({"ffprobe", "-v", "error", "-count_frames", "-show_entries",
                                               "stream=nb_read_frames", "-of", "csv=p=0", "movie/m.mp4"},
                                              "/usr/bin/env")
                                   .wait();
  EXPECT_EQ(frames.out.substr(0, 2), "90") << frames.err;
}

TEST_F(WindowMovie, AnEndingThatCannotBeWrittenIsSaid) {
  open();
  saveMovie("Save movie: once around...", "movie/m.avi");
  EXPECT_TRUE(eventually([] { return hasWidget("message "); }));
  EXPECT_EQ(filesIn("movie"), 0u);
  save();
  close();
}

}  // namespace
}  // namespace curvisplat
