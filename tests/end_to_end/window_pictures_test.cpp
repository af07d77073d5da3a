// Pictures that the window saves in another size than it shows; movies that it saves, which are the pictures
// that `render` draws; and a session from the beginning to the end, with a screenshot after every step: for
// people to look at, too.
#include <glm/geometric.hpp>
#include <glm/trigonometric.hpp>
#include <glm/vec3.hpp>
#include <nlohmann/json.hpp>

#include <cmath>
#include <csignal>
#include <cstdlib>
#include <functional>

#include "render/colour/function_parts.h"
#include "render/image/image_file.h"
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

/// `view` takes the options of cameras that `render` takes, in place of the view that was left last time. The copied command
/// draws the same picture; `render` fits the data into a picture whose scalar bar may be a little wider.
TEST_F(WindowPictures, OpensOnTheViewOfCameraOptions) {
  struct Seen {
    glm::dvec3 towards, up;
    double half_height;
  };
  const auto seenBy = [](const Words& command) {
    run(command + Words{"--stats", "camera.json"});
    const nlohmann::json camera = jsonOf("camera.json")["frames"][0]["camera"];
    const auto point = [&](const char* name) {
      return glm::dvec3(camera[name][0], camera[name][1], camera[name][2]);
    };
    const glm::dvec3 way = point("position") - point("focal_point");
    const bool perspective = camera["projection"] == "perspective";
    const double degrees = perspective ? camera["view_angle_deg"].get<double>() : 0;
    return Seen{glm::normalize(way), glm::normalize(point("view_up")),
                perspective ? glm::length(way) * std::tan(glm::radians(degrees / 2))
                            : camera["parallel_scale"].get<double>()};
  };
  for (const Words& camera : {Words{"--view", "-y", "--elevation", "20", "--roll", "10"},
                              {"--position=9,3,4", "--view-angle", "25"},
                              {"--azimuth", "40", "--zoom", "1.5"}}) {
    if (camera[0] == "--azimuth" && !faults::isWholeSweep()) continue;
    open(camera);
    const Image drawn = saveAndCopy();
    const auto commands = close();
    ASSERT_EQ(commands.size(), 1u);
    expectDraws(commands[0], drawn);
    const Words render{
        "render", "a.splats", "-o", "picture.png", "--scalar-bar", "--size", valueOf(commands[0], "--size")};
    const Seen window = seenBy(commands[0]), expected = seenBy(render + camera);
    EXPECT_GT(glm::dot(window.towards, expected.towards), 0.9995) << testing::PrintToString(commands[0]);
    EXPECT_GT(glm::dot(window.up, expected.up), 0.9995) << testing::PrintToString(commands[0]);
    EXPECT_NEAR(window.half_height / expected.half_height, 1, 0.1) << testing::PrintToString(commands[0]);
  }
  expectRefused({"view", "a.splats", "--view", "+x", "--position", "1,2,3"}, 2,
                {"--view cannot be combined with --position"});
  // The window has said by then what draws it.
  const ProgramResult refused = runProgram({"view", "a.splats", "--look-at", "3,4", "--from-height", "9"});
  EXPECT_EQ(refused.status, 1);
  EXPECT_NE(refused.err.find("--globe"), std::string::npos) << refused.err;
}

/// A large window's isosurface takes more than the usual memory, which it gets; a limit that was given stays.
TEST_F(WindowPictures, GetTheMemoryThatTheyNeed) {
  if (!faults::isWholeSweep()) GTEST_SKIP() << "LargeOnesTakeTheMemoryThatTheyNeed asks for more memory, too";
  constexpr ImageSize kLarge{3200, 1800};
  display_.emplace(kLarge);
  open({"--iso", "0.5"}, kLarge);
  save();  // a command that is copied before the picture has failed has the usual memory
  const Image drawn = saveAndCopy();
  const auto commands = close();
  ASSERT_FALSE(commands.empty());  // where frames of this size are slow, the key is pressed again
  EXPECT_NE(valueOf(commands.back(), "--memory"), "");
  expectDraws(commands.back(), drawn);
  open({"--iso", "0.5", "--memory", "512M"}, kLarge);
  EXPECT_TRUE(eventually([] { return hasWidget("message this picture needs"); }));
  close();
}

/// The same as the command draws in that size.
TEST_F(WindowPictures, AreSavedInTwiceTheSize) {
  open();
  saveAndCopy();
  const ImageSize shown = pictureSize();
  openDialog("twice.png");
  clickUntil("picture size Twice that",
             [&] { return hasWidget(fmt::format("picture of {} x {}", 2 * shown.width, 2 * shown.height)); });
  const std::vector<Widget> all = widgets();
  const auto texts =
      std::ranges::find_if(all, [](const Widget& one) { return one.name.starts_with("texts "); });
  press("Return");  // it is the button's where the keyboard is in no field
  ASSERT_TRUE(eventually([] { return !isOpen(); }, kLong));
  const Image twice = accept("twice.png");
  EXPECT_EQ(twice.size.width, 2 * shown.width);
  EXPECT_EQ(twice.size.height, 2 * shown.height);
  const auto commands = close();
  ASSERT_EQ(commands.size(), 1u);
  Words command = commands[0];
  for (size_t n = 0; n + 1 < command.size(); ++n)
    if (command[n] == "--size")
      command[n + 1] = fmt::format("{}x{}", twice.size.width, twice.size.height);
    else if (command[n] == "--text-size")
      command[n + 1] = fmt::format("{}", 2 * std::stod(command[n + 1]));
  ASSERT_TRUE(texts != all.end());
  EXPECT_EQ(texts->name, fmt::format("texts {} pixels high", valueOf(command, "--text-size")));
  expectDraws(command, twice);
}

/// Lines and the Earth are in no list of the window.
TEST_F(WindowPictures, ShowTheLinesAndTheEarthOfTheCommandLine) {
  writeFileAtomically("lines.csv", std::string("x,y,z\n-3,-1,0\n3,-1,0\n"));
  open({"--lines", "lines.csv", "--lines-colour", "#00ff00", "--map", "#ff0000", "--map-height", "0",
        "--globe", "0.5"});
  const Image saved = saveAndCopy();
  int green = 0, red = 0;
  for (size_t n = 0; n < saved.rgba.size(); n += 4) {
    const float *const rgb = &saved.rgba[n], least = 0.3f;
    red += rgb[0] > least && rgb[0] > 3 * rgb[1] && rgb[0] > 3 * rgb[2];
    green += rgb[1] > least && rgb[1] > 3 * rgb[0] && rgb[1] > 3 * rgb[2];
  }
  EXPECT_GT(red, 20);
  EXPECT_GT(green, 20);
  const auto commands = close();
  ASSERT_EQ(commands.size(), 1u);
  EXPECT_EQ(valueOf(commands[0], "--lines"), "lines.csv");
  expectDraws(commands[0], saved);
}

/// The window's memory is too little for them: they take more, where it is free.
TEST_F(WindowPictures, LargeOnesTakeTheMemoryThatTheyNeed) {
  open({"--memory", "160M", "--iso", "0.5"});
  save();
  const Words large{"render", "a.splats", "--size", "1920x1080", "--iso", "0.5", "-o", "refused.png"};
  ASSERT_NE(runProgram(large + Words{"--memory", "160M"}).status, 0);
  openDialog("large.png");
  clickUntil("picture size 1920 x 1080", [] { return hasWidget("picture of 1920 x 1080"); });
  EXPECT_EQ(accept("large.png").size.height, 1080);
  close();
}

/// One frame takes so long that all input comes before the next one: Control and A, letters, Return.
TEST_F(WindowPictures, HaveTheNameThatWasTypedDuringOneFrame) {
  if (!faults::isWholeSweep())
    GTEST_SKIP() << "HaveTheNameThatWasTypedBeforeTheDialogOpened and HaveTheSizeThatWasTypedDuringOneFrame "
                    "type as fast";
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

/// A name is typed before the dialog has been drawn: the keys that open it and the name come during one
/// frame.
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

/// A narrower picture has all that the window shows, which was whole in it, so nothing reaches the border.
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
    EXPECT_EQ(narrow.pixel(0, y)[0], kDefaultBackground.r) << y;
    EXPECT_EQ(narrow.pixel(199, y)[0], kDefaultBackground.r) << y;
  }
  close();
}

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
  /// The pictures of a film of one turn: 90 unless another number is typed.
  static int pictures() { return faults::isWholeSweep() ? 90 : 12; }
  /// Opens the dialog of that film and leaves the keyboard at the file's name.
  void chooseOnceAround() {
    choose("File", "Save film: once around...");
    placeOf("file name");
    if (pictures() == 90) return;
    click("movie pictures");
    press("ctrl+a");
    act({"type", std::to_string(pictures())});
    press("Tab");
    EXPECT_TRUE(eventually(
        [] { return hasWidget(fmt::format("movie of pictures a second: {} pictures", pictures())); }));
    click("file name");
  }
  static bool isSaved() {
    return eventually([] { return hasWidget("message saved ") && !hasWidget("movie"); }, 300);
  }
  static size_t filesIn(const fs::path& folder) {
    return static_cast<size_t>(std::distance(fs::directory_iterator(folder), {}));
  }
  /// The frames of a command as render draws them into movie/r_NNNN.png, in the size of the window's.
  static void draw(Words command, const Words& more) {
    const ImageSize size = readImage("movie/m_0000.png").size;
    for (size_t n = 0; n + 1 < command.size(); ++n) {
      if (command[n] == "-o") command[n + 1] = "movie/r_%04d.png";
      if (command[n] == "--size") command[n + 1] = fmt::format("{}x{}", size.width, size.height);
    }
    run(command + more);
  }
  static void expectSame(int frame) {
    const Image ours = readImage(fmt::format("movie/m_{:04}.png", frame));
    EXPECT_GE(difference(ours, readImage(fmt::format("movie/r_{:04}.png", frame))), 50) << frame;
  }
};

/// The film has 12 pictures by default, and 90 with tools/test.sh --whole.
TEST_F(WindowMovie, OnceAroundIsWhatRenderDraws) {
  open({"--scalar", "volume"}, {480, 360});
  press("h");  // without the panels
  ASSERT_TRUE(eventually([] { return !hasWidget("curve"); }));
  chooseOnceAround();
  placeOf("texts 12 pixels high");
  answer("movie/m.png");
  placeOf("stop movie");
  press("x");  // the movie is of what was shown then
  EXPECT_TRUE(isSaved());
  press("ctrl+z");
  press("ctrl+shift+c");
  save();
  const auto command = close().at(0);
  EXPECT_EQ(filesIn("movie"), static_cast<size_t>(pictures()));
  EXPECT_EQ(valueOf(command, "--orbit"), "360");
  const int parts = pictures() / 3, last = pictures() - 1;
  for (const int part : {1, parts}) draw(command, {"--part", fmt::format("{}/{}", part, parts)});
  for (const int frame : {0, parts, last}) expectSame(frame);
  // The data are whole from all sides: nothing reaches the left border.
  for (int frame = 0; frame <= last; ++frame) {
    const Image seen = readImage(fmt::format("movie/m_{:04}.png", frame));
    for (int y = 0; y < seen.size.height; ++y)
      ASSERT_EQ(seen.pixel(0, y)[0], kDefaultBackground.r) << frame << ' ' << y;
  }
  EXPECT_LT(difference(readImage("movie/m_0000.png"), readImage(fmt::format("movie/m_{:04}.png", parts))),
            40);
}

/// A page is offered where ffmpeg is not in PATH: it needs none.
TEST_F(WindowMovie, WithoutFfmpegAPageIsOffered) {
  const std::string path = std::getenv("PATH");
  fs::remove("a.html");
  fs::remove_all("bin");
  fs::create_directory("bin");
  std::istringstream folders(path);
  for (std::string folder; std::getline(folders, folder, ':');)
    if (const fs::path tool = fs::path(folder) / "xdotool"; fs::exists(tool) && !fs::exists("bin/xdotool"))
      fs::create_symlink(tool, "bin/xdotool");
  setenv("PATH", file("bin").c_str(), 1);
  open({"--scalar", "volume"}, {480, 360});
  setenv("PATH", path.c_str(), 1);
  chooseOnceAround();
  press("Return");
  EXPECT_TRUE(isSaved());
  EXPECT_TRUE(fs::exists("a.html"));
  close();
}

TEST_F(WindowMovie, AllTimeStepsAreItsFrames) {
  run({"generate", "wake", "--size", "32x24x12", "--steps", "4", "-o", "w"});
  run({"convert", "w.xyz", "w_%04d.fun", "-o", "steps.splats", "--overwrite"});
  cache_ = "steps";
  open({"--step", "2"});
  saveMovie("Save film: all time steps...", "movie/m.png");
  EXPECT_TRUE(isSaved());
  saveAndCopy();
  Words command = close().at(0);
  EXPECT_EQ(filesIn("movie"), 4u);
  const auto step = std::find(command.begin(), command.end(), "--step");
  ASSERT_NE(step, command.end());
  command.erase(step, step + 2);
  draw(command, {"--steps", "all"});
  for (int frame = 0; frame < 4; ++frame) expectSame(frame);
}

/// Works every control of the film.
TEST_F(WindowMovie, AFilmIsMadePlayedSavedAndDrawnAsRenderDrawsIt) {
  open({"--scalar", "volume"}, {900, 700});
  press("x");
  choose("Picture", "Add a clip plane");
  save();
  tab("View");
  click("Film");
  click("add key frame");
  placeOf("key frame 1 drawn");
  EXPECT_FALSE(hasWidget("key frame 2"));
  press("y");
  tab("Colour");
  addPoint();
  save();
  tab("View");
  click("add key frame");
  click("add key frame");
  placeOf("key frame 3 drawn");
  EXPECT_TRUE(hasWidget("film length of 4 s, 101 pictures"));
  click("delete key frame");
  EXPECT_TRUE(eventually([] { return !hasWidget("key frame 3"); }));
  const auto enterTime = [&](const char* time) {
    click("film time");
    press("ctrl+a");
    act({"type", time});
    press("Return");
  };
  // A number moves the key frame, and so does the mouse.
  enterTime("0.4");
  placeOf("film length of 0.4 s, 11 pictures");
  drag(1, placeOf("mark of key frame 2"), placeOf("film time line", 0.9));
  EXPECT_TRUE(eventually([] { return !hasWidget("film length of 0.4 s"); }));
  enterTime("0.2");
  placeOf("film length of 0.2 s, 6 pictures");
  // Selecting shows what the key frame shows; the view that is updated is another one.
  const Image last = save();
  click("key frame 1");
  const Image first = save();
  EXPECT_LT(difference(first, last), 40);
  click("play film");
  click("key frame 2");
  EXPECT_GE(difference(save(), last), 50);
  press("z");
  const Image other = save();
  click("update key frame");
  placeOf("key frame 2 drawn");
  click("film time line");  // somewhere within the film, or at its end
  click("key frame 2");
  EXPECT_GE(difference(save(), other), 50);

  click("save film");
  answer("movie/film.json");
  EXPECT_TRUE(eventually([] { return fs::exists("movie/film.json"); }));
  click("delete key frame");
  click("delete key frame");
  EXPECT_TRUE(eventually([] { return !hasWidget("key frame 1"); }));
  click("open film");
  answer("film.json");  // in the folder that was typed
  placeOf("key frame 2 drawn");
  EXPECT_GE(difference(save(), first), 50);

  click("Save film: key frames...");
  answer("m.png");
  const auto is_written = [] { return fs::exists("movie/m_0005.png") && !hasWidget("stop movie"); };
  EXPECT_TRUE(eventually(is_written, 300));
  click("Copy command for the key frames");
  save();
  const auto command = close().at(0);
  EXPECT_EQ(filesIn("movie"), 7u);  // with the film
  EXPECT_EQ(valueOf(command, "--path"), "a_shown_film.json");
  EXPECT_EQ(bytesOfFile("a_shown_film.json"), bytesOfFile("movie/film.json"));
  draw(command, {});
  for (const int frame : {0, 3, 5}) expectSame(frame);
  EXPECT_LT(difference(readImage("movie/m_0000.png"), readImage("movie/m_0003.png")), 40);
}

/// A film is there again in the next window, and a key frame that was deleted comes back by undo.
TEST_F(WindowMovie, AFilmIsKeptAndItsKeyFramesAreUndone) {
  const auto show = [&] {
    open({}, {900, 700});
    tab("View");
    placeOf("Film");
    save();
    if (!hasWidget("add key frame")) click("Film");  // it is unfolded where there is a film
  };
  show();
  press("x");
  save();
  click("add key frame");
  press("y");
  save();
  click("add key frame");
  placeOf("key frame 2 drawn");
  save();
  click("delete key frame");
  EXPECT_TRUE(eventually([] { return !hasWidget("key frame 2"); }));
  save();
  press("ctrl+z");
  placeOf("key frame 2 drawn");
  close();
  show();
  placeOf("key frame 2 drawn");
  placeOf("film length of 2 s, 51 pictures");
  click("delete key frame");
  EXPECT_TRUE(eventually([] { return !hasWidget("key frame 2"); }));
  click("delete key frame");
  EXPECT_TRUE(eventually([] { return !hasWidget("key frame 1"); }));
  close();
  show();
  placeOf("add key frame");
  EXPECT_FALSE(hasWidget("key frame 1"));
  close();
}

TEST_F(WindowMovie, OneThatIsStoppedLeavesNothing) {
  if (!fs::exists("/usr/bin/ffmpeg")) GTEST_SKIP() << "ffmpeg is not installed";
  open();
  saveMovie("Save film: once around...", "movie/m.mp4");
  click("stop movie");
  EXPECT_TRUE(eventually([] { return hasWidget("message Stopped. The film was not saved."); }));
  EXPECT_EQ(filesIn("movie"), 0u);
  save();  // the window goes on
  close();
}

TEST_F(WindowMovie, IsAFileThatPlays) {
  if (!fs::exists("/usr/bin/ffmpeg")) GTEST_SKIP() << "ffmpeg is not installed";
  open({}, {481, 361});
  choose("File", "Save film: once around...");
  placeOf("movie of pictures a second: 90 pictures, 3.6 s");
  const auto type = [&](const std::string& field, const std::string& number) {
    click(field);
    press("ctrl+a");
    act({"type", number});
    press("Tab");
  };
  type("picture width", "201");  // H.264 needs an even size
  placeOf("picture of 201 x " + std::to_string(pictureSize().height));
  type("movie rate", "10");
  placeOf("movie of pictures a second: 90 pictures, 9.0 s");
  type("movie pictures", "12");
  placeOf("movie of pictures a second: 12 pictures, 1.2 s");
  click("file name");
  answer("movie/m.mp4");
  EXPECT_TRUE(isSaved());
  // The command draws the same film in a shell, and the dialog offers it again.
  press("ctrl+shift+c");
  EXPECT_TRUE(eventually([] { return hasWidget("message copied the command for a film"); }));
  choose("File", "Save film: once around...");
  placeOf("picture of 201 x " + std::to_string(pictureSize().height));
  placeOf("movie of pictures a second: 12 pictures, 1.2 s");
  press("Escape");
  const auto command = close().at(0);
  EXPECT_EQ(valueOf(command, "--frames"), "12");
  EXPECT_EQ(valueOf(command, "--frame-rate"), "10");
  EXPECT_TRUE(valueOf(command, "--size").starts_with("200x"));
  const ProgramResult frames =
      RunningProgram({"ffprobe", "-v", "error", "-count_frames", "-show_entries",
                      "stream=width,r_frame_rate,nb_read_frames", "-of", "csv=p=0", "movie/m.mp4"},
                     "/usr/bin/env")
          .wait();
  EXPECT_EQ(frames.out.substr(0, frames.out.find('\n')), "200,10/1,12") << frames.err;
}

TEST_F(WindowMovie, AnEndingThatCannotBeWrittenIsSaid) {
  open();
  saveMovie("Save film: once around...", "movie/m.avi");
  EXPECT_TRUE(eventually([] { return hasWidget("message "); }));
  EXPECT_EQ(filesIn("movie"), 0u);
  save();
  close();
}

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
  /// A folder beside the program, in the build's folder.
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
  moveTo(rest_);  // no tooltip of the panels lies over the picture
  shows("5_another_scalar", 35);
  tab("View");
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
