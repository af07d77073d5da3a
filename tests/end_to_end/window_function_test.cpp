// The window's transfer function: ranges, colours, opacities of the same scalar or another one.
#include <array>
#include <fstream>
#include <regex>

#include "tests/end_to_end/window_fixture.h"

namespace curvisplat {
namespace {

class WindowFunction : public WindowTest {};

/// The scalar of the scene reaches from 0 to about 1, and is stored in 65,535 steps. The range that leaves out one per cent at each end
/// is that of `render --range 1%,99%`.
TEST_F(WindowFunction, RangesMayBeTooFineAndLeaveOutThePercentiles) {
  open();
  placeOf("range");
  EXPECT_FALSE(hasWidget("warning "));
  click(placeOf("range", 0.15));
  press("ctrl+a");
  act({"type", "0.49999"});
  press("Tab");
  press("ctrl+a");
  act({"type", "0.50001"});
  press("Return");
  EXPECT_TRUE(eventually([] { return hasWidget("warning the range 0.49999..0.50001 of f is finer than"); }));
  click("full range");
  EXPECT_TRUE(eventually([] { return !hasWidget("warning "); }));
  const Image whole = save();
  moveTo(placeOf("full range"));
  EXPECT_TRUE(eventually([] { return hasWidget("hint from the lowest to the highest value: 0"); }));
  click("percentile range");
  const Image most = saveAndCopy();
  EXPECT_LT(difference(whole, most), 50);
  const auto range = numbersOf(valueOf(close().at(0), "--range"));
  const auto percentiles =
      nlohmann::json::parse(run({"info", "--json", "a.splats"}).out).at("histograms")[0].at("percentiles");
  EXPECT_NEAR(range[0], percentiles[10].get<double>(), 1e-3);
  EXPECT_NEAR(range[1], percentiles[990].get<double>(), 1e-3);
}

TEST_F(WindowFunction, OpacitiesOfAnotherScalar) {
  open();
  const Image one = saveAndCopy();
  click("opacity by");
  click("opacity by volume");
  const Image two = saveAndCopy();
  EXPECT_LT(difference(one, two), 40);
  click("clear");
  EXPECT_LT(difference(save(), two), 40);
  click("automatic");  // the opacities of the other scalar
  EXPECT_TRUE(eventually([&] { return difference(save(), two) >= 50; }));
  click("opacity by");
  click("opacity by the same scalar");
  EXPECT_GE(difference(save(), one), 50);
  const auto commands = close();
  ASSERT_EQ(commands.size(), 2u);
  EXPECT_EQ(valueOf(commands[1], "--scalar"), "f");
  EXPECT_EQ(valueOf(commands[1], "--opacity-by"), "volume");
  expectDraws(commands[1], two);
  // The second bar takes of the width, and cuts nothing: the viewer has stepped back, and at the end forth again.
  EXPECT_GT(distanceOf(commands[1]), 1.03 * distanceOf(commands[0]));
}

/// Faces with the opacity "function": alone, so that nothing else changes.
TEST_F(WindowFunction, FacesHaveTheOpacitiesOfTheOtherScalar) {
  if (!faults::isWholeSweep())
    GTEST_SKIP() << "OpacitiesOfAnotherScalar chooses them, SurfaceOptions draws such faces";
  open({"--surface", "kmin", "--surface-by", "f", "--surface-opacity", "function", "--volume", "off"});
  const Image one = saveAndCopy();
  click("opacity by");
  click("opacity by volume");
  const Image two = saveAndCopy();
  EXPECT_LT(difference(one, two), 40);
  const auto commands = close();
  ASSERT_EQ(commands.size(), 2u);
  expectDraws(commands[0], one);
  expectDraws(commands[1], two);
}

/// Faces that are coloured by f have the picture's colours as long as it shows f, then their own and a bar for them.
TEST_F(WindowFunction, FacesKeepTheirScalar) {
  if (!faults::isWholeSweep())
    GTEST_SKIP() << "WindowSurfaces.IsosurfacesAreMovedAndKeepTheirScalar does so with isosurfaces";
  open({"--surface", "kmin", "--surface-by", "f"});
  const Image of_f = saveAndCopy();
  chooseScalar("volume");
  const Image of_volume = saveAndCopy();
  const auto commands = close();
  ASSERT_EQ(commands.size(), 2u);
  EXPECT_EQ(valueOf(commands[1], "--scalar"), "volume");
  expectDraws(commands[0], of_f);
  expectDraws(commands[1], of_volume);
}

TEST_F(WindowFunction, EditsColoursAndKeepsThemBesideThePicture) {
  open();
  const Image first = save();
  for (const char* next : {"colour points", "edit these colours"}) {
    click(next);
    save();
  }
  placeOf("colour 9");  // nine, each with its picker
  const Image edited = saveAndCopy();
  EXPECT_GT(difference(first, edited), 25);  // nearly the same colours, of fewer points
  const auto command = close().at(0);
  EXPECT_EQ(valueOf(command, "--tf"), "a_colours.json");
  expectDraws(command, edited);
}

TEST_F(WindowFunction, ARampKeepsTheLogarithmicScale) {
  open();
  chooseScalar("volume");  // above zero
  save();
  widget("scale ");
  click("log scale");
  widget("scale logarithmic");
  const Image before = save();
  click("ramp");
  moveTo(rest_);
  EXPECT_TRUE(eventually([&] { return difference(before, save()) < 50; }));
  EXPECT_TRUE(hasWidget("scale logarithmic"));
  close();
}

/// The button chooses range and opacities; the colours are chosen in their own list, from their swatches.
TEST_F(WindowFunction, AutomaticOpacitiesKeepTheChosenColours) {
  open();
  const Image first = save();
  click("colours");
  click("colours viridis");
  const Image viridis = saveAndCopy();
  EXPECT_LT(difference(first, viridis), 40);
  click("clear");
  EXPECT_LT(difference(viridis, save()), 50);
  click("automatic");
  EXPECT_TRUE(eventually([&] { return difference(save(), viridis) >= 50; }));
  click("colours");
  click("colours chosen from the data");
  EXPECT_TRUE(eventually([&] { return difference(save(), first) >= 50; }));
  const auto command = close().at(0);
  EXPECT_EQ(valueOf(command, "--tf"), "viridis");
  expectDraws(command, viridis);
}

/// A point in the curve's corner lies half outside of it, and can be taken there. The histogram of gradients says magnitudes and shares.
TEST_F(WindowFunction, CurveAndHistogramAnswerTheMouse) {
  open();
  save();
  click("clear");
  const Image nothing = save();
  const auto [x, y] = placeOf("curve", 1, 1);
  drag(1, {x + 3, y + 3}, placeOf("curve", 1, 0.2));
  EXPECT_LT(difference(nothing, save()), 45);
  click("gradient opacity");
  const auto under = [&](double across) {
    moveTo(placeOf("gradient histogram", across));
    const std::string before = hasWidget("gradient of ") ? widget("gradient of ") : "";
    EXPECT_TRUE(eventually([&] { return hasWidget("gradient of ") && widget("gradient of ") != before; }));
    const std::string text = widget("gradient of ");
    std::smatch parts;
    EXPECT_TRUE(std::regex_match(
        text, parts,
        std::regex("gradient of (\\S+) per length: (\\S+) % of the volume is less steep; opacity x (\\S+)")))
        << text;
    return parts.size() == 4 ? std::array{std::stod(parts[1]), std::stod(parts[2]), std::stod(parts[3])}
                             : std::array<double, 3>{};
  };
  const auto gentle = under(0.1), steep = under(0.98);
  EXPECT_GT(gentle[0], 0);
  EXPECT_GT(steep[0], 2 * gentle[0]);
  EXPECT_LT(gentle[1], 50);
  EXPECT_GT(steep[1], 80);
  EXPECT_EQ(gentle[2], 0);  // it rises from 50 to 80 %
  EXPECT_EQ(steep[2], 1);
  close();
}

/// A range of both signs gets zero in its middle. A name that its list's box cannot show is in the box's hint.
TEST_F(WindowFunction, ValuesOfBothSignsAndALongName) {
  const std::string name = "difference_of_the_pressure_from_its_mean_in_time";
  std::ofstream grid("signed.vtk");
  grid
      << "# vtk DataFile Version 3.0\nbox\nASCII\nDATASET STRUCTURED_POINTS\nDIMENSIONS 6 6 6\nORIGIN 0 0 0\n"
      << "SPACING 1 1 1\nPOINT_DATA 216\nSCALARS " << name << " float\nLOOKUP_TABLE default\n";
  for (int n = 0; n < 216; ++n) grid << 0.02 * n - 1 << '\n';
  grid.close();
  run({"convert", "signed.vtk", "-o", "signed.splats"});
  cache_ = "signed";
  open();
  moveTo(placeOf("opacity by"));
  save();
  EXPECT_FALSE(hasWidget("hint "));  // its text fits
  moveTo(placeOf("scalar"));
  widget("hint " + name);
  click("full range");
  moveTo(rest_);
  saveAndCopy();
  click("symmetric range");
  moveTo(rest_);
  saveAndCopy();
  const auto commands = close();
  ASSERT_EQ(commands.size(), 2u);
  EXPECT_EQ(valueOf(commands[0], "--range"), "-1,3.3");
  EXPECT_EQ(valueOf(commands[1], "--range"), "-3.3,3.3");
}

}  // namespace
}  // namespace curvisplat
