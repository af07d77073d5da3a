// Pictures without options: each shows something, and the options that the program prints draw it again.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <ostream>
#include <sstream>
#include <string>
#include <string_view>
#include <vector>

#include "render/image/contrast.h"
#include "render/image/image_file.h"
#include "stream/base/file.h"
#include "tests/support/run_program.h"
#include "tests/support/temporary_folder.h"

namespace curvisplat {
namespace {

constexpr std::string_view kChosen = "chosen from the data: ";

class DefaultPictures : public testing::TestWithParam<const char*> {
 protected:
  std::string file(const std::string& name) const { return (folder_ / name).string(); }

  ProgramResult run(const std::vector<std::string>& arguments) const {
    const ProgramResult result = runProgram(arguments);
    EXPECT_EQ(result.status, 0) << result.err;
    return result;
  }
  void convert(const std::string& scene, const std::string& size) const {
    run({"generate", scene, "--size", size, "-o", file("a")});
    run({"convert", file("a.xyz"), file("a.fun"), "-o", file("a.splats")});
  }
  ProgramResult render(std::vector<std::string> options, const std::string& name = "a.png") const {
    options.insert(options.begin(), {"render", file("a.splats"), "-o", file(name), "--size", "160x160"});
    return run(options);
  }
  static std::vector<std::string> chosenOptions(const std::string& out) {
    const size_t at = out.find(kChosen);
    EXPECT_NE(at, std::string::npos) << out;
    if (at == std::string::npos) return {};
    std::istringstream words(out.substr(at + kChosen.size()));
    std::vector<std::string> options;
    for (std::string word; words >> word;) options.push_back(word);
    return options;
  }

  TemporaryFolder folder_;
};

TEST_P(DefaultPictures, ShowSomethingAndAreDrawnAgainByThePrintedOptions) {
  convert(GetParam(), "48x32x24");
  const ProgramResult result = render({});
  EXPECT_EQ(result.err, "");
  const PictureContrast contrast = contrastOf(readImage(file("a.png")), glm::vec4(1));
  // The shell is a thin layer of nearly one colour in a clear far field, which hid it when it was drawn as fog.
  const double least = std::string_view(GetParam()) == "shell" ? 0.01 : 0.05;
  EXPECT_GE(contrast.seen, 0.05) << result.out;
  EXPECT_GE(contrast.other, least) << result.out;

  const ProgramResult again = render(chosenOptions(result.out), "b.png");
  EXPECT_EQ(again.out.find(kChosen), std::string::npos) << "all was given: " << again.out;
  EXPECT_EQ(readTextFile(file("a.png")), readTextFile(file("b.png"))) << result.out;
}

/// Of grids from thin to long, in pictures from wide to high: nothing is cut off at the sides, with an outline nor without.
TEST_P(DefaultPictures, HoldTheWholeData) {
  constexpr int kTouchedZoomed = 6;  // of 640 pixels along the edges
  convert(GetParam(), "48x32x24");
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
  for (const char* const stretched : {"1,1,1", "8,1,1", "1,0.05,1"})
    for (const char* const size : {"160x160", "240x80", "80x240"})
      for (const bool outline : {false, true}) {
        std::vector<std::string> words{"--size", size, "--scale", stretched, "--backend", "cpu"};
        if (outline) words.push_back("--outline");
        words.insert(words.begin(), {"render", file("a.splats"), "-o", file("a.png")});
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
struct RealGrid {
  const char* name;
  std::vector<std::string> files, scalars;
};
void PrintTo(const RealGrid& grid, std::ostream* out) {
  *out << grid.name;
}
std::vector<RealGrid> realGrids() {
  const std::vector<std::string> whole_flow{"density", "momentum_x", "momentum_y", "momentum_z", "energy"};
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

class DefaultPicturesOfRealGrids : public testing::TestWithParam<RealGrid> {};

TEST_P(DefaultPicturesOfRealGrids, ShowSomething) {
  const std::filesystem::path data = CURVISPLAT_SHARED_DATA;
  if (!std::filesystem::exists(data / GetParam().files.front()))
    GTEST_SKIP() << data.string() << " is not there";
  const TemporaryFolder folder;
  std::vector<std::string> words{"convert"};
  for (const std::string& name : GetParam().files) words.push_back((data / name).string());
  words.insert(words.end(), {"-o", (folder / "a.splats").string()});
  for (const std::string& scalar : GetParam().scalars) words.insert(words.end(), {"--scalar", scalar});
  const ProgramResult converted = runProgram(words);
  ASSERT_EQ(converted.status, 0) << converted.err;
  for (const std::string& scalar : GetParam().scalars) {
    const std::string picture = (folder / "a.png").string();
    const ProgramResult drawn = runProgram(
        {"render", (folder / "a.splats").string(), "-o", picture, "--size", "240x240", "--scalar", scalar});
    ASSERT_EQ(drawn.status, 0) << drawn.err;
    EXPECT_GE(contrastOf(readImage(picture), glm::vec4(1)).other, 0.05) << scalar << ": " << drawn.out;
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
    EXPECT_NE(result.err.find("--range"), std::string::npos) << result.err;
  }
}

TEST_F(DefaultPictures, AConstantScalarIsNotChosen) {
  run({"generate", "half-annulus-constant", "--size", "24x16x16", "-o", file("a")});
  run({"convert", file("a.xyz"), file("a.fun"), "-o", file("a.splats"), "--scalar", "all", "--scalar",
       "volume"});
  const ProgramResult result = render({});
  EXPECT_NE(result.out.find("--scalar volume"), std::string::npos) << result.out;
}

TEST_F(DefaultPictures, PoorPicturesAreAnsweredWithAnOption) {
  convert("half-annulus", "24x16x16");
  const ProgramResult pale = render({"--range", "data", "--opacity-unit", "50"});
  EXPECT_NE(pale.err.find("leave out --range and --opacity-unit"), std::string::npos) << pale.err;
  // Large, so that the edges of the silhouette are a small part of it.
  const ProgramResult flat =
      run({"render", file("a.splats"), "-o", file("f.png"), "--size", "800x800", "--tf", "grey", "--range",
           "100,200", "--opacity", "0:1,1:1", "--opacity-unit", "1e-4"});
  EXPECT_NE(flat.err.find("of one colour; leave out --tf, --range, --opacity and --opacity-unit"),
            std::string::npos)
      << flat.err;
}

}  // namespace
}  // namespace curvisplat
