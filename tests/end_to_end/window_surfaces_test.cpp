// Surfaces in the window: faces of the grid, files, isosurfaces.
#include <cmath>
#include <string>
#include <utility>

#include "tests/end_to_end/window_fixture.h"

namespace curvisplat {
namespace {

class WindowSurfaces : public WindowTest {
 protected:
  static bool gone(const std::string& begin) {
    return eventually([&] { return !hasWidget(begin); });
  }
  /// Opens the window with its list of objects.
  void openObjects(const Words& options = {}, ImageSize size = kWindow) {
    open(options, size);
    tab("Objects");
  }
  void unfold(const std::string& section, const std::string& first) {
    click(section);
    placeOf(first);
  }
  void addFaces(const std::string& name) {
    click("add surface");
    click("add surface " + name);
  }
};

TEST_F(WindowSurfaces, FacesOfTheGridAreAddedColouredUndoneAndRemoved) {
  openObjects();
  const Image plain = save();
  unfold("Surfaces", "add surface");
  addFaces("kmin");
  placeOf("remove surface 1");
  const Image grey = saveAndCopy();
  EXPECT_LT(difference(plain, grey), 40);
  click(placeOf("opacity of surface 1", 0.3));
  const Image clear = saveAndCopy();
  EXPECT_LT(difference(grey, clear), 45);
  click("surfaces by");
  click("surfaces by volume");  // not the scalar that is drawn: with a bar of its own
  EXPECT_TRUE(gone("colour of surface 1"));
  const Image coloured = saveAndCopy();
  EXPECT_LT(difference(clear, coloured), 40);
  click("surface 1 by function");
  const Image by_function = saveAndCopy();
  EXPECT_LT(difference(coloured, by_function), 60);
  for (const Image* before : {&coloured, &clear, &grey, &plain}) {
    press("ctrl+z");
    EXPECT_GE(difference(save(), *before), 50);
  }
  EXPECT_TRUE(gone("remove surface 1"));
  for (int n = 0; n < 4; ++n) press("ctrl+y");
  EXPECT_GE(difference(save(), by_function), 50);
  click("remove surface 1");
  EXPECT_GE(difference(save(), plain), 50);
  const auto commands = close();
  ASSERT_EQ(commands.size(), 4u);
  EXPECT_EQ(valueOf(commands[0], "--surface"), "kmin");
  EXPECT_EQ(valueOf(commands[2], "--surface-by"), "volume");
  EXPECT_TRUE(valueOf(commands[3], "--surface-opacity").starts_with("function*"));
  expectDraws(commands[1], clear);
  expectDraws(commands[3], by_function);
}

/// The mouse over a face in a list tints it in the picture; the view, its command and its undo know nothing of it.
TEST_F(WindowSurfaces, FacesUnderTheMouseAreTinted) {
  openObjects({}, kScreen);
  choose("Picture", "Lighting");
  const Image lit = saveAndCopy();
  unfold("Surfaces", "add surface");
  const auto orange = [&] {
    const Image picture = shown(pictureSize());
    size_t pixels = 0;
    for (size_t n = 0; n < picture.rgba.size(); n += 4)
      pixels +=
          picture.rgba[n] > picture.rgba[n + 1] + 0.15f && picture.rgba[n + 1] > picture.rgba[n + 2] + 0.1f;
    return pixels;
  };
  const size_t before = orange();
  click("add surface");
  moveTo(placeOf("add surface kmin"));
  EXPECT_TRUE(eventually([&] { return orange() > before + 2000; }));
  press("Escape");
  moveTo(rest_);
  EXPECT_TRUE(eventually([&] { return orange() == before; }));
  EXPECT_GE(difference(saveAndCopy(), lit), 60);
  press("ctrl+z");  // the lighting, and nothing since
  EXPECT_LT(difference(save(), lit), 45);
  press("ctrl+y");
  addFaces("kmin");
  placeOf("remove surface 1");
  click("surfaces by");
  click("surfaces by volume");  // the tint is seen all the same
  moveTo(rest_);
  save();
  const size_t coloured = orange();
  moveTo(placeOf("opacity of surface 1"));
  EXPECT_TRUE(eventually([&] { return orange() > coloured + 2000; }));
  moveTo(rest_);
  EXPECT_TRUE(eventually([&] { return orange() == coloured; }));
  const auto commands = close();
  ASSERT_EQ(commands.size(), 2u);
  EXPECT_EQ(commands[0], commands[1]);
}

/// Surfaces are there again in the next window, without the volume that was switched off.
TEST_F(WindowSurfaces, AreRemembered) {
  openObjects();
  choose("Picture", "Add an isosurface");
  placeOf("remove isosurface 1");
  click("Isosurfaces");  // room for the others
  EXPECT_TRUE(gone("remove isosurface 1"));
  unfold("Surfaces", "add surface");
  addFaces("imax");
  placeOf("remove surface 1");
  const Image with_volume = save();
  click("eye of volume");
  const Image alone = saveAndCopy();
  EXPECT_LT(difference(with_volume, alone), 40);
  const auto commands = close();
  ASSERT_EQ(commands.size(), 1u);
  EXPECT_NE(valueOf(commands[0], "--iso"), "");
  EXPECT_EQ(valueOf(commands[0], "--volume"), "off");
  expectDraws(commands[0], alone);
  open();
  EXPECT_GE(difference(save(), alone), 50);
  close();
}

TEST_F(WindowSurfaces, IsosurfacesAreMovedAndKeepTheirScalar) {
  openObjects();
  const Image plain = save();
  unfold("Isosurfaces", "Add an isosurface");
  click("Add an isosurface");
  placeOf("isosurface 1");
  const Image middle = saveAndCopy();
  EXPECT_LT(difference(plain, middle), 45);
  click(placeOf("isosurface 1", 0.7));
  const Image higher = saveAndCopy();
  EXPECT_LT(difference(middle, higher), 45);
  press("ctrl+z");
  EXPECT_GE(difference(save(), middle), 50);
  press("ctrl+y");
  save();
  // It stays in another scalar's picture, in the colours of that one.
  tab("Colour");
  EXPECT_TRUE(eventually([] { return hasWidget("mark at "); }));  // in the curve
  chooseScalar("volume");
  EXPECT_TRUE(gone("mark at "));
  tab("Objects");
  moveTo(rest_);
  const Image kept = saveAndCopy();
  click("eye of volume");
  moveTo(rest_);
  const Image alone = saveAndCopy();
  EXPECT_LT(difference(kept, alone), 40);
  // A second one of the picture's own scalar is drawn with it.
  click("Add an isosurface");
  placeOf("isosurface 2");
  moveTo(rest_);
  const Image both = saveAndCopy();
  EXPECT_LT(difference(alone, both), 45);
  // Its scalar can be chosen.
  click("scalar of isosurface 1");
  click("isosurface 1 by volume");
  moveTo(rest_);
  const Image of_volume = saveAndCopy();
  EXPECT_LT(difference(both, of_volume), 45);
  const auto commands = close();
  ASSERT_EQ(commands.size(), 6u);
  EXPECT_NE(valueOf(commands[0], "--iso"), valueOf(commands[1], "--iso"));
  // It begins where half of what is seen is on either side, and not in the middle of the range.
  const std::string range = valueOf(commands[0], "--range");
  const double low = std::stod(range), high = std::stod(range.substr(range.find(',') + 1));
  EXPECT_GT(std::abs(std::stod(valueOf(commands[0], "--iso")) - 0.5 * (low + high)), 0.01 * (high - low));
  EXPECT_EQ(valueOf(commands[2], "--iso"), "f=" + valueOf(commands[1], "--iso"));
  EXPECT_EQ(valueOf(commands[5], "--iso").find('='), std::string::npos);
  const Image* const pictures[] = {&middle, &higher, &kept, &alone, &both, &of_volume};
  for (size_t n = 0; n < 6; ++n)
    if (n == 2 || n == 5 || faults::isWholeSweep()) expectDraws(commands[n], *pictures[n]);
}

/// An isosurface keeps its own colour when the function's change; the copied command has it, and it is undone.
TEST_F(WindowSurfaces, AnIsosurfaceHasAColourOfItsOwn) {
  openObjects({"--iso", "0.5", "--volume", "off"}, kScreen);
  tab("View");
  click("scalar bar");  // which shows the function's colours
  tab("Objects");
  const Image by_function = saveAndCopy();
  moveTo(placeOf("isosurface 1 by colours"));
  EXPECT_TRUE(eventually([] { return hasWidget("hint the colours that f has in the scalar bar"); }));
  click("isosurface 1 by colours");  // it keeps the colour that it has
  EXPECT_GE(difference(saveAndCopy(), by_function), 45);
  click("colour of isosurface 1");
  save();  // the list is open for the next click
  const Place swatch = placeOf("colour of isosurface 1", 0, 1);
  click(Place{swatch.first + 30, swatch.second + 30});  // light and pale, in the square below the swatch
  press("Escape");
  moveTo(rest_);
  const Image own = saveAndCopy();
  EXPECT_LT(difference(own, by_function), 45);
  tab("Colour");
  click("colours");
  click("colours viridis");
  moveTo(rest_);
  EXPECT_GE(difference(save(), own), 50);
  for (int n = 0; n < 3; ++n) press("ctrl+z");
  EXPECT_GE(difference(save(), by_function), 50);
  const auto commands = close();
  ASSERT_EQ(commands.size(), 3u);
  EXPECT_EQ(valueOf(commands[0], "--iso-colour"), "");
  EXPECT_NE(valueOf(commands[1], "--iso-colour"), "");
  EXPECT_NE(valueOf(commands[2], "--iso-colour"), valueOf(commands[1], "--iso-colour"));
  expectDraws(commands[2], own);
}

/// The volume keeps its opacities beside the isosurface of another scalar.
TEST_F(WindowSurfaces, AnIsosurfaceThatIsRemovedLeavesTheVolumeAsBefore) {
  openObjects();
  const Image before = save();
  moveTo(placeOf("eye of volume"));
  EXPECT_TRUE(eventually([] { return hasWidget("hint It can be hidden once something else is shown"); }));
  unfold("Isosurfaces", "Add an isosurface");
  click("Add an isosurface");
  placeOf("isosurface 1");
  click("scalar of isosurface 1");
  click("isosurface 1 by volume");
  moveTo(rest_);
  EXPECT_LT(difference(saveAndCopy(), before), 45);
  moveTo(placeOf("isosurface 1"));
  act({"click", "--repeat", "2", "--delay", "50", "1"});
  press("ctrl+a");
  save();
  act({"type", "99"});
  press("Return");
  EXPECT_TRUE(eventually([] { return hasWidget("nothing is drawn: values reach from "); }));
  click("remove isosurface 1");
  EXPECT_TRUE(gone("remove isosurface 1"));
  moveTo(rest_);
  EXPECT_GE(difference(saveAndCopy(), before), 50);
  const auto commands = close();
  ASSERT_EQ(commands.size(), 2u);
  EXPECT_TRUE(valueOf(commands[0], "--iso").starts_with("volume=")) << valueOf(commands[0], "--iso");
  EXPECT_EQ(valueOf(commands[1], "--iso"), "");
  for (const Words& command : commands) EXPECT_EQ(valueOf(command, "--opacity-by"), "");
}

/// Widgets with one label below two headings both work: of all that can be listed at once, none is another's twin.
TEST_F(WindowSurfaces, NoTwoWidgetsAreOne) {
  openObjects({"--surface", "kmin", "--iso", "0.5", "--slice", "-0.5,0,0.5,0.2,1,0.1"}, kScreen);
  const Image both = save();
  EXPECT_FALSE(hasWidget("twins:"));
  click("isosurfaces by function");
  const Image by_function = save();
  EXPECT_LT(difference(both, by_function), 60);
  click("slices by function");
  EXPECT_LT(difference(by_function, save()), 60);
  click("remove isosurface 1");
  EXPECT_TRUE(gone("remove isosurface 1"));
  EXPECT_TRUE(hasWidget("remove surface 1"));
  close();
}

/// A clip plane's coordinate can be typed, and stays where it is when the other side is kept.
TEST_F(WindowSurfaces, AClipPlaneIsAtACoordinate) {
  openObjects();
  const Image whole = save();
  choose("Picture", "Add a clip plane");
  click("x clip plane 1");
  EXPECT_TRUE(eventually([] { return hasWidget("clip plane 1: x of plane at "); }));
  act({"keydown", "ctrl"});
  click("clip plane 1");
  act({"keyup", "ctrl"});
  save();
  press("ctrl+a");
  act({"type", "--", "-0.25"});
  press("Return");
  const std::string there = "clip plane 1: x of plane at -0.25";
  EXPECT_TRUE(eventually([&] { return hasWidget(there); }));
  save();  // in the frame after Return, Ctrl+C is still the text's
  const Image cut = saveAndCopy();
  EXPECT_LT(difference(whole, cut), 45);
  click("flip clip plane 1");
  const Image other = saveAndCopy();
  EXPECT_LT(difference(cut, other), 45);
  EXPECT_TRUE(hasWidget(there));
  const auto commands = close();
  ASSERT_EQ(commands.size(), 2u);
  EXPECT_TRUE(valueOf(commands[0], "--clip-plane").starts_with("-0.25,")) << testing::PrintToString(commands);
  EXPECT_TRUE(valueOf(commands[1], "--clip-plane").starts_with("-0.25,")) << testing::PrintToString(commands);
  expectDraws(commands[0], cut);
  expectDraws(commands[1], other);
}

/// The window ends above the list.
TEST_F(WindowSurfaces, WhatTheMenuAddsIsScrolledTo) {
  open({"--iso", "0.1,0.2,0.3,0.4,0.5,0.6,0.7,0.8,0.9"});
  save();
  tab("Objects");
  ASSERT_GT(placeOf("Slices").second, kWindow.height);
  tab("Colour");
  choose("Picture", "Add a slice");
  EXPECT_TRUE(eventually([] {
    const auto place = placeNow("slice 1", 0.5, 1);
    return place && place->second < kWindow.height;
  }));
  close();
}

/// An object that is hidden stays in the list, and is not in the command.
TEST_F(WindowSurfaces, EyesHideWhatIsListed) {
  openObjects({"--surface", "kmin", "--iso", "0.5", "--slice", "-0.5,0,0.5,0.2,1,0.1"}, kScreen);
  placeOf("Isosurfaces (1)");
  const Image all = save();
  for (const char* object : {"surface 1", "isosurface 1", "slice 1"}) {
    click(std::string("eye of ") + object);
    moveTo(rest_);
  }
  const Image none = saveAndCopy();
  EXPECT_LT(difference(all, none), 40);
  EXPECT_TRUE(hasWidget("remove surface 1"));
  click("eye of surface 1");
  click("eye of volume");  // the scalar bar goes with it
  moveTo(rest_);
  const Image surface = saveAndCopy();
  const auto commands = close();
  ASSERT_EQ(commands.size(), 2u);
  for (const char* option : {"--surface", "--iso", "--slice"}) EXPECT_EQ(valueOf(commands[0], option), "");
  EXPECT_EQ(valueOf(commands[1], "--surface"), "kmin");
  expectDraws(commands[0], none);
  expectDraws(commands[1], surface);
}

TEST_F(WindowSurfaces, OfFilesAreAddedByTheDialog) {
  {
    std::ofstream mesh("sheet.obj");
    mesh << "v -2 0.5 -2\nv 2 0.5 -2\nv 2 0.5 2\nv -2 0.5 2\nf 1 2 3\nf 1 3 4\n";
    std::ofstream broken("broken.stl");
    broken << "solid but no triangle";
  }
  openObjects();
  const Image plain = save();
  choose("Picture", "Add a surface from a file...");
  placeOf("file name");
  act({"type", "broken.stl"});
  press("Return");
  EXPECT_TRUE(eventually([] { return hasWidget("file error "); }));
  EXPECT_FALSE(hasWidget("remove surface file 1"));
  answer("sheet.obj");
  placeOf("remove surface file 1");
  const Image with_sheet = saveAndCopy();
  EXPECT_LT(difference(plain, with_sheet), 40);
  const auto commands = close();
  ASSERT_EQ(commands.size(), 1u);
  EXPECT_EQ(valueOf(commands[0], "--surface"), "sheet.obj");
  expectDraws(commands[0], with_sheet);
}

}  // namespace
}  // namespace curvisplat
