// Annotations that `render` draws over a picture, and the ways there are to draw them.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <memory>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string>
#include <vector>

#include "render/image/image.h"
#include "render/image/image_file.h"
#include "tests/support/program_test.h"

namespace curvisplat {
namespace {

class Annotations : public ProgramSuite<Annotations> {
 protected:
  static void prepare() { madeCache(file("a"), "half-annulus", "24x12x12"); }

  static Image render(const Words& options, const std::string& output = "a.exr") {
    return pictureOf(file("a.splats"), file(output), options, "200x160");
  }

  /// Pixels of [x0, x1) x [y0, y1) that differ between `a` and `b`.
  static int changed(const Image& a, const Image& b, int x0, int x1, int y0, int y1) {
    int count = 0;
    for (int y = y0; y < y1; ++y)
      for (int x = x0; x < x1; ++x) count += !std::equal(a.pixel(x, y), a.pixel(x, y) + 3, b.pixel(x, y));
    return count;
  }
};

TEST_F(Annotations, EachIsDrawnInItsPlace) {
  const Image plain = render({});
  const Image axes = render({"--axes"});
  EXPECT_GT(changed(plain, axes, 0, 80, 90, 160), 50);
  EXPECT_EQ(changed(plain, axes, 80, 200, 0, 160), 0);
  EXPECT_EQ(changed(plain, axes, 0, 80, 0, 80), 0);
  const Image outline = render({"--outline"});
  EXPECT_GT(changed(plain, outline, 0, 200, 0, 160), 300);
}

/// A picture whose colours nobody has chosen says what they mean; options that draw it again say so, too.
TEST_F(Annotations, ScalarBarsComeWithColoursThatAreChosen) {
  std::string out;
  const auto picture = [&](const Words& options, const std::string& size = "400x300") {
    out = run(Words{"render", file("a.splats"), "-o", file("bar.png"), "--size", size} + options).out;
    return readImage(file("bar.png")).rgba;
  };
  const auto plain = picture({"--no-scalar-bar"}), with_bar = picture({});
  EXPECT_NE(with_bar, plain);
  const std::string chosen = "chosen from the data: ";
  std::istringstream words(out.substr(out.find(chosen) + chosen.size()));
  Words again;
  for (std::string word; words >> word;) again.push_back(word);
  ASSERT_EQ(again.back(), "--scalar-bar") << out;
  EXPECT_EQ(picture(again), with_bar) << out;
  EXPECT_EQ(picture({"--scalar-bar"}), with_bar);
  const Words grey{"--surface", "kmin", "--volume", "off"};  // nothing has the colours
  EXPECT_EQ(picture(grey + Words{"--scalar-bar"}), picture(grey + Words{"--no-scalar-bar"}));
  EXPECT_EQ(picture({}, "399x299"), picture({"--no-scalar-bar"}, "399x299"));
  EXPECT_EQ(picture({"--tf", "viridis"}), picture({"--tf", "viridis", "--no-scalar-bar"}));
}

/// A filled box shows nine edges in parallel projection; each direction has four of one length.
TEST_F(Annotations, OpaqueDataHidesTheOutlinesFarEdges) {
  std::ofstream grid(file("box.vtk"));
  grid << "# vtk DataFile Version 3.0\nbox\nASCII\nDATASET STRUCTURED_GRID\nDIMENSIONS 12 9 7\nPOINTS 756 "
          "float\n";
  for (int n = 0; n < 756; ++n) grid << n % 12 << ' ' << n / 12 % 9 << ' ' << n / 108 << '\n';
  grid << "POINT_DATA 756\nSCALARS f float\nLOOKUP_TABLE default\n";
  for (int n = 0; n < 756; ++n) grid << n % 12 << '\n';
  grid.close();
  run({"convert", file("box.vtk"), "-o", file("box.splats"), "--refine", "1"});
  // The data are black, and the lines light.
  const auto inked = [&](const Words& opacity) {
    const Words look{"--tf",
                     "grey",
                     "--range",
                     "20,30",
                     "--background",
                     "#0000ff",
                     "--position",
                     "30,-18,14",
                     "--focal-point",
                     "5.5,4,3",
                     "--view-up",
                     "0,0,1",
                     "--parallel-scale",
                     "9"};
    const auto picture = [&](const Words& more) {
      return pictureOf(file("box.splats"), file("box.exr"), look + opacity + more, "400x320");
    };
    const Image plain = picture({}), outline = picture({"--outline"});
    int count = 0;
    for (size_t n = 0; n < plain.rgba.size(); n += 4)
      count += std::abs(plain.rgba[n] - outline.rgba[n]) > 0.1f;
    return count;
  };
  const int all = inked({"--opacity", "0:0.0001,1:0.0001", "--opacity-unit", "1000"});
  const int seen = inked({"--opacity", "0:1,1:1", "--opacity-unit", "0.01"});
  EXPECT_GT(all, 500);
  EXPECT_NEAR(static_cast<double>(seen) / all, 0.75, 0.08);
}

TEST_F(Annotations, TheScalarBarStandsBesideTheData) {
  // All of the picture is data, but for the bar's strip, which the outline and the axes do not enter either.
  const std::vector<std::string> close{
      "--parallel-scale", "0.1",       "--position",   "3,0,0.5", "--focal-point", "-0.4,-0.2,0.5",
      "--axes",           "--outline", "--lod-pixels", "8",       "--background",  "white"};
  std::vector<std::string> options = close;
  options.push_back("--scalar-bar");
  const Image with = render(options);
  const auto isBackground = [&](int x) {
    for (const int y : {0, 40, 80, 159})
      if (with.pixel(x, y)[0] != 1 || with.pixel(x, y)[1] != 1 || with.pixel(x, y)[2] != 1) return false;
    return true;
  };
  int data = 0;
  while (data < 200 && !isBackground(data)) ++data;
  EXPECT_GT(data, 120);
  EXPECT_LT(data, 160);
  options = close;
  options.insert(options.end(), {"--size", fmt::format("{}x160", data)});
  const Image without = render(options, "b.exr");
  EXPECT_EQ(changed(without, with, 0, data, 0, 160), 0);
  // `render` fits all of the data into what the bar leaves.
  const Image whole = render({"--scalar-bar", "--background", "#0000ff"});
  for (int y = 0; y < 160; ++y) EXPECT_EQ(whole.pixel(data - 1, y)[2], 1) << y;
}

TEST_F(Annotations, TheAxesGridLiesBehindTheDataAndHasCoordinatesAroundIt) {
  const std::vector<std::string> view{"--size", "400x320", "--view", "iso", "--background", "black"};
  const auto with = [&](std::vector<std::string> more) {
    more.insert(more.end(), view.begin(), view.end());
    return render(more, "a.pfm");
  };
  // The same view: room for coordinates is in the grid's.
  const std::vector<std::string> camera{"--parallel-scale", "2.2"};
  const auto zoomed = [&](std::vector<std::string> more) {
    more.insert(more.end(), camera.begin(), camera.end());
    return with(more);
  };
  const std::vector<std::string> opaque{"--tf",      "grey",    "--range",        "0,1",
                                        "--opacity", "0:1,1:1", "--opacity-unit", "0.001"};
  const auto solid = [&](std::vector<std::string> more) {
    more.insert(more.end(), opaque.begin(), opaque.end());
    return zoomed(more);
  };
  const Image plain = solid({}), grid = solid({"--axes-grid"});
  EXPECT_GT(changed(plain, grid, 0, 400, 0, 320), 1500);
  // Where the data is opaque, no line of the grid.
  int inside = 0, over = 0;
  for (int y = 120; y < 200; ++y)
    for (int x = 150; x < 250; ++x) {
      if (plain.pixel(x, y)[0] < 0.2f) continue;
      ++inside;
      over += std::abs(plain.pixel(x, y)[0] - grid.pixel(x, y)[0]) > 0.05f;
    }
  EXPECT_GT(inside, 500);
  EXPECT_LT(over, inside / 20);
  const Image titled = solid({"--axes-titles", "east [km],north [km],depth [m]"});
  EXPECT_GT(changed(grid, titled, 0, 400, 0, 320), 50);
  // Without a zoom the coordinates have room: nothing at the picture's edges.
  const Image whole = with({"--axes-grid"});
  for (int x = 0; x < 400; ++x)
    for (const int y : {0, 319}) EXPECT_LT(whole.pixel(x, y)[0], 0.5f) << x << ' ' << y;
  const ProgramResult wrong =
      runProgram({"render", file("a.splats"), "-o", file("b.png"), "--axes-titles", "x,y"});
  EXPECT_EQ(wrong.status, 2);
  expectSays(wrong.err, "--axes-titles x,y: expected three titles, X,Y,Z");
}

TEST_F(Annotations, EachFunctionHasABarWithATitleOfItsOwn) {
  const Image one = render({"--scalar-bar"}),
              other = render({"--scalar-bar-title", "height above the plate"});
  EXPECT_GT(changed(one, other, 140, 200, 0, 160), 20);
  EXPECT_GT(changed(one, render({"--scalar-bar-title", ""}), 140, 200, 0, 160), 10);  // the letter f
  const ProgramResult wrong = runProgram({"render", file("a.splats"), "-o", file("b.png"),
                                          "--scalar-bar-title", "a", "--scalar-bar-title", "b"});
  EXPECT_EQ(wrong.status, 2);
  expectSays(wrong.err, "--scalar-bar-title: given 2 times; the picture shows 1 function");
}

/// The font is the one that follows the height, 9 pixels in a small picture, or as it is asked for.
TEST_F(Annotations, TextHasTheSizeThatIsAskedFor) {
  const Image usual = render({"--scalar-bar"}), same = render({"--scalar-bar", "--text-size", "9"});
  EXPECT_EQ(changed(usual, same, 0, 200, 0, 160), 0);
  // The bar's colours are twice as wide.
  const auto barWidth = [](const Image& picture) {
    const auto isColour = [&](int x) {
      const float* const pixel = picture.pixel(x, picture.size.height / 2);
      return std::abs(pixel[0] - pixel[2]) > 0.1f || std::abs(pixel[0] - pixel[1]) > 0.1f;
    };
    int first = picture.size.width - 1;
    while (first > 0 && !isColour(first)) --first;
    int width = 0;
    while (first >= 0 && isColour(first)) --first, ++width;
    return width;
  };
  const Image large = render({"--scalar-bar", "--text-size", "18"});
  EXPECT_NEAR(barWidth(usual), 1.3 * 9, 1);
  EXPECT_NEAR(barWidth(large), 1.3 * 18, 1);
  EXPECT_NEAR(barWidth(render({"--scalar-bar", "--size", "640x840"})), 1.3 * 840 / 42, 1);
  EXPECT_NEAR(barWidth(render({"--scalar-bar", "--size", "315x840"})), 1.3 * 315 / 31.5, 1);
  const ProgramResult wrong =
      runProgram({"render", file("a.splats"), "-o", file("b.png"), "--axes", "--text-size", "2"});
  EXPECT_EQ(wrong.status, 2);
  expectSays(wrong.err, "--text-size 2: expected pixels from 4 to 1000");
  for (const char* size : {"40", "41"}) {
    const ProgramResult huge = run({"render", file("a.splats"), "-o", file("b.png"), "--size", "200x160",
                                    "--scalar-bar", "--text-size", size});
    EXPECT_EQ(huge.err.find("may not fit into 200x160 pixels") != std::string::npos,
              size == std::string("41"));
  }
}

TEST_F(Annotations, TextsSayWhatIsShown) {
  const auto onWhite = [](const Words& options) { return render(Words{"--background", "white"} + options); };
  const Image plain = onWhite({});
  const Image title = onWhite({"--title", "a {scalar} at {{t}}"}),
              label = onWhite({"--label", "t = {time:.2f} s"});
  EXPECT_GT(changed(plain, title, 0, 200, 0, 20), 60);
  EXPECT_EQ(changed(plain, title, 0, 200, 24, 160), 0);
  EXPECT_GT(changed(plain, label, 0, 100, 0, 20), 60);
  EXPECT_EQ(changed(plain, label, 100, 200, 0, 160), 0);
  // Fields are those of the picture: the same pixels as text that says so.
  EXPECT_EQ(render({"--label", "{scalar}|{units}|{time}|{step}|{frame:03d}"}).rgba,
            render({"--label", "f||0|0|000"}).rgba);
  // Without a unit nothing is left of what stands around it.
  for (const char* text :
       {"{scalar} in {units}, t", "{scalar} [{units}], t", "{scalar} ({units}), t", "{scalar} {units}, t"})
    EXPECT_EQ(render({"--label", text}).rgba, render({"--label", "f, t"}).rgba) << text;
  EXPECT_EQ(render({"--label", "in {units}bin {units}(a"}).rgba, render({"--label", "bin(a"}).rgba);
  // Too long a title is made smaller, and keeps both ends.
  const Image longest = onWhite({"--title", "|" + std::string(40, 'm') + "|"});
  EXPECT_EQ(changed(plain, longest, 0, 200, 24, 160), 0);
  EXPECT_GT(changed(plain, longest, 3, 40, 0, 20), 0);
  EXPECT_GT(changed(plain, longest, 160, 197, 0, 20), 0);
  EXPECT_EQ(changed(plain, longest, 197, 200, 0, 20), 0);
  EXPECT_EQ(changed(plain, longest, 0, 3, 0, 20), 0);
  const auto refused = [](const char* option, const char* text, const char* words) {
    const ProgramResult result = runProgram({"render", file("a.splats"), "-o", file("b.png"), option, text});
    EXPECT_EQ(result.status, 2) << text;
    expectSays(result.err, words);
  };
  refused("--label", "{tmie}",
          "--label {tmie}: unknown field {tmie} (did you mean time?); expected time, step, frame, scalar");
  refused("--title", "{time:s}", "'s' is not a format of time; expected one such as .2f");
  refused("--title", "{step:.2f}", "'.2f' is not a format of step; expected one such as 04d");
  refused("--title", "{frame:99999999}", "is not a format of frame");
  refused("--title", "{scalar:d}", "scalar is no number and has no format");
  refused("--label", "t = {time", "has a { without its }");
}

/// A unit of the data is 40 of the 160 rows: the point (1, 0.5, 0) lies 40 pixels right of the middle and 20 above it.
TEST_F(Annotations, AMarkerStandsAtItsPointWithItsTextBesideIt) {
  const auto seen = [](const Words& options) {
    return render(Words{"--position", "0,0,10", "--focal-point", "0,0,0", "--view-up", "0,1,0",
                        "--parallel-scale", "2"} +
                  options);
  };
  const Image plain = seen({}), dot = seen({"--marker", "1,0.5,0"}),
              text = seen({"--marker", "1,0.5,0:a: b"});
  constexpr int kX = 140, kY = 60, kReach = 4;
  for (int channel = 0; channel < 3; ++channel) EXPECT_GT(dot.pixel(kX, kY)[channel], 0.9f);
  EXPECT_GT(changed(plain, dot, kX - kReach, kX + kReach, kY - kReach, kY + kReach), 12);
  EXPECT_EQ(changed(plain, dot, 0, 200, 0, 160),
            changed(plain, dot, kX - kReach, kX + kReach, kY - kReach, kY + kReach));
  EXPECT_GT(changed(dot, text, kX + kReach, 200, kY - 8, kY + 8), 60);
  EXPECT_EQ(changed(dot, text, 0, kX, 0, 160), 0);
  EXPECT_EQ(changed(dot, text, 0, 200, 0, kY - 8) + changed(dot, text, 0, 200, kY + 8, 160), 0);
  // A text that would reach beyond the right border stands at the left.
  const Image longer = seen({"--marker", "1,0.5,0:stagnation point"});
  EXPECT_GT(changed(dot, longer, 0, kX, kY - 8, kY + 8), 60);
  EXPECT_EQ(changed(dot, longer, kX + kReach, 200, 0, 160), 0);
  EXPECT_EQ(changed(plain, seen({"--marker", "1,0.5,0", "--marker", "-1,-0.5,0"}), 96, 104, 96, 104), 0);
  EXPECT_GT(changed(plain, seen({"--marker", "1,0.5,0", "--marker", "-1,-0.5,0"}), 56, 64, 96, 104), 12);
  // Stretched, the data's point lies further up.
  EXPECT_GT(changed(seen({"--scale", "1,2,1"}), seen({"--scale", "1,2,1", "--marker", "1,0.5,0"}),
                    kX - kReach, kX + kReach, 40 - kReach, 40 + kReach),
            12);
  const ProgramResult wrong =
      runProgram({"render", file("a.splats"), "-o", file("b.png"), "--marker", "1,2:a"});
  EXPECT_EQ(wrong.status, 2);
  expectSays(wrong.err, "--marker 1,2: expected x,y,z, found 2 numbers");
}

/// Each frame of a film says its own step and time, though the next one's is read while it is written.
TEST_F(Annotations, TextsFollowTheFrames) {
  run({"generate", "wake", "--size", "16x12x8", "--steps", "3", "-o", file("w")});
  run({"convert", file("w.xyz"), file("w_*.fun"), "-o", file("w.splats")});
  const auto draw = [](const Words& more) {
    run(sized(
        Words{"render", file("w.splats"), "--view", "iso", "--range", "0,1", "--opacity-unit", "0.1"} + more,
        "120x90"));
  };
  draw({"-o", file("w%d.exr"), "--steps", "all", "--label", "{step} {time} {frame}"});
  for (int n = 0; n < 3; ++n) {
    const std::string step = fmt::format("{}", n);
    draw({"-o", file("still.exr"), "--step", step, "--label", fmt::format("{0} {{time}} {0}", n)});
    EXPECT_EQ(readImage(file(fmt::format("w{}.exr", n))).rgba, readImage(file("still.exr")).rgba) << n;
  }
  EXPECT_NE(readImage(file("w0.exr")).rgba, readImage(file("w1.exr")).rgba);
}

/// Coordinates and titles of the axes that have no room are moved into the picture, and made smaller.
TEST_F(Annotations, TitlesAreNotCutOff) {
  const std::string title(60, 'w');
  const auto edges = [](const Image& image) {
    int dark = 0;
    for (int x = 0; x < image.size.width; ++x)
      for (const int y : {0, image.size.height - 1}) dark += image.pixel(x, y)[1] < 0.9f;
    for (int y = 0; y < image.size.height; ++y)
      for (const int x : {0, image.size.width - 1}) dark += image.pixel(x, y)[1] < 0.9f;
    return dark;
  };
  const Words view{"--view", "iso", "--background", "white", "--opacity", "0:0,1:0.001"};
  EXPECT_EQ(edges(render(view + Words{"--axes-titles", title + "," + title + "," + title})), 0);
  EXPECT_EQ(edges(render(view + Words{"--scalar-bar-title", title})), 0);
}

TEST_F(Annotations, AScalarBarIsDrawnAtFourTimesTheSizeOfAScreenInTheDefaultMemory) {
  const ProgramResult result =
      runProgram({"render", file("a.splats"), "-o", file("large.png"), "--size", "3840x2160", "--scalar-bar",
                  "--axes-grid", "--title", "large", "--view", "iso"});
  EXPECT_EQ(result.status, 0) << result.err;
}

TEST_F(Annotations, TheScalarBarHasTheFunctionsColoursTheHighestOnTop) {
  const Image grey = render({"--scalar-bar", "--tf", "grey", "--background", "#ff0000"});
  // Down the first column that is all grey and not the frame.
  std::vector<float> shades;
  for (int x = 120; x < 200; ++x) {
    shades.clear();
    for (int y = 40; y < 120; ++y) {
      const float* const p = grey.pixel(x, y);
      if (p[0] == p[1] && p[1] == p[2]) shades.push_back(p[0]);
    }
    if (shades.size() >= 60 && shades.front() != shades.back()) break;
  }
  ASSERT_GE(shades.size(), 60u);
  for (size_t n = 1; n < shades.size(); ++n) EXPECT_LE(shades[n], shades[n - 1]);
  EXPECT_GT(shades.front() - shades.back(), 0.5f);
}

TEST_F(Annotations, InkStandsOutFromTheBackground) {
  const auto darkest = [](const Image& image) {
    float least = 1;
    for (int y = 100; y < 160; ++y)
      for (int x = 0; x < 60; ++x)
        least = std::min(least, std::max({image.pixel(x, y)[0], image.pixel(x, y)[1], image.pixel(x, y)[2]}));
    return least;
  };
  EXPECT_LT(darkest(render({"--axes", "--view", "iso", "--background", "white"})), 0.3f);
  const Image black = render({"--axes", "--view", "iso", "--background", "black"});
  float lightest = 0;
  for (int y = 100; y < 160; ++y)
    for (int x = 0; x < 60; ++x)
      lightest =
          std::max(lightest, std::min({black.pixel(x, y)[0], black.pixel(x, y)[1], black.pixel(x, y)[2]}));
  EXPECT_GT(lightest, 0.7f);
}

TEST_F(Annotations, OverTransparencyTheyAreOpaque) {
  const Image image = render({"--axes", "--background", "transparent"}, "t.png");
  float most = 0;
  for (int y = 100; y < 160; ++y)
    for (int x = 0; x < 60; ++x) most = std::max(most, image.pixel(x, y)[3]);
  EXPECT_EQ(most, 1);
  EXPECT_EQ(image.pixel(199, 0)[3], 0);
}

TEST_F(Annotations, EglDrawsWhatOsMesaDraws) {
  const ProgramResult system = run({"info", "--system", "--json"});
  const auto json = nlohmann::json::parse(system.out);
  for (const auto& backend : json.at("backends"))
    if (!backend.at("works").get<bool>()) GTEST_SKIP() << backend.dump();
  const ImageDifference difference =
      compareImages(render({"--backend", "egl"}), render({"--backend", "osmesa"}, "b.exr"));
  EXPECT_GE(difference.psnr_db, 50);
}

}  // namespace
}  // namespace curvisplat
