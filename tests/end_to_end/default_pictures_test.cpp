// Pictures without options: each shows something, and the options that the program prints draw it again.
// --lod-pixels at its default against the finest level: coarser where the function hides it, and nowhere
// else.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <glm/geometric.hpp>
#include <glm/vec3.hpp>
#include <map>
#include <memory>
#include <ostream>
#include <sstream>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "render/colour/function_parts.h"
#include "render/image/image.h"
#include "render/image/image_file.h"
#include "stream/base/file.h"
#include "tests/support/fault_sweep.h"
#include "tests/support/program_test.h"

namespace curvisplat {
namespace {

constexpr std::string_view kChosen = "chosen from the data: ";

class DefaultPictures : public ProgramTest, public testing::WithParamInterface<const char*> {
 protected:
  void convert(const std::string& scene, const std::string& size) const { madeCache(file("a"), scene, size); }
  /// The scene's cache, converted for the first test of it.
  static const std::string& sharedCacheOf(const std::string& scene) {
    static const TemporaryFolder folder;
    static std::map<std::string, std::string> caches;
    const auto [place, is_new] = caches.try_emplace(scene);
    if (is_new) place->second = madeCache((folder / scene).string(), scene, "48x32x24");
    return place->second;
  }
  ProgramResult render(const Words& options, const std::string& name = "a.png") const {
    return run(Words{"render", cache_, "-o", file(name), "--size", "160x160"} + options);
  }
  static Words chosenOptions(const std::string& out) {
    const size_t at = out.find(kChosen);
    EXPECT_NE(at, std::string::npos) << out;
    if (at == std::string::npos) return {};
    std::istringstream words(out.substr(at + kChosen.size()));
    Words options;
    for (std::string word; words >> word;) options.push_back(word);
    return options;
  }

  std::string cache_ = file("a.splats");
};

TEST_P(DefaultPictures, ShowSomethingAndAreDrawnAgainByThePrintedOptions) {
  cache_ = sharedCacheOf(GetParam());
  const ProgramResult result = render({});
  EXPECT_EQ(result.err, "");
  const PictureContrast contrast = contrastOf(readImage(file("a.png")), kDefaultBackground);
  // The shell is a thin layer of nearly one colour in a clear far field, which hid it when it was drawn as fog.
  const double least = std::string_view(GetParam()) == "shell" ? 0.01 : 0.05;
  EXPECT_GE(contrast.seen, 0.05) << result.out;
  EXPECT_GE(contrast.other, least) << result.out;

  const ProgramResult again = render(chosenOptions(result.out), "b.png");
  EXPECT_EQ(again.out.find(kChosen), std::string::npos) << "all was given: " << again.out;
  EXPECT_EQ(readTextFile(file("a.png")), readTextFile(file("b.png"))) << result.out;
}

/// Grids are thin to long, and pictures wide to high: nothing is cut off at the sides, with an outline or
/// without.
TEST_P(DefaultPictures, HoldTheWholeData) {
  constexpr int kTouchedZoomed = 6;  // of 640 pixels along the edges
  cache_ = sharedCacheOf(GetParam());
  const auto touched = [](const Image& image) {
    int number = 0;
    const auto count = [&](int x, int y) {
      const float* const pixel = image.pixel(x, y);
      number += std::min({pixel[0], pixel[1], pixel[2]}) < 0.95f;
    };
    for (int x = 0; x < image.size.width; ++x) {
      count(x, 0);
      count(x, image.size.height - 1);
    }
    for (int y = 0; y < image.size.height; ++y) {
      count(0, y);
      count(image.size.width - 1, y);
    }
    return number;
  };
  static size_t combination = 0;  // usually one or two with each scene, others with each
  for (const char* const stretched : {"1,1,1", "8,1,1", "1,0.05,1"})
    for (const char* const size : {"160x160", "240x80", "80x240"})
      for (const bool outline : {false, true}) {
        if (!faults::isTried(combination++, 11)) continue;
        Words words{"--size", size, "--scale", stretched, "--backend", "cpu", "--background", "white"};
        if (outline) words.push_back("--outline");
        words.insert(words.begin(), {"render", cache_, "-o", file("a.png")});
        const ProgramResult result = run(words);
        // What is zoomed to leaves a hundredth of the extinction out on each side.
        const int may_touch = result.out.find("--focal-point") == std::string::npos ? 0 : kTouchedZoomed;
        EXPECT_LE(touched(readImage(file("a.png"))), may_touch)
            << stretched << " " << size << (outline ? " outline: " : ": ") << result.out;
      }
}
INSTANTIATE_TEST_SUITE_P(Scenes, DefaultPictures,
                         testing::Values("half-annulus", "shell", "o-grid", "axis", "sheared-waves", "wake",
                                         "dome", "globe", "duct"),
                         [](const auto& scene) {
                           std::string name = scene.param;
                           std::erase(name, '-');
                           return name;
                         });

/// Real grids, which lie in a folder beside the project, where they are there; and the scalars that vary.
struct GridWithScalars {
  const char* name;
  Words files, scalars;

  friend void PrintTo(const GridWithScalars& grid, std::ostream* out) { *out << grid.name; }
};
std::vector<GridWithScalars> realGrids() {
  const Words whole_flow{"density", "momentum_x", "momentum_y", "momentum_z", "energy"};
  return {
      {"bluntfin", {"bluntfin/bluntfinxyz.bin", "bluntfin/bluntfinq.bin"}, whole_flow},
      {"delta_wing", {"delta_wing/delta_vertex.cgns"}, {"Density", "mach_number", "vorticity_magnitude"}},
      {"lox_post",  // its density is constant
       {"lox_post/postxyz.bin", "lox_post/postq.bin"},
       {"momentum_x", "momentum_y", "momentum_z", "energy"}},
      {"combustor",  // its energy is constant
       {"combustor/combxyz.bin", "combustor/combq.bin"},
       {"density", "momentum_x", "momentum_y", "momentum_z"}},
      {"nek",  // its fourth function, the pressure, is pale but for a small part: 3.9 %
       {"nek/Combined_PressureSide_Block.xyz", "nek/pressure.fun"},
       {"1", "2", "3"}},
      {"vtk_sample", {"vtk/SampleStructGrid.vtk"}, {"scalars"}},
      {"vtk_comb", {"vtk/multicomb_0.vts"}, {"Density", "Momentum:mag"}},
      {"mitgcm", {"vts_encodings/face3_appended_raw.vts"}, {"T", "S"}},
      {"cgns_sqnz", {"cgns/sqnz_s.hdf.cgns"}, {"Density", "MomentumX"}},
      {"nemo", {"nemo_northsea/nemo_northsea_u.xyz", "nemo_northsea/nemo_northsea_u.fun"}, {"uo", "depth"}},
  };
}

class DefaultPicturesOfRealGrids : public testing::TestWithParam<GridWithScalars> {};

TEST_P(DefaultPicturesOfRealGrids, ShowSomething) {
  const std::filesystem::path data = CURVISPLAT_SHARED_DATA;
  if (!std::filesystem::exists(data / GetParam().files.front()))
    GTEST_SKIP() << data.string() << " is not there";
  const TemporaryFolder folder;
  Words words{"convert"};
  for (const std::string& name : GetParam().files) words.push_back((data / name).string());
  words.insert(words.end(), {"-o", (folder / "a.splats").string()});
  Words tried{GetParam().scalars.front()};
  if (faults::isWholeSweep()) tried = GetParam().scalars;
  for (const std::string& scalar : tried) words.insert(words.end(), {"--scalar", scalar});
  run(words);
  for (const std::string& scalar : tried) {
    const std::string picture = (folder / "a.png").string();
    const ProgramResult drawn = run(
        {"render", (folder / "a.splats").string(), "-o", picture, "--size", "240x240", "--scalar", scalar});
    EXPECT_GE(contrastOf(readImage(picture), kDefaultBackground).other, 0.02) << scalar << ": " << drawn.out;
  }
}
INSTANTIATE_TEST_SUITE_P(Grids, DefaultPicturesOfRealGrids, testing::ValuesIn(realGrids()),
                         [](const auto& grid) { return std::string(grid.param.name); });

TEST_F(DefaultPictures, RangesByPercentilesAndOfAllData) {
  convert("wake", "48x32x24");
  const auto outputs = [&](const std::string& range) {
    render({"--range", range, "--opacity-unit", "0.1", "--view", "iso"}, "r.png");
    return readTextFile(file("r.png"));
  };
  const std::string all = outputs("data"), ends = outputs("0%,100%"), middle = outputs("10%,90%");
  EXPECT_NE(all, middle);
  EXPECT_NE(ends, middle);
  for (const char* wrong : {"1%", "90%,10%", "1%,2%,3%", "-1%,50%", "x%,50%", "dat"}) {
    const ProgramResult result =
        runProgram({"render", file("a.splats"), "-o", file("w.png"), fmt::format("--range={}", wrong)});
    EXPECT_EQ(result.status, 2) << wrong << result.err;
    expectSays(result.err, "--range");
  }
}

/// Values from -0.42 to 0.58: the middle colour of a diverging map is that of zero, whether the map is chosen or named. Below zero but for
/// six samples, they get no such map unasked; a few of either sign in much that is zero do.
TEST_F(DefaultPictures, DivergingMapsAreCentred) {
  constexpr int kSide = 14, kNodes = kSide * kSide * kSide;
  const auto across = [](double low, double high, int n) {
    return std::lerp(low, high, n % kSide / (kSide - 1.0));
  };
  const auto convertOf = [&](const std::function<double(int)>& valueAt) {
    std::ofstream grid(file("signed.xyz")), values(file("signed.fun"));
    grid << fmt::format("{0} {0} {0}\n", kSide);
    values << fmt::format("{0} {0} {0} 1\n", kSide);
    for (int axis = 0; axis < 3; ++axis)
      for (int n = 0; n < kNodes; ++n)
        grid << (axis == 0 ? n : axis == 1 ? n / kSide : n / kSide / kSide) % kSide / (kSide - 1.0) << '\n';
    for (int n = 0; n < kNodes; ++n) values << valueAt(n) << '\n';
    grid.close();
    values.close();
    run({"convert", file("signed.xyz"), file("signed.fun"), "-o", file("a.splats"), "--overwrite"});
  };
  const auto middleOf = [&](const Words& options) {
    const Words chosen = chosenOptions(render(options).out);
    for (const std::string& word : chosen) {
      double low = 0, high = 0;
      if (std::sscanf(word.c_str(), "--range=%lf,%lf", &low, &high) == 2) return (low + high) / (high - low);
    }
    ADD_FAILURE() << testing::PrintToString(chosen);
    return 1.0;
  };
  convertOf([&](int n) { return across(-0.42, 0.58, n); });
  EXPECT_NEAR(middleOf({}), 0, 1e-9);
  EXPECT_NEAR(middleOf({"--tf", "cool-warm"}), 0, 1e-9);
  EXPECT_GT(std::abs(middleOf({"--tf", "viridis"})), 0.05);
  convertOf([&](int n) { return n < 6 ? 0.1 * (n + 1) : across(-0.24, -0.02, n); });
  EXPECT_GT(std::abs(middleOf({})), 0.05);
  EXPECT_NEAR(middleOf({"--tf", "cool-warm"}), 0, 1e-9);
  constexpr int kFew = 12;
  convertOf([&](int n) { return n < kFew ? 0.05 * (n + 1) : n < kNodes - kFew ? 0 : -0.05 * (kNodes - n); });
  EXPECT_NEAR(middleOf({}), 0, 1e-9);
}

/// A dense core behind haze takes no colours from what is seen, but where a slice shows it.
TEST_F(DefaultPictures, ASliceHasColoursForWhatTheVolumeHides) {
  constexpr int kSide = 24;
  std::ofstream data(file("core.vtk"));
  data << fmt::format(
      "# vtk DataFile Version 3.0\ncore\nASCII\nDATASET STRUCTURED_POINTS\nDIMENSIONS {0} {0} {0}\nORIGIN -1 "
      "-1 -1\n"
      "SPACING {1} {1} {1}\nPOINT_DATA {2}\nSCALARS f float 1\nLOOKUP_TABLE default\n",
      kSide, 2.0 / (kSide - 1), kSide * kSide * kSide);
  const auto place = [](int n) { return 2.0 * n / (kSide - 1) - 1; };
  for (int n = 0; n < kSide * kSide * kSide; ++n)
    data << std::exp(-5 * std::hypot(place(n % kSide), place(n / kSide % kSide), place(n / kSide / kSide)))
         << '\n';
  data.close();
  run({"convert", file("core.vtk"), "-o", file("a.splats")});
  const auto highest = [&](const Words& options) {
    for (const std::string& word : chosenOptions(render(options).out)) {
      double low = 0, high = 0;
      if (std::sscanf(word.c_str(), "%lf,%lf", &low, &high) == 2 && low > 0) return high;
    }
    ADD_FAILURE() << testing::PrintToString(options);
    return 0.0;
  };
  EXPECT_LT(highest({}), 0.4);
  EXPECT_GT(highest({"--slice", "0,0,0,1,0,0"}), 0.6);
}

/// A cube of [0, 1] with a function of x, y and z.
class CubeOfValues : public ProgramTest {
 protected:
  template <typename Value>
  void convert(const glm::dvec3& upper, const Value& valueAt) const {
    constexpr int kSide = 32;
    std::ofstream grid(file("a.xyz")), values(file("a.fun"));
    grid << fmt::format("{0} {0} {0}\n", kSide);
    values << fmt::format("{0} {0} {0} 1\n", kSide);
    for (int axis = 0; axis < 3; ++axis)
      eachNode(kSide, upper, [&](const glm::dvec3& at) { grid << at[axis] << '\n'; });
    eachNode(kSide, upper, [&](const glm::dvec3& at) { values << valueAt(at) << '\n'; });
    grid.close();
    values.close();
    run({"convert", file("a.xyz"), file("a.fun"), "-o", file("a.splats")});
  }
  ProgramResult render(const Words& options = {}) const {
    return run(Words{"render", file("a.splats"), "-o", file("a.png"), "--size", "160x160"} + options);
  }
  /// The least opacity of the function that was chosen.
  double leastOpacity() const {
    const std::string out = render().out;
    const size_t option = out.find("--opacity ");
    if (option == std::string::npos) return -1;
    std::istringstream points(out.substr(option + 10));
    double least = 1, x = 0, opacity = -1;
    for (char colon = 0, comma = ','; comma == ',' && points >> x >> colon >> opacity;
         comma = static_cast<char>(points.get()))
      least = std::min(least, opacity);
    return opacity < 0 ? -1 : least;
  }

 private:
  template <typename Take>
  static void eachNode(int side, const glm::dvec3& upper, const Take& take) {
    for (int n = 0; n < side * side * side; ++n)
      take(upper * glm::dvec3(n % side, n / side % side, n / side / side) / (side - 1.0));
  }
};

/// Two slabs in a third material, which fills most of the volume and was clear.
TEST_F(CubeOfValues, NoMaterialIsClear) {
  convert(glm::dvec3(1), [](const glm::dvec3& at) { return at.z < 0.2 ? 2 : at.z > 0.8 ? 3 : 1; });
  EXPECT_GT(leastOpacity(), 0.005);
}

/// Two balls in corners of a cube, which nothing showed.
TEST_F(CubeOfValues, WhatHappensInCornersIsDrawnInItsBox) {
  convert(glm::dvec3(1), [](const glm::dvec3& at) {
    const double away = std::min(glm::distance(at, {0.2, 0.2, 0.2}), glm::distance(at, {0.8, 0.2, 0.8}));
    return away < 0.2 ? 2 - away / 0.2 : 0;
  });
  EXPECT_GT(leastOpacity(), 0.04);
}

/// Layers across z, which are seen from above as one.
TEST_F(CubeOfValues, LayersOfThinDataAreExplained) {
  convert({1, 1, 0.008}, [](const glm::dvec3& at) { return at.z; });
  expectSays(render().err,
             "if layers above one another are seen as one, draw it with --view iso --vertical-scale 30; or "
             "try --range");
}

TEST_F(DefaultPictures, NumberingsDoNotChooseTheCentring) {
  std::ofstream grid(file("ids.vtk"));
  grid << "# vtk DataFile Version 3.0\nids\nASCII\nDATASET STRUCTURED_POINTS\nDIMENSIONS 3 2 2\nORIGIN 0 0 "
          "0\nSPACING 1 1 1\n"
          "POINT_DATA 12\nSCALARS node_groups int\nLOOKUP_TABLE default\n0 1 2 3 4 5 6 7 8 9 10 11\n"
          "CELL_DATA 2\nSCALARS stress float\nLOOKUP_TABLE default\n1 2\n";
  grid.close();
  expectSays(run({"convert", file("ids.vtk"), "-o", file("ids.splats")}).err, "left out: node_groups");
}

TEST_F(DefaultPictures, AConstantScalarIsNotChosen) {
  run({"generate", "half-annulus-constant", "--size", "24x16x16", "-o", file("a")});
  run({"convert", file("a.xyz"), file("a.fun"), "-o", file("a.splats"), "--scalar", "all", "--scalar",
       "volume"});
  const ProgramResult result = render({});
  expectSays(result.out, "--scalar volume");
}

TEST_F(DefaultPictures, PoorPicturesAreAnsweredWithAnOption) {
  convert("half-annulus", "24x16x16");
  const ProgramResult pale = render({"--range", "data", "--opacity-unit", "50"});
  expectSays(pale.err, "leave out --range and --opacity-unit");
  // Large, so that the edges of the silhouette are a small part of it.
  const ProgramResult flat =
      run({"render", file("a.splats"), "-o", file("f.png"), "--size", "800x800", "--tf", "grey", "--range",
           "100,200", "--opacity", "0:1,1:1", "--opacity-unit", "1e-4"});
  expectSays(flat.err, "of one colour; leave out --tf, --range, --opacity and --opacity-unit");
  const ProgramResult dark =
      run({"render", file("a.splats"), "-o", file("f.png"), "--size", "400x400", "--tf", "grey", "--range",
           "100,200", "--opacity", "0:1,1:1", "--opacity-unit", "1e-4", "--ambient-occlusion", "1"});
  expectSays(dark.err, "the picture is dark or of one colour");
  expectSays(dark.err, "--ambient-occlusion");
}

const Words kStep = {"--opacity", "0:0,0.499:0,0.501:0.9,1:0.9"};
const Words kEven = {"--opacity", "0:0.3,1:0.3", "--tf", "grey"};
const Words kFaint = {"--opacity", "0:0.01,1:0.03"};

class DefaultDetail : public ProgramSuite<DefaultDetail> {
 protected:
  static void prepare() {
    for (const auto& [scene, size] :
         {std::pair{"half-annulus", "192x96x96"}, std::pair{"sheared-waves", "64x64x64"}})
      madeCache(file(scene), scene, size);
  }

  /// Draws `scene` as `name`.pfm. Returns the number of splats.
  static uint64_t draw(const std::string& scene, const std::string& name, const Words& options,
                       const Words& more = {}) {
    run(Words{"render", file(scene + ".splats"), "-o", file(name + ".pfm"), "--size",
              scene == "half-annulus" ? "128x128" : "60x60", "--stats", file("stats.json")} +
        options + more);
    return jsonOf(file("stats.json"))["frames"][0]["splats_drawn"];
  }
  static double psnr(const std::string& a, const std::string& b) {
    return compareImages(readImage(file(a + ".pfm")), readImage(file(b + ".pfm"))).psnr_db;
  }
};

TEST_F(DefaultDetail, HoldsFiftyDecibelsAgainstTheFinestLevel) {
  for (const char* scene : {"half-annulus", "sheared-waves"}) {
    for (const char* view : {"iso", "+x"}) {
      for (const auto& function : {Words{}, kStep, kEven, kFaint}) {
        // Usually where detail is hidden.
        const bool is_other = scene == std::string("half-annulus") && function != kEven;
        if ((is_other || view == std::string("+x")) && !faults::isWholeSweep()) continue;
        const Words options = Words{"--view", view} + function;
        const uint64_t finest = draw(scene, "finest", options, {"--lod-pixels", "0"});
        const uint64_t drawn = draw(scene, "drawn", options);
        const double psnr_db = psnr("finest", "drawn");
        fmt::print("{} {} {}: {} of {} splats, {:.1f} dB\n", scene, view, function.empty() ? "" : function[1],
                   drawn, finest, psnr_db);
        EXPECT_GE(psnr_db, 50) << scene << ' ' << view;
        EXPECT_LE(drawn, finest);
      }
    }
  }
}

/// The error on the screen alone decides where only the geometry counts, as in lit pictures. Along an axis of
/// the lattice its ripples would show.
TEST_F(DefaultDetail, DrawsFewerSplatsWhereTheFunctionHidesTheirDetail) {
  const auto splatsOf = [](const Words& options, const Words& more) {
    return draw("half-annulus", "drawn", options, more);
  };
  const uint64_t lit = splatsOf({"--view", "iso", "--shade"}, {});
  EXPECT_LE(1.5 * static_cast<double>(splatsOf({"--view", "iso"}, {})), static_cast<double>(lit));
  EXPECT_LE(3 * splatsOf({"--view", "iso"}, kFaint), lit);
  EXPECT_LE(3 * splatsOf({"--view", "iso"}, kEven), lit);
  const uint64_t lit_along_x = splatsOf({"--view", "+x", "--shade"}, kEven);  // also merges no layers
  EXPECT_NEAR(splatsOf({"--view", "+x"}, kEven), lit_along_x, 0.01 * lit_along_x);
  // At 4 pixels and more nothing is hidden further.
  const Words coarse = {"--view", "iso", "--lod-pixels", "4"};
  EXPECT_EQ(splatsOf({}, coarse), splatsOf({"--shade"}, coarse));
}

/// A step may lie in every brick.
TEST_F(DefaultDetail, KeepsStepsAsTheyWere) {
  std::string steps = "0:0.9";
  for (int n = 1; n < 20; ++n)
    steps += fmt::format(",{}:{},{}:{}", 0.05 * n, n % 2 ? 0.9 : 0.1, 0.05 * n + 0.001, n % 2 ? 0.1 : 0.9);
  const Words function = {"--view",         "iso", "--range", "0,1", "--opacity", steps + ",1:0.1",
                          "--opacity-unit", "0.2"};
  EXPECT_EQ(draw("sheared-waves", "drawn", function), draw("sheared-waves", "lit", function, {"--shade"}));
}

TEST_F(DefaultDetail, MorePixelsNeverDrawMoreSplats) {
  uint64_t finer = UINT64_MAX;
  for (const char* lod_pixels : {"0", "0.3", "1", "2", "4", "1000"}) {
    const uint64_t drawn = draw("sheared-waves", "drawn", {"--view", "iso", "--lod-pixels", lod_pixels});
    EXPECT_LE(drawn, finer) << lod_pixels;
    finer = drawn;
  }
}

}  // namespace
}  // namespace curvisplat
