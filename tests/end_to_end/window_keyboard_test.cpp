// The window by the keyboard alone: Tab reaches what can be pressed, in its order and with a ring; Space and Return press it; keys
// of commands stay those of commands.
#include <algorithm>
#include <set>
#include <string>
#include <vector>

#include "tests/end_to_end/window_fixture.h"

namespace curvisplat {
namespace {

class WindowKeyboard : public WindowTest {
 protected:
  static std::string focus() {
    std::ifstream file("widgets");
    for (std::string line; std::getline(file, line);)
      if (const size_t at = line.find(" focus "); at != std::string::npos) return line.substr(at + 7);
    return {};
  }
  /// Presses Tab, with Shift to go back, and waits until another widget has the ring. Returns its name.
  std::string next(const std::string& key = "Tab") {
    const std::string before = focus();
    press(key);
    EXPECT_TRUE(eventually([&] { return !focus().empty() && focus() != before; })) << before;
    return focus();
  }
  void goTo(const std::string& name) {
    for (int n = 0; n < 100 && focus() != name; ++n) next();
    EXPECT_EQ(focus(), name);
  }
  /// All widgets that one round of Tab reaches, in its order.
  std::vector<std::string> round() {
    std::vector<std::string> names{next()};
    for (std::string name = next(); name != names.front() && names.size() < 150; name = next())
      names.push_back(name);
    return names;
  }
};

TEST_F(WindowKeyboard, TabReachesEveryTabOfThePanels) {
  open({"--surface", "kmin", "--iso", "0.5", "--slice", "-0.5,0,0.5,0.2,1,0.1"}, kScreen);
  save();
  const struct {
    const char* tab;
    std::vector<std::string> widgets;
  } tabs[] = {{"Colour",
               {"scalar", "colours", "range 1", "range 2", "log scale", "full range", "percentile range",
                "automatic", "ramp", "band", "high", "clear", "opacity unit", "opacity points",
                "colour points", "load", "save", "gradient opacity"}},
              {"Objects",
               {"eye of volume",
                "Frames of cuts",
                "Surfaces",
                "add surface",
                "eye of surface 1",
                "colour of surface 1",
                "remove surface 1",
                "opacity of surface 1",
                "Isosurfaces",
                "scalar of isosurface 1",
                "remove isosurface 1",
                "isosurface 1",
                "colour of isosurface 1",
                "isosurface 1 by colours",
                "Slices",
                "x slice 1",
                "normal 1",
                "slice 1",
                "Clip planes",
                "Markers"}},
              {"View",
               {"light", "dark", "scalar bar", "outline", "axes", "vertical scale",
                "Fit data into the picture", "From +x", "Isometric", "view angle", "view name", "Film"}}};
  for (const auto& [shown, widgets] : tabs) {
    tab(shown);
    ASSERT_TRUE(eventually([&, first = widgets.front()] { return hasWidget(first); })) << shown;
    const std::vector<std::string> names = round();
    EXPECT_EQ(std::set<std::string>(names.begin(), names.end()).size(), names.size());
    for (const char* const wanted :
         {"tab Colour", "tab Objects", "tab View", "Save picture as...", "menu File", "menu Help"})
      EXPECT_NE(std::ranges::find(names, wanted), names.end()) << shown << ' ' << wanted;
    size_t place = 0;
    for (const std::string& wanted : widgets) {
      const auto found = std::ranges::find(names, wanted);
      EXPECT_NE(found, names.end()) << shown << ": " << wanted << " in " << testing::PrintToString(names);
      if (found == names.end()) continue;
      const auto at = static_cast<size_t>(found - names.begin());
      EXPECT_GE(at, place) << wanted << " comes too early";
      place = at;
    }
    press("Escape");
    EXPECT_TRUE(eventually([] { return focus().empty(); }));
  }
  close();
}

TEST_F(WindowKeyboard, SpaceAndReturnPressWhatHasTheRing) {
  open();
  const Image first = saveAndCopy();
  goTo("clear");
  // The ring is seen: the widget's edge has its gold.
  const auto [x, y] = placeOf("clear", 0.5, 0);
  const auto is_gold = [&, column = x, top = y] {
    const Image screen = display_->screenshot();
    for (int row = top - 1; row <= top + 3; ++row) {
      const float* const pixel = screen.pixel(column, row);
      if (pixel[0] > 0.8f && pixel[1] > 0.6f && pixel[2] < 0.5f) return true;
    }
    return false;
  };
  EXPECT_TRUE(eventually(is_gold));
  press("space");
  const Image clear = save();
  EXPECT_LT(difference(first, clear), 40);
  next("shift+Tab");
  EXPECT_EQ(focus(), "high");
  for (int back = 0; back < 3; ++back) next("shift+Tab");
  EXPECT_EQ(focus(), "automatic");
  press("Return");
  EXPECT_TRUE(eventually([&] { return difference(save(), first) >= 50; }));
  // A slider takes a number.
  goTo("opacity unit");
  save();
  press("ctrl+a");
  act({"type", "0.05"});
  press("Return");
  save();
  const Image dense = saveAndCopy();
  EXPECT_LT(difference(first, dense), 45);
  // Letters are commands, Space is the widget's, and after Escape it is that of the command.
  goTo("log scale");
  press("b");
  EXPECT_LT(difference(dense, save()), 30);
  press("b");
  press("space");
  EXPECT_TRUE(eventually([] { return hasWidget("scale logarithmic") || hasWidget("message log scale"); }));
  const auto commands = close();
  ASSERT_EQ(commands.size(), 2u);
  EXPECT_NE(valueOf(commands[0], "--opacity-unit"), valueOf(commands[1], "--opacity-unit"));
  expectDraws(commands[1], dense);
}

/// A list opens, is gone through by arrows, and gives the ring back.
TEST_F(WindowKeyboard, ListsAreChosenFrom) {
  open();
  save();
  goTo("scalar");
  press("space");
  EXPECT_TRUE(eventually([] { return hasWidget("scalar volume"); }));
  EXPECT_EQ(next(), "scalar f");
  EXPECT_EQ(next("Down"), "scalar volume");
  press("Return");
  EXPECT_TRUE(eventually([] { return hasWidget("scalar shown: volume"); }));
  EXPECT_TRUE(eventually([] { return focus() == "scalar"; }));
  saveAndCopy();
  EXPECT_EQ(valueOf(close().at(0), "--scalar"), "volume");
}

/// Tab goes on from what the mouse has used; a click hides the ring, and Space plays again.
TEST_F(WindowKeyboard, TheMouseAndTheKeyboardTakeTurns) {
  open();
  save();
  click("ramp");
  save();
  EXPECT_TRUE(focus().empty());
  EXPECT_EQ(next(), "band");
  click("tab View");
  EXPECT_TRUE(eventually([] { return focus().empty(); }));
  close();
}

}  // namespace
}  // namespace curvisplat
