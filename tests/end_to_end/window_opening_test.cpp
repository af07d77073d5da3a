// Grids that are opened without a conversion by hand: converted into the user's cache folder, by `view` and `render`.
#include <fmt/format.h>

#include <chrono>
#include <cmath>
#include <csignal>
#include <thread>

#include "render/colour/function_parts.h"
#include "stream/base/file.h"
#include "tests/end_to_end/window_fixture.h"

namespace curvisplat {
namespace {

namespace fs = std::filesystem;

TEST_F(KeptCaches, RenderDrawsAGridAsItsCache) {
  run(render("a.xyz", "a.fun"));
  ASSERT_EQ(kept().size(), 1u);
  EXPECT_EQ(kept()[0].filename(), "a.splats");
  const Image drawn = readImage("grid.png");
  run({"convert", "a.xyz", "a.fun", "-o", "whole.splats", "--overwrite"});
  run({"render", "whole.splats", "-o", "whole.png", "--size", "100x80"});
  EXPECT_EQ(readImage("whole.png").rgba, drawn.rgba);
}

TEST_F(KeptCaches, AreFoundAgainByContent) {
  run(render("a.xyz", "a.fun"));
  const auto made = fs::last_write_time(kept().at(0) / "manifest.json");
  run(render("a.xyz", "a.fun"));
  // The same bytes elsewhere, written later.
  fs::create_directory("elsewhere");
  for (const char* name : {"a.xyz", "a.fun"})
    fs::copy_file(name, fs::path("elsewhere") / name, fs::copy_options::overwrite_existing);
  run(render("elsewhere/a.xyz", "elsewhere/a.fun"));
  ASSERT_EQ(kept().size(), 1u);
  EXPECT_EQ(fs::last_write_time(kept()[0] / "manifest.json"), made);
  // Other bytes are another cache, at the same path.
  run({"generate", "half-annulus", "--size", "24x12x12", "-o", "elsewhere/a"});
  run(render("elsewhere/a.xyz", "elsewhere/a.fun"));
  EXPECT_EQ(kept().size(), 2u);
}

TEST_F(KeptCaches, TheLeastRecentlyUsedGoFirst) {
  for (const char* name : {"b", "c"})
    run({"generate", "half-annulus", "--size", *name == 'b' ? "24x12x12" : "20x12x12", "-o", name});
  run(render("a.xyz", "a.fun"));
  run(render("b.xyz", "b.fun"));
  run(render("a.xyz", "a.fun"));  // used again
  uint64_t bytes = 0;
  for (const fs::path& cache : kept())
    for (const auto& entry : fs::recursive_directory_iterator(cache)) bytes += entry.file_size();
  setenv("CURVISPLAT_CACHE_SIZE", std::to_string(bytes).c_str(), 1);
  run(render("c.xyz", "c.fun"));
  Words names;
  for (const fs::path& cache : kept()) names.push_back(cache.filename());
  std::sort(names.begin(), names.end());
  EXPECT_EQ(names, (Words{"a.splats", "c.splats"}));
}

/// A .p3d file names others: their bytes count.
TEST_F(KeptCaches, AreMadeAgainWhenANamedFileChanges) {
  run({"generate", "half-annulus", "--size", "20x12x12", "-o", "named"});
  std::ofstream("named.p3d") << R"({"filenames": [{"xyz": "named.xyz", "function": "named.fun"}]})";
  const auto draw = [] { run({"render", "named.p3d", "-o", "p.png", "--size", "60x50"}); };
  draw();
  draw();
  EXPECT_EQ(kept().size(), 1u);
  run({"generate", "half-annulus", "--size", "22x12x12", "-o", "named"});
  draw();
  EXPECT_EQ(kept().size(), 2u);
}

TEST_F(KeptCaches, RenderAddsAScalarThatTheFilesHave) {
  const ProgramResult result =
      run({"render", "a.xyz", "a.fun", "-o", "v.png", "--size", "60x50", "--scalar", "volume"});
  expectSays(result.out, "volume");
  const ProgramResult unknown =
      runProgram({"render", "a.xyz", "a.fun", "-o", "v.png", "--size", "60x50", "--scalar", "volum"});
  EXPECT_EQ(unknown.status, 1);
  expectSays(unknown.err, "did you mean volume?");
}

/// One adds it, the others wait; the pattern is not expanded by a shell.
TEST_F(KeptCaches, ProcessesThatNeedOneScalarAtOnceAllDraw) {
  run(render("a.xyz", "a.fun"));
  std::vector<std::unique_ptr<RunningProgram>> all;
  for (int n = 1; n <= 4; ++n)
    all.push_back(std::make_unique<RunningProgram>(
        Words{"render", "a.xyz", "a.fu*", "-o", "part_%d.png", "--size", "60x50", "--scalar", "volume",
              "--orbit", "90", "--frames", "4", "--part", fmt::format("{}/4", n)}));
  for (const auto& one : all) {
    const ProgramResult result = one->wait();
    EXPECT_EQ(result.status, 0) << result.err;
  }
  EXPECT_EQ(kept().size(), 1u);
}

TEST_F(KeptCaches, ErrorsNameTheFile) {
  std::ofstream("no.xyz") << "no grid";
  const ProgramResult result = runProgram(render("no.xyz", "a.fun"));
  EXPECT_EQ(result.status, 1);
  expectSays(result.err, "no.xyz");
  EXPECT_TRUE(kept().empty());
}

class WindowOpening : public KeptCaches {
 protected:
  void SetUp() override {
    WindowTest::SetUp();
    if (IsSkipped()) return;
    KeptCaches::SetUp();
  }
  static void generateOnce(const std::string& stem, const std::string& size) {
    if (!fs::exists(stem + ".xyz")) run({"generate", "half-annulus", "--size", size, "-o", stem});
  }
  void openWith(const Words& files) {
    fs::remove("widgets");
    window_ = std::make_unique<RunningProgram>(
        Words{"view"} + files + Words{"--size", fmt::format("{}x{}", kWindow.width, kWindow.height)});
    rest_ = {kWindow.width / 2, kWindow.height / 2};
    moveTo(rest_);
  }
  static std::string outputOf(const Words& words) {
    return RunningProgram(Words(words.begin() + 1, words.end()), words.front()).wait().out;
  }
  static std::string windowNumber() {
    const std::string out =
        outputOf({"/usr/bin/env", "xdotool", "search", "--onlyvisible", "--name", "curvisplat"});
    return out.substr(0, out.find('\n'));
  }
  static std::string titleOfWindow() {
    return outputOf({"/usr/bin/env", "xdotool", "getwindowname", windowNumber()});
  }
  /// Drops files as a file manager does.
  static void drop(const Words& files) {
    const Words words{"python3", CURVISPLAT_TEST_DATA "/../support/drop_files.py", windowNumber(), "560",
                      "300"};
    const ProgramResult result = RunningProgram(words + files, "/usr/bin/env").wait();
    EXPECT_EQ(result.status, 0) << result.err;
  }
  /// y and z of the position are the focal point's.
  static void expectFromX(const Words& command) {
    const std::string position = valueOf(command, "--position"), focus = valueOf(command, "--focal-point");
    EXPECT_EQ(position.substr(position.find(',')), focus.substr(focus.find(',')));
  }
  /// How many folders of previews there are.
  static size_t previewFolders() {
    size_t count = 0;
    std::error_code gone;
    for (const auto& place : fs::directory_iterator("kept/curvisplat"))
      for (fs::directory_iterator at(place, gone), end; !gone && at != end; at.increment(gone))
        for (const char* const name : {"preview.", "series."})
          count += at->path().filename().string().starts_with(name);
    return count;
  }
};

TEST_F(WindowOpening, ViewOpensAGrid) {
  openWith({"a.xyz", "a.fun"});
  placeOf("curve");  // the panels of the cache
  EXPECT_EQ(kept().size(), 1u);
  const Image picture = saveAndCopy();
  const auto command = close().at(0);
  expectDraws(command, picture);
}

/// A desktop drops files in any order, and a dialog sorts them by name. Several solutions of one grid have pictures of their own names.
TEST_F(WindowOpening, TheGridNeedNotComeFirstAndPicturesHaveTheNameOfTheSolution) {
  fs::copy_file("a.fun", "flow.fun", fs::copy_options::overwrite_existing);
  cache_ = "flow";
  openWith({"flow.fun", "a.xyz"});
  placeOf("curve");
  saveAndCopy();  // which waits for a picture of that name
  const auto command = close().at(0);
  cache_ = "a";
  EXPECT_EQ(Words(command.begin(), command.begin() + 3), (Words{"render", "flow.fun", "a.xyz"}));
}

TEST_F(WindowOpening, TheDialogTakesSeveralFiles) {
  openWith({});
  click("open");
  click("file a.fun");
  // Within one frame, as where frames are slow: Control is up before the window hears of the click.
  const Place place = placeOf("file a.xyz");
  window_->signal(SIGSTOP);
  moveTo(place);
  act({"keydown", "ctrl", "click", "1", "keyup", "ctrl"});
  window_->signal(SIGCONT);
  click("file accept");
  placeOf("curve");
  close();
}

/// A licence is not listed with the files.
TEST_F(WindowOpening, ShiftTakesTheFilesBetween) {
  fs::create_directory("between");
  run({"generate", "wake", "--size", "24x16x12", "--steps", "3", "-o", "between/t"});
  std::ofstream("between/LICENSE") << "text";
  std::ofstream("between/z.xyz") << "another grid";
  openWith({});
  click("open");
  placeOf("file name");
  act({"type", "between"});
  press("Return");
  click("file t.xyz");
  EXPECT_FALSE(hasWidget("file LICENSE"));
  moveTo(placeOf("file t_0002.fun"));
  act({"keydown", "shift", "click", "1", "keyup", "shift"});
  click("file accept");
  placeOf("curve");
  placeOf("step");
  close();
}

TEST_F(WindowOpening, WithoutAFileItAsksForOneAndRemembersIt) {
  openWith({});
  click("open");
  answer("a.xyz a.fun");
  placeOf("curve");
  close();
  openWith({});
  click("recent 1");
  placeOf("curve");
  close();
}

TEST_F(WindowOpening, OpeningWhatIsShownKeepsTheView) {
  open();
  const Image first = save();
  dragPicture(1, 0.2, 0.1);
  const Image turned = save();
  ASSERT_LT(difference(first, turned), 30);
  press("ctrl+o");
  answer("a.splats");
  // The view before is remembered once the other takes its place.
  EXPECT_TRUE(eventually([] { return fs::exists("config/curvisplat/views"); }));
  EXPECT_GT(difference(save(), turned), 50);
  close();
}

TEST_F(WindowOpening, AnswersWhileItConverts) {
  generateOnce("large", "256x160x160");
  openWith({"large.xyz", "large.fun"});
  placeOf("stop opening");
  press("F1");
  placeOf("window Keys and mouse");
  EXPECT_TRUE(hasWidget("stop opening"));  // it goes on
  press("F1");
  EXPECT_TRUE(eventually([] { return hasWidget("state preview"); }));
  click("stop opening");
  EXPECT_TRUE(eventually([] { return !hasWidget("stop opening"); }));
  close();
  EXPECT_TRUE(kept().empty());
}

/// A coarse sample is shown before a large grid is converted, and the whole takes its place. What was changed in the preview stays, and a
/// drag goes on, though the first movements that the whole's view gets come before it has drawn anything.
TEST_F(WindowOpening, ShowsAPreviewUntilTheWholeIsThere) {
  generateOnce("middle", "128x96x84");
  openWith({"middle.xyz", "middle.fun"});
  EXPECT_TRUE(eventually([] { return hasWidget("state preview of every 2nd index plane"); }));
  EXPECT_EQ(previewFolders(), 1u);
  press("o");  // first views are in perspective
  const Place middle = placeOf("picture");
  moveTo(middle);
  act({"mousedown", "1"});
  int moves = 0;
  const auto moveOn = [&] { moveTo({middle.first + 20 + ++moves % 9, middle.second + 10}); };
  EXPECT_TRUE(eventually(
      [&] {
        moveOn();  // and not again at once: each movement draws a picture, which the conversion waits for
        return eventually([] { return !hasWidget("opening"); }, 1);
      },
      300));
  for (int n = 0; n < 3; ++n) moveOn();
  act({"mouseup", "1"});
  EXPECT_TRUE(eventually([] { return !hasWidget("state preview") && hasWidget("state "); }, 300));
  EXPECT_TRUE(
      eventually([&] { return previewFolders() == 0; }));  // the view of it ends on a thread of its own
  ASSERT_EQ(kept().size(), 1u);
  EXPECT_EQ(kept()[0].filename(), "middle.splats");
  cache_ = "middle";
  const Image picture = saveAndCopy();
  const auto command = close().at(0);
  cache_ = "a";
  // The command names the grid, not a folder of the user's.
  EXPECT_EQ(Words(command.begin(), command.begin() + 3), (Words{"render", "middle.xyz", "middle.fun"}));
  const std::string position = valueOf(command, "--position");
  EXPECT_EQ(position.find("nan"), std::string::npos) << position;
  EXPECT_NE(std::find(command.begin(), command.end(), "--parallel-scale"), command.end());
  if (faults::isWholeSweep()) expectDraws(command, picture);  // ViewOpensAGrid draws that of a small grid
}

TEST_F(WindowOpening, APreviewThatIsStoppedSaysSo) {
  generateOnce("large", "256x160x160");
  openWith({"large.xyz", "large.fun"});
  EXPECT_TRUE(eventually([] { return hasWidget("state preview of every 4th index plane"); }));
  click("stop opening");
  EXPECT_TRUE(eventually([] { return hasWidget("message Stopped. What is shown is a preview"); }));
  EXPECT_TRUE(hasWidget("state preview"));
  close();
  EXPECT_TRUE(kept().empty());
}

/// The second preview is not the first one's, which is removed when the view changes.
TEST_F(WindowOpening, AGridThatWasStoppedIsOpenedAgain) {
  generateOnce("large", "256x160x160");
  openWith({"large.xyz", "large.fun"});
  EXPECT_TRUE(eventually([] { return hasWidget("state preview"); }));
  click("stop opening");
  EXPECT_TRUE(eventually([] { return hasWidget("message Stopped"); }));
  EXPECT_EQ(previewFolders(), 1u);
  drop({"large.xyz", "large.fun"});
  EXPECT_TRUE(eventually([] { return previewFolders() == 2; }));
  EXPECT_TRUE(eventually([] { return previewFolders() == 1; }));  // the view has changed
  click("stop opening");
  cache_ = "large";
  press("x");  // reads more of it
  save();
  EXPECT_FALSE(hasWidget("message large"));
  cache_ = "a";
  close();
  EXPECT_EQ(previewFolders(), 0u);
}

TEST_F(WindowOpening, AnErrorOfAPictureIsSaidAndTheWindowLives) {
  fs::copy("a.splats", "gone.splats", fs::copy_options::recursive);
  cache_ = "gone";
  open();
  save();
  fs::remove_all("gone.splats");
  chooseScalar("volume");  // whose files are opened now
  EXPECT_TRUE(eventually([] { return hasWidget("message "); }));
  press("x");  // asks again
  drop({"a.splats"});
  EXPECT_TRUE(eventually([] { return titleOfWindow().starts_with("a.splats"); }));
  cache_ = "a";
  save();
  close();
}

TEST_F(WindowOpening, AFileDroppedIsOpened) {
  openWith({});
  placeOf("open");
  drop({"a.xyz", "a.fun"});
  placeOf("curve");
  EXPECT_EQ(kept().size(), 1u);
  press("b");
  save();
  drop({"a.splats"});
  EXPECT_TRUE(eventually([] { return titleOfWindow().starts_with("a.splats"); }));
  saveAndCopy();
  EXPECT_EQ(valueOf(close().at(0), "--background"), "white");  // as before
}

TEST_F(WindowOpening, ASeriesIsOpened) {
  run({"generate", "wake", "--size", "24x16x12", "--steps", "3", "-o", "s"});
  openWith({"s.xyz", "s_0000.fun", "s_0001.fun", "s_0002.fun"});
  placeOf("step");
  close();
  ASSERT_EQ(kept().size(), 1u);
  run({"render", "s.xyz", "s_%04d.fun", "--steps", "all", "-o", "s_%d.png", "--size", "60x50"});
  EXPECT_TRUE(fs::exists("s_2.png"));
  EXPECT_EQ(kept().size(), 1u);  // the same one
}

/// Nothing stays of a series that was stopped once the window has left it.
TEST_F(WindowOpening, ASeriesThatIsStoppedLeavesNothing) {
  run({"generate", "wake", "--size", "96x64x48", "--steps", "8", "-o", "long"});
  Words files{"long.xyz"};
  for (int n = 0; n < 8; ++n) files.push_back(fmt::format("long_{:04}.fun", n));
  openWith(files);
  EXPECT_TRUE(eventually([] { return hasWidget("state preview of the first time step"); }));
  click("stop opening");
  EXPECT_TRUE(eventually([] { return !hasWidget("stop opening"); }));
  EXPECT_EQ(previewFolders(), 1u);
  close();
  EXPECT_EQ(previewFolders(), 0u);
  EXPECT_TRUE(kept().empty());
}

class FurtherScalarTest : public WindowOpening {
 protected:
  void SetUp() override {
    WindowOpening::SetUp();
    if (IsSkipped()) return;
    run({"convert", "a.xyz", "a.fun", "-o", "one.splats", "--scalar", "f", "--overwrite"});
    cache_ = "one";
  }
};

TEST_F(FurtherScalarTest, AScalarOfTheSourcesIsAddedWhenItIsChosen) {
  open();
  click("scalar");
  placeOf("scalar f");
  click("further scalar volume");
  saveAndCopy();
  ASSERT_TRUE(eventually([] { return hasWidget("scalar shown: volume"); }, 300));
  expectSays(runProgram({"info", "one.splats"}).out, "volume");
  saveAndCopy();
  press("ctrl+z");  // the scalar before
  saveAndCopy();
  const auto commands = close();
  ASSERT_EQ(commands.size(), 3u);
  EXPECT_EQ(valueOf(commands[1], "--scalar"), "volume");
  EXPECT_EQ(valueOf(commands[2], "--scalar"), "f");
}

TEST_F(FurtherScalarTest, OneIsAddedForItsOpacities) {
  open();
  click("opacity by");
  click("further opacity by volume");
  ASSERT_TRUE(eventually([] { return hasWidget("opacity shown: volume"); }, 300));
  ASSERT_TRUE(eventually([] { return !hasWidget("opening"); }, 300));
  save();
  const Image two = saveAndCopy();
  const auto commands = close();
  ASSERT_EQ(commands.size(), 1u);
  EXPECT_EQ(valueOf(commands[0], "--scalar"), "f");
  EXPECT_EQ(valueOf(commands[0], "--opacity-by"), "volume");
  expectDraws(commands[0], two);
}

TEST_F(FurtherScalarTest, OneIsAddedForAnIsosurface) {
  open();
  tab("Objects");
  click("Isosurfaces");
  click("Add an isosurface");
  placeOf("isosurface 1");
  save();
  click("scalar of isosurface 1");
  click("isosurface 1 by further volume");
  ASSERT_TRUE(eventually([] { return hasWidget("isosurface 1 shows: volume"); }, 300));
  ASSERT_TRUE(eventually([] { return !hasWidget("opening"); }, 300));
  moveTo(rest_);
  save();
  const Image drawn = saveAndCopy();
  const auto commands = close();
  ASSERT_EQ(commands.size(), 1u);
  EXPECT_EQ(valueOf(commands[0], "--scalar"), "f");
  EXPECT_TRUE(valueOf(commands[0], "--iso").starts_with("volume=")) << valueOf(commands[0], "--iso");
  expectDraws(commands[0], drawn);
}

TEST_F(FurtherScalarTest, OneIsAddedForTheColoursOfFaces) {
  open({"--surface", "kmin"});
  tab("Objects");
  click("surfaces by");
  click("surfaces by further volume");
  ASSERT_TRUE(eventually([] { return hasWidget("surfaces show: volume"); }, 300));
  ASSERT_TRUE(eventually([] { return !hasWidget("opening"); }, 300));
  moveTo(rest_);
  const Image drawn = saveAndCopy();
  const auto commands = close();
  ASSERT_EQ(commands.size(), 1u);
  EXPECT_EQ(valueOf(commands[0], "--scalar"), "f");
  EXPECT_EQ(valueOf(commands[0], "--surface-by"), "volume");
  expectDraws(commands[0], drawn);
}

/// The list of isosurfaces may change while the scalar is being added.
TEST_F(FurtherScalarTest, OneIsAddedForTheIsosurfaceItWasChosenFor) {
  open({"--iso", "0.3,0.6,0.8"});
  tab("Objects");
  placeOf("isosurface 3");
  save();
  click("scalar of isosurface 2");
  click("isosurface 2 by further volume");
  EXPECT_TRUE(eventually([] { return !hasWidget("isosurface 2 by further volume"); }));
  click("remove isosurface 1");
  ASSERT_TRUE(eventually([] { return hasWidget("isosurface 1 shows: volume"); }, 300));
  EXPECT_TRUE(eventually([] { return !hasWidget("isosurface 3 shows:"); }));
  EXPECT_TRUE(hasWidget("isosurface 2 shows: f"));
  moveTo(rest_);
  saveAndCopy();
  const auto commands = close();
  ASSERT_EQ(commands.size(), 1u);
  EXPECT_EQ(valueOf(commands[0], "--iso"), "0.8");  // of f, the picture's scalar, first
}

TEST_F(FurtherScalarTest, WithoutTheSourcesNoneIsOffered) {
  fs::rename("a.fun", "away.fun");
  open();
  click("scalar");
  placeOf("scalar f");
  EXPECT_FALSE(hasWidget("further scalar"));
  fs::rename("away.fun", "a.fun");
  close();
}

/// The scalar is in a cache of its own within the one that is shown.
TEST_F(WindowOpening, AScalarWithOwnBlanksIsShownWhenItIsChosen) {
  fs::copy(fs::path(CURVISPLAT_TEST_DATA) / "caches/version_2/own_blanks.splats", "sets.splats",
           fs::copy_options::recursive);
  cache_ = "sets";
  open();
  press("x");
  std::vector<Image> pictures{saveAndCopy()};
  for (const std::string name : {"s2", "s3"}) {
    chooseScalar(name);
    placeOf("scalar shown: " + name);
    press("ctrl+z");  // the states before are of scalars that this cache lacks
    pictures.push_back(saveAndCopy());
  }
  const auto commands = close();
  ASSERT_EQ(commands.size(), 3u);
  for (size_t n = 0; n < commands.size(); ++n) {
    EXPECT_EQ(valueOf(commands[n], "--scalar"), n == 0 ? "s1" : n == 1 ? "s2" : "s3");
    EXPECT_TRUE(commands[n].at(1).ends_with("sets.splats")) << commands[n][1];
    EXPECT_EQ(valueOf(commands[n], "--position"), valueOf(commands[0], "--position"));
    expectDraws(commands[n], pictures[n]);
  }
  // A state that shows such a scalar opens its cache.
  for (const auto& remembered : fs::directory_iterator("config/curvisplat/views"))
    if (readTextFile(remembered.path()).find("\"s3\"") != std::string::npos)
      fs::copy_file(remembered.path(), "s3.json", fs::copy_options::overwrite_existing);
  fs::remove_all("config");
  open({"--state", "s3.json"});
  saveAndCopy();
  const auto of_state = close();
  ASSERT_EQ(of_state.size(), 1u);
  EXPECT_EQ(valueOf(of_state[0], "--scalar"), "s3");
  EXPECT_TRUE(of_state[0].at(1).ends_with("sets.splats")) << of_state[0][1];
}

/// All steps get it: the series is converted again beside the window.
TEST_F(WindowOpening, AScalarIsAddedToASeries) {
  run({"generate", "wake", "--size", "24x16x12", "--steps", "3", "-o", "s"});
  run({"convert", "s.xyz", "s_%04d.fun", "-o", "street.splats", "--scalar", "f", "--overwrite"});
  const std::string further = "volume";
  cache_ = "street";
  open({"--step", "1"});
  click("scalar");
  click("further scalar " + further);
  ASSERT_TRUE(eventually([&] { return hasWidget("scalar shown: " + further); }, 300));
  ASSERT_TRUE(eventually([] { return !hasWidget("opening"); }, 300));
  expectSays(runProgram({"info", "street.splats"}).out, further);
  saveAndCopy();
  const auto commands = close();
  cache_ = "a";
  EXPECT_EQ(valueOf(commands.at(0), "--scalar"), further);
  EXPECT_EQ(valueOf(commands.at(0), "--step"), "1");  // as before
  run({"convert", "s.xyz", "s_%04d.fun", "-o", "both.splats", "--scalar", "f", "--scalar", further,
       "--overwrite"});
  for (const char* const step : {"0", "2"}) {
    for (const char* const of : {"street", "both"})
      run({"render", fmt::format("{}.splats", of), "-o", fmt::format("{}.png", of), "--size", "60x50",
           "--scalar", further, "--step", step});
    EXPECT_EQ(readImage("street.png").rgba, readImage("both.png").rgba);
  }
  for (const auto& entry : fs::directory_iterator("."))
    EXPECT_EQ(entry.path().filename().string().find(".adding"), std::string::npos);
}

/// A coarse sample of the first step, then the step, then all of them. Usually it is stopped at the first of these:
/// ASeriesThatIsStoppedLeavesNothing sees the next, and ASeriesIsOpened the last.
TEST_F(WindowOpening, ASeriesOfLargeStepsHasACoarsePreview) {
  run({"generate", "wake", "--size", "128x96x84", "--steps", "2", "-o", "wide"});
  openWith({"wide.xyz", "wide_0000.fun", "wide_0001.fun"});
  EXPECT_TRUE(
      eventually([] { return hasWidget("state preview of every 2nd index plane of the first time step"); }));
  if (!faults::isWholeSweep()) {
    click("stop opening");
    EXPECT_TRUE(eventually([] { return !hasWidget("stop opening"); }));
    close();
    EXPECT_EQ(previewFolders(), 0u);
    return;
  }
  press("x");
  EXPECT_TRUE(eventually([] { return hasWidget("state preview of the first time step"); }, 300));
  EXPECT_TRUE(eventually([] { return hasWidget("step") && !hasWidget("opening"); }, 300));
  cache_ = "wide";
  saveAndCopy();
  const auto command = close().at(0);
  cache_ = "a";
  expectFromX(command);
  EXPECT_EQ(previewFolders(), 1u);  // series.*, with the whole
}

/// A million cells and more: a lattice stands for them.
TEST_F(WindowOpening, AMeshHasAPreview) {
  const ProgramResult made =
      RunningProgram({CURVISPLAT_TEST_DATA "/../../bench/big_mesh.py", "cube.vtu", "--size", "101"},
                     "/usr/bin/python3")
          .wait();
  if (made.status != 0) GTEST_SKIP() << made.err;
  openWith({"cube.vtu"});
  EXPECT_TRUE(eventually([] { return hasWidget("state preview of 62 x 62 x 62 points"); }));
  click("stop opening");
  EXPECT_TRUE(eventually([] { return hasWidget("message Stopped"); }));
  cache_ = "cube";
  const Image picture = save();
  cache_ = "a";
  close();
  EXPECT_TRUE(kept().empty());
  fs::remove("cube.vtu");
  size_t drawn = 0;
  for (int y = 0; y < picture.size.height; ++y)
    for (int x = 0; x < picture.size.width; ++x)
      drawn += std::abs(picture.pixel(x, y)[1] - kDefaultBackground.g) > 0.05f;
  EXPECT_GT(drawn, picture.size.pixels() / 20);
}

TEST_F(WindowOpening, AFileThatCannotBeOpenedIsReportedAndTheWindowLives) {
  std::ofstream("no.xyz") << "no grid";
  openWith({"no.xyz", "a.fun"});
  EXPECT_TRUE(eventually([] { return hasWidget("message "); }));
  placeOf("open");
  close();
}

}  // namespace
}  // namespace curvisplat
