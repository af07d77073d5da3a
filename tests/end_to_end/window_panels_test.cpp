// Panels and menus of the window: values and markers, planes in the picture, undo, saved views,
// messages, keys.
#include <array>
#include <cmath>
#include <fstream>
#include <iterator>
#include <regex>

#include "tests/end_to_end/window_fixture.h"

namespace curvisplat {
namespace {

namespace fs = std::filesystem;

class WindowPanels : public WindowTest {
 protected:
  void openMarkers() {
    tab("Objects");
    click("Markers");
  }
};

/// The window shows markers by signs of its own; what it saves has them, and the command draws them.
TEST_F(WindowPanels, TheValueUnderTheMouseIsThatOfTheDataAndMarkersKeepIt) {
  open();
  const Image without = save();
  moveTo(placeOf("picture"));
  const std::string status = widget("status f ");
  std::smatch parts;
  ASSERT_TRUE(std::regex_search(
      status, parts,
      std::regex("f (\\S+) at x (\\S+), y (\\S+), z (\\S+); node i (\\d+), j (\\d+), k (\\d+)")))
      << status;
  // Beside the data it says that there are none.
  moveTo(placeOf("picture", 0.02, 0.02));
  widget("status no data here");
  // `info --probe` finds the same sample there.
  const ProgramResult probed =
      runProgram({"info", "a.splats", "--probe",
                  fmt::format("{},{},{}", parts[2].str(), parts[3].str(), parts[4].str())});
  EXPECT_NE(probed.out.find(fmt::format("i {}, j {}, k {}", parts[5].str(), parts[6].str(), parts[7].str())),
            std::string::npos)
      << status << "\n"
      << probed.out << probed.err;
  // The distance between two markers is listed.
  std::vector<std::array<double, 3>> points;
  for (const double across : {0.42, 0.55}) {
    const std::string begin = fmt::format("message marker {}: f ", points.size() + 1);
    click(placeOf("picture", across, 0.5));
    const std::string message = widget(begin);
    ASSERT_TRUE(std::regex_search(message, parts, std::regex("at x (\\S+), y (\\S+), z (\\S+);"))) << message;
    points.push_back({std::stod(parts[1]), std::stod(parts[2]), std::stod(parts[3])});
  }
  openMarkers();
  const std::string distance = widget("distance 1 to 2: ");
  const double apart =
      std::hypot(points[1][0] - points[0][0], points[1][1] - points[0][1], points[1][2] - points[0][2]);
  EXPECT_GT(apart, 0.01);
  EXPECT_NEAR(std::stod(distance.substr(distance.find(": ") + 2)), apart, 1e-4) << distance;
  widget("sign of marker 1");
  moveTo(rest_);
  save();  // before it, the click's message
  const Image with = saveAndCopy();
  EXPECT_LT(difference(without, with), 45);
  const auto command = close().at(0);
  EXPECT_NE(valueOf(command, "--marker").find(":1: "), std::string::npos) << valueOf(command, "--marker");
  expectDraws(command, with);
}

TEST_F(WindowPanels, AClickKeepsAMarkerWhichIsRenamedUndoneAndRemoved) {
  open();
  save();
  moveTo(placeOf("picture"));
  widget("status f ");
  click(placeOf("picture"));
  widget("message marker 1: f ");
  widget("sign of marker 1");
  press("ctrl+z");
  EXPECT_TRUE(gone("sign of marker 1"));
  press("ctrl+shift+z");
  widget("sign of marker 1");
  openMarkers();
  click("marker 1");
  widget("editing marker 1");
  press("ctrl+a");
  save();  // Dear ImGui takes letters before keys of the same frame
  act({"type", "nose"});
  press("Return");
  EXPECT_TRUE(gone("editing marker 1"));  // with Control of the next key, Dear ImGui would drop the letters
  close();
  const auto state = fs::directory_iterator("config/curvisplat/views")->path();
  const std::string text = bytesOfFile(state);
  expectSays(text, "nose");
  open();
  widget("sign of marker 1");
  openMarkers();
  click("remove marker 1");
  EXPECT_TRUE(gone("sign of marker 1"));
  close();
}

TEST_F(WindowPanels, APlaneIsDraggedInThePicture) {
  open();
  press("x");
  const Image whole = save();
  choose("Picture", "Add a clip plane");
  save();
  press("z");  // from another side: the plane is seen edge on
  const Image cut = saveAndCopy();
  const Place handle = placeOf("handle 1");
  drag(1, handle, {handle.first + pictureSize().width / 10, handle.second});
  const Image moved = saveAndCopy();
  EXPECT_LT(difference(cut, moved), 40);
  EXPECT_LT(difference(whole, cut), 40);
  const auto commands = close();
  ASSERT_EQ(commands.size(), 2u);
  EXPECT_NE(valueOf(commands[0], "--clip-plane"), valueOf(commands[1], "--clip-plane"));
  // The camera stayed: the handle was dragged, not the picture.
  EXPECT_EQ(valueOf(commands[0], "--position"), valueOf(commands[1], "--position"));
  expectDraws(commands[1], moved);
}

/// The grip at the normal's tip turns a plane about its middle, towards where it is dragged; numbers can be typed.
TEST_F(WindowPanels, APlaneIsTurnedInThePictureAndByNumbers) {
  open({}, kScreen);
  press("x");
  choose("Picture", "Add a clip plane");  // facing the viewer
  const Image facing = saveAndCopy();
  const Place tip = placeOf("tip 1"), to{tip.first + pictureSize().width / 20, tip.second};
  moveTo(tip);
  act({"mousedown", "1"});
  placeOf("plane turned by 0°");
  moveTo({(tip.first + to.first) / 2, tip.second});
  moveTo(to);
  EXPECT_TRUE(eventually([] { return hasWidget("plane turned by ") && !hasWidget("plane turned by 0°"); }));
  act({"mouseup", "1"});
  moveTo(rest_);
  EXPECT_TRUE(eventually([] { return !hasWidget("plane turned by "); }));
  const Image turned = saveAndCopy();
  EXPECT_LT(difference(facing, turned), 40);
  click(placeOf("normal of clip plane 1", 0.15));  // its first field
  save();
  press("ctrl+a");
  act({"type", "0.1"});
  press("Return");
  save();
  const Image typed = saveAndCopy();
  EXPECT_LT(difference(turned, typed), 40);
  const auto commands = close();
  ASSERT_EQ(commands.size(), 3u);
  const auto before = numbersOf(valueOf(commands[0], "--clip-plane"));
  const auto after = numbersOf(valueOf(commands[1], "--clip-plane"));
  const auto last = numbersOf(valueOf(commands[2], "--clip-plane"));
  // From +x one sees y at the right: the tip went there, and not up.
  EXPECT_NEAR(std::abs(before[3]), 1, 1e-6);
  EXPECT_GT(after[4], 0.1);
  EXPECT_NEAR(after[5], 0, 0.05);
  EXPECT_NEAR(std::hypot(after[3], after[4], after[5]), 1, 1e-5);  // six digits each
  // Its middle stays in it.
  double from_plane = 0;
  for (size_t n = 0; n < 3; ++n) from_plane += (after[n] - before[n]) * after[n + 3];
  EXPECT_NEAR(from_plane, 0, 1e-6);
  const double length = std::hypot(0.1, after[4], after[5]);
  EXPECT_NEAR(last[3], 0.1 / length, 1e-4);
  EXPECT_NEAR(last[4], after[4] / length, 1e-4);
  EXPECT_EQ(valueOf(commands[0], "--position"), valueOf(commands[1], "--position"));
  expectDraws(commands[1], turned);
  expectDraws(commands[2], typed);
}

/// The name of an axis in the picture is pressed: the view is that of the key, and then that from the other side.
TEST_F(WindowPanels, AxesAreLookedAlongByAClick) {
  open({}, {900, 600});
  press("y");
  const Image by_key = save();
  const Place along = placeOf("axis y");
  press("i");  // isometric: every name has a place of its own
  save();
  const auto isThere = [&] { return placeOf("axis y") == along; };
  EXPECT_FALSE(isThere());
  click("axis y");
  EXPECT_TRUE(eventually(isThere));
  moveTo(rest_);
  EXPECT_GE(difference(save(), by_key), 50);
  click("axis y");
  moveTo(rest_);
  const Image behind = save();
  EXPECT_LT(difference(behind, by_key), 40);
  press("shift+y");
  EXPECT_GE(difference(save(), behind), 50);
  close();
}

/// The far edges lie behind the data in the window, in its saved picture and in the command's.
TEST_F(WindowPanels, OutlineAndGridLieBehindTheDataEverywhere) {
  open({}, kScreen);
  tab("View");
  const Image plain = save();
  click("outline");
  click("axes grid");
  moveTo({1, kScreen.height - 1});
  const Image saved = saveAndCopy();
  EXPECT_LT(difference(plain, saved), 40);
  EXPECT_GE(difference(shown(pictureSize()), saved), 45);
  expectDraws(close().at(0), saved);
}

TEST_F(WindowPanels, TheLightHasStrengthAndDirection) {
  open({}, kScreen);
  tab("View");
  click("light");
  const Image at_viewer = save();
  click("light at the viewer");
  click(placeOf("light azimuth", 0.75));
  const Image aside = saveAndCopy();
  EXPECT_LT(difference(at_viewer, aside), 45);
  click(placeOf("light strength", 0.2));
  const Image weak = saveAndCopy();
  EXPECT_LT(difference(aside, weak), 45);
  const auto commands = close();
  ASSERT_EQ(commands.size(), 2u);
  EXPECT_NE(valueOf(commands[0], "--light-direction"), "");
  EXPECT_EQ(valueOf(commands[0], "--light"), "");
  EXPECT_NE(valueOf(commands[1], "--light"), "");
  expectDraws(commands[0], aside);
  expectDraws(commands[1], weak);
}

/// The frame of a cut is hidden, and the cut is not. A grip of it stands out from any picture: it has a dark ring and a light one.
TEST_F(WindowPanels, WhatTheMenuAddsIsUnfoldedAndHasAFrameWithGrips) {
  open();
  save();  // it hears
  tab("Objects");
  widget("Clip planes");
  EXPECT_FALSE(hasWidget("remove clip plane"));
  tab("Colour");
  placeOf("curve");
  choose("Picture", "Add a clip plane");  // shows its tab
  EXPECT_EQ(widget("remove clip plane"), "remove clip plane 1");
  widget("Clip planes (1)");
  EXPECT_FALSE(hasWidget("remove slice"));
  placeOf("handle 1");
  const Image with_frame = save();
  click("Frames of cuts");
  EXPECT_TRUE(gone("handle 1"));
  EXPECT_GE(difference(save(), with_frame), 50);
  click("Frames of cuts");
  placeOf("handle 1");
  click("Clip planes");  // what the user folds stays folded
  EXPECT_TRUE(gone("remove clip plane"));
  press("x");
  save();
  for (const bool is_light : {false, true}) {
    if (is_light) press("b");
    save();
    const auto [left, top] = placeOf("handle 1", 0, 0);
    const auto [right, bottom] = placeOf("handle 1", 1, 1);
    const Image screen = display_->screenshot();
    // From the middle outwards, to the left of the line to the tip and of the frame.
    float darkest = 1, lightest = 0;
    for (int n = 0; n <= (right - left) / 2 + 3; ++n) {
      const float* const pixel =
          screen.pixel((left + right) / 2 - n * 7 / 10, (top + bottom) / 2 - n * 7 / 10);
      darkest = std::min(darkest, std::max({pixel[0], pixel[1], pixel[2]}));
      lightest = std::max(lightest, std::min({pixel[0], pixel[1], pixel[2]}));
    }
    EXPECT_LT(darkest, 0.3f) << is_light;
    EXPECT_GT(lightest, 0.7f) << is_light;
  }
  close();
}

/// All that can be listed is as wide as the panels at most.
TEST_F(WindowPanels, NothingIsCutOffAtThePanelsEdge) {
  open({"--surface", "kmin", "--iso", "0.5", "--slice", "-0.5,0,0.5,0.2,1,0.1"}, kScreen);
  save();
  const int end = placeOf("scalar", 1).first + 1, wide_end = placeOf("picture", 0).first;
  size_t compared = 0;
  const auto compare = [&] {
    for (const Widget& one : widgets()) {
      const bool below =
          one.name.starts_with("Save picture") || one.name.starts_with("Save film: once") ||
          one.name.starts_with("Copy command for this");  // the list, with no space for a scroll bar
      if (one.x >= end || one.name.starts_with("menu ")) continue;
      EXPECT_LE(one.x + one.width, below ? wide_end : end) << one.name;
      ++compared;
    }
  };
  // From below, so that those to come stay where they are. What the picture has is unfolded at first, and fills the panels.
  const std::pair<const char*, Words> tabs[] = {
      {"Colour", {"gradient opacity", "colour points", "opacity points"}},
      {"Objects", {"Slices", "Isosurfaces", "Surfaces", "Markers", "Clip box", "Clip planes"}},
      {"View", {"Statistics", "Detail and memory", "Film"}}};
  for (const auto& [name, sections] : tabs) {
    tab(name);
    save();
    compare();
    for (const std::string& section : sections) {
      click(section);
      save();
      compare();
    }
  }
  click("add key frame");
  placeOf("film time");
  compare();
  EXPECT_GT(compared, 150u);
  close();
}

TEST_F(WindowPanels, UndoAndRedo) {
  if (!faults::isWholeSweep()) GTEST_SKIP() << "tests of WindowSurfaces undo more";
  open();
  const Image first = save();
  press("b");
  const Image dark = save();
  EXPECT_LT(difference(first, dark), 20);
  dragPicture(1, 0.15, 0.05);
  const Image turned = save();
  press("ctrl+z");
  EXPECT_GE(difference(save(), dark), 50);
  press("ctrl+z");
  EXPECT_GE(difference(save(), first), 50);
  press("ctrl+y");
  press("ctrl+y");
  EXPECT_GE(difference(save(), turned), 50);
  close();
}

TEST_F(WindowPanels, SavesSeveralViews) {
  open();
  const Image first = save();
  moveTo(placeOf("opacity unit", -0.3));  // its label
  widget("hint the length over which the opacity accumulates");
  tab("View");
  click("view name");
  act({"type", "a/b view"});  // keys of the window are letters here
  press("Return");
  widget("view a/b view");
  press("b");
  choose("Picture", "Add a slice");
  const Image dark = save();
  EXPECT_LT(difference(first, dark), 20);
  choose("View", "Save this view");
  tab("View");
  widget("view view 2");
  click("view a/b view");
  EXPECT_GE(difference(save(), first), 50);
  close();
  open();
  save();
  tab("View");
  click("view view 2");
  EXPECT_GE(difference(save(), dark), 50);
  click("remove view view 2");  // what the view shows again brings up no other tab
  EXPECT_TRUE(gone("view view 2"));
  close();
}

/// Typing saves nothing and ends nothing, and Escape closes lists and menus.
TEST_F(WindowPanels, KeysAndMessagesAreShown) {
  open();
  save();
  widget("message saved ");
  EXPECT_TRUE(gone("message saved "));  // by itself
  press("F1");
  widget("window Keys and mouse");
  press("Escape");
  EXPECT_TRUE(gone("window Keys and mouse"));
  press("question");
  widget("window Keys and mouse");
  press("F1");
  EXPECT_TRUE(gone("window Keys and mouse"));
  const auto pictures = [] {
    return std::count_if(fs::directory_iterator("."), fs::directory_iterator(),
                         [](const fs::directory_entry& entry) { return entry.path().extension() == ".png"; });
  };
  const auto before = pictures();
  act({"type", "pcgsnop quit"});
  press("Escape");
  press("F1");
  widget("window Keys and mouse");  // the window lives, and has seen the keys
  EXPECT_EQ(pictures(), before);
  press("F1");
  EXPECT_TRUE(gone("window Keys and mouse"));
  click("scalar");
  widget("scalar volume");
  press("Escape");
  EXPECT_TRUE(gone("scalar volume"));
  click("menu File");
  widget("item Open...");
  press("Escape");
  EXPECT_TRUE(gone("item Open..."));
  // So does a click into the picture, which sets no marker.
  click("scalar");
  widget("scalar volume");
  click(placeOf("picture"));
  EXPECT_TRUE(gone("scalar volume"));
  save();
  click(placeOf("picture"));
  widget("sign of marker 1");
  EXPECT_FALSE(hasWidget("sign of marker 2"));
  choose("Window", "Messages");
  widget("window Messages");
  close();
}

TEST_F(WindowPanels, ThemeAndTextSizeAreRemembered) {
  open();
  save();
  const auto panelWidth = [] { return placeOf("picture", 0, 0).first; };
  const int before = panelWidth();
  choose("Window", "Light theme");
  press("ctrl+equal");
  EXPECT_TRUE(eventually([&] { return panelWidth() > before; }));
  // A panel's paper, below its last line of text.
  const auto paper = [&] { return display_->screenshot().pixel(panelWidth() - 40, kWindow.height - 4)[0]; };
  EXPECT_TRUE(eventually([&] { return paper() > 0.7f; }));
  close();
  open();
  EXPECT_TRUE(eventually([&] { return panelWidth() > before && paper() > 0.7f; }));
  close();
}

/// Braces in a title are no fields of --title. The button below the panels asks for name and size of a picture; the folder that was
/// typed is offered the next time.
TEST_F(WindowPanels, ATitleStandsInTheCommandAndTheDialogOffersItsLastFolder) {
  open();
  const Image without = save();
  tab("View");
  click("title");
  act({"type", "Flow {1}"});
  press("Return");
  save();
  const Image with = saveAndCopy();
  EXPECT_LT(difference(without, with), 60);
  fs::create_directory("pictures");
  click("Save picture as...");
  answer(fs::absolute("pictures/one.png").string());
  EXPECT_TRUE(eventually([] { return fs::exists("pictures/one.png"); }));
  click("Save picture as...");
  EXPECT_TRUE(eventually([] { return hasWidget("file one.png"); }));
  press("Escape");
  EXPECT_TRUE(eventually([] { return !hasWidget("file name"); }));
  const auto command = close().at(0);
  EXPECT_EQ(valueOf(command, "--title"), "Flow {{1}}");
  expectDraws(command, with);
}

}  // namespace
}  // namespace curvisplat
