// Surfaces and slices through the real program: the same picture by every painter, with any threads and memory; what
// a wall hides is not read; and what is refused.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <numbers>
#include <sstream>

#include "render/image/image.h"
#include "render/image/image_file.h"
#include "stream/base/file.h"
#include "tests/support/fault_sweep.h"
#include "tests/support/program_test.h"

namespace curvisplat {
namespace {

class SurfaceOptions : public ProgramSuite<SurfaceOptions> {
 protected:
  static void prepare() {
    madeCache(file("wake"), "wake", "48x32x24", {"--refine", "1"});
    writeFileAtomically(*folder_ / "sphere.obj", sphere());
    // Before all of the wake, seen from +z.
    writeFileAtomically(
        *folder_ / "wall.obj",
        std::string("v -1e3 -1e3 50\nv 1e3 -1e3 50\nv 1e3 1e3 50\nv -1e3 1e3 50\nf 1 2 3 4\n"));
  }

  static std::string sphere() {
    constexpr int kAround = 64, kUp = 32;
    std::string text;
    for (int j = 0; j <= kUp; ++j)
      for (int i = 0; i < kAround; ++i) {
        const double theta = std::numbers::pi * j / kUp, phi = 2 * std::numbers::pi * i / kAround;
        text += fmt::format("v {} {} {}\n", 3 + 1.2 * std::sin(theta) * std::cos(phi),
                            1.2 * std::sin(theta) * std::sin(phi), 1.2 * std::cos(theta));
      }
    for (int j = 0; j < kUp; ++j)
      for (int i = 0; i < kAround; ++i) {
        const int a = j * kAround + i + 1, b = j * kAround + (i + 1) % kAround + 1;
        text += fmt::format("f {} {} {} {}\n", a, b, b + kAround, a + kAround);
      }
    return text;
  }

  static Words render(const Words& more, const std::string& output = "a.pfm") {
    const auto is_view = [](const std::string& word) {
      return word == "--view" || word.starts_with("--view=");
    };
    const bool has_view = std::any_of(more.begin(), more.end(), is_view);
    return Words{"render", file("wake.splats"), "-o",      file(output),
                 "--size", "200x150",           "--stats", file("stats.json")} +
           (has_view ? Words{} : Words{"--view", "iso"}) + more;
  }
  static Image picture(const Words& more) {
    run(render(more));
    return readImage(file("a.pfm"));
  }
  static nlohmann::json statistics() { return jsonOf(file("stats.json"))["frames"][0]; }
};

TEST_F(SurfaceOptions, EveryPainterDrawsTheSame) {
  const std::string fine =
      madeCache(file("fine"), "wake", "72x48x36");  // painters differ more in larger splats
  std::string helix = "x,y,z\n";
  for (int n = 0; n < 200; ++n)
    helix += fmt::format("{},{},{}\n", 2 + 0.02 * n, 1.6 * std::sin(0.1 * n), 1.6 * std::cos(0.1 * n));
  writeFileAtomically(file("helix.csv"), helix);
  for (const char* angle : {"0", "40"}) {
    // LinesAreTheSameFromEveryFormat has a picture in perspective by both painters.
    if (angle == std::string("40") && !faults::isWholeSweep()) continue;
    Words options{"--surface",       file("sphere.obj"),
                  "--slice",         "4,0,0,1,0.2,0.1",
                  "--slice",         "4,0,0,0,0,1",
                  "--slice-opacity", "0.6",
                  "--clip-plane",    "2,0,0,1,0,0",
                  "--lines",         file("helix.csv"),
                  "--line-width",    "0.1",
                  "--lines-opacity", "0.7"};
    if (angle != std::string("0")) options = options + Words{"--view-angle", angle};
    // OpenGL takes a second for a hundred thousand splats.
    const auto with = [&](const Words& more) {
      Words words = render(more + options + Words{"--lod-pixels", "4"});
      words.at(1) = fine;
      run(words);
      return readImage(file("a.pfm"));
    };
    const Image cpu = with({"--backend", "cpu"});
    const ImageDifference difference = compareImages(cpu, with({"--backend", "osmesa"}));
    EXPECT_GT(difference.psnr_db, 70) << angle;
    EXPECT_LT(difference.largest, 2.0 / 255) << angle;
    EXPECT_EQ(with({"--backend", "cpu", "--threads", "1", "--memory", "96M"}).rgba, cpu.rgba);
  }
}

TEST_F(SurfaceOptions, APolygonFileOfVtkIsTheSameSurface) {
  // The sphere's points and polygons, as they are in its OBJ file.
  std::istringstream obj(sphere());
  std::string points, connectivity, offsets, word;
  int count = 0, cells = 0;
  for (std::string line; std::getline(obj, line);) {
    std::istringstream words(line);
    words >> word;
    if (word == "v") {
      points += line.substr(1) + "\n";
      ++count;
      continue;
    }
    for (int corner = 0; words >> corner;) connectivity += fmt::format("{} ", corner - 1);
    offsets += fmt::format("{} ", 4 * ++cells);
  }
  const std::string text = fmt::format(
      "<?xml version=\"1.0\"?>\n<VTKFile type=\"PolyData\" version=\"0.1\" byte_order=\"LittleEndian\">\n"
      "<PolyData><Piece NumberOfPoints=\"{}\" NumberOfPolys=\"{}\">\n"
      "<Points><DataArray type=\"Float64\" NumberOfComponents=\"3\" "
      "format=\"ascii\">\n{}</DataArray></Points>\n"
      "<Polys><DataArray type=\"Int64\" Name=\"connectivity\" format=\"ascii\">{}</DataArray>\n"
      "<DataArray type=\"Int64\" Name=\"offsets\" format=\"ascii\">{}</DataArray></Polys>\n"
      "</Piece></PolyData></VTKFile>\n",
      count, cells, points, connectivity, offsets);
  writeFileAtomically(file("sphere.vtp"), text);
  EXPECT_EQ(picture({"--surface", file("sphere.vtp")}).rgba, picture({"--surface", file("sphere.obj")}).rgba);

  const auto with = [&](const std::string& from, const std::string& to) {
    std::string changed = text;
    changed.replace(changed.find(from), from.size(), to);
    writeFileAtomically(file("wrong.vtp"), changed);
    const ProgramResult result = runProgram(render({"--surface", file("wrong.vtp")}));
    EXPECT_EQ(result.status, 1) << result.err;
    return result.err;
  };
  expectSays(with("ascii\">0 ", "ascii\">99999 "), "a cell refers to a point that does not exist");
  expectSays(with("ascii\">4 8", "ascii\">8 4"), "the offsets of its cells do not increase");
  expectSays(with("NumberOfPolys", "NumberOfLines"), "has no polygons");
  expectSays(with("</PolyData></VTKFile>", ""), "wrong.vtp: ");
}

TEST_F(SurfaceOptions, WhatAWallHidesIsNotRead) {
  picture({"--view", "+z", "--surface", file("wall.obj")});
  EXPECT_EQ(statistics()["bytes_read"], 0);
  EXPECT_EQ(statistics()["splats_drawn"], 0);
  picture({"--view=-z", "--surface", file("wall.obj")});
  EXPECT_GT(statistics()["splats_drawn"], 0);
}

TEST_F(SurfaceOptions, VolumeOffLeavesSurfacesAndSlices) {
  const Image alone = picture({"--volume", "off", "--surface", file("sphere.obj"), "--background", "black",
                               "--surface-colour", "#ff0000"});
  EXPECT_EQ(statistics()["splats_drawn"], 0);
  size_t red = 0;
  for (size_t n = 0; n < alone.rgba.size(); n += 4) red += alone.rgba[n] > 0.25f;
  EXPECT_GT(red, 300u);
  picture({"--volume", "off", "--slice", "4,0,0,0,0,1"});
  EXPECT_GT(statistics()["bytes_read"], 0);
}

TEST_F(SurfaceOptions, SlicesKeepTheColoursOfTheScalarBarInLight) {
  const Words slice{"--volume", "off", "--slice", "4,0,0,0,0,1", "--view", "+z"};
  const auto with = [&](const Words& more) { return picture(more + slice); };
  const Image unlit = with({});
  EXPECT_EQ(with({"--shade"}).rgba, unlit.rgba);
  EXPECT_EQ(with({"--shade", "--light-direction", "1,1,1"}).rgba, unlit.rgba);
}

/// The usual way to show a cut: the slice lies in the clip plane, which keeps it whole.
TEST_F(SurfaceOptions, AClipPlaneKeepsTheSliceInIt) {
  const auto with = [&](const std::string& plane) {
    return picture({"--volume", "off", "--slice", "4,0,0.3,0,0,1", "--view", "+z", "--background", "black",
                    "--clip-plane", plane});
  };
  const Image whole = with("4,0,-900,0,0,1");
  float brightest = 0;
  for (size_t n = 0; n < whole.rgba.size(); n += 4) brightest = std::max(brightest, whole.rgba[n]);
  EXPECT_GT(brightest, 0.3f);
  const auto farthest = [&](const Image& other) {
    float most = 0;
    for (size_t n = 0; n < whole.rgba.size(); ++n)
      most = std::max(most, std::abs(whole.rgba[n] - other.rgba[n]));
    return most;
  };
  for (const char* in_it : {"4,0,0.3,0,0,1", "1,2,0.3,0,0,-3"})
    EXPECT_LT(farthest(with(in_it)), 0.02f) << in_it;
  const Image nothing = with("4,0,0.4,0,0,1");
  for (size_t n = 0; n < nothing.rgba.size(); ++n)
    if (n % 4 != 3) {
      ASSERT_EQ(nothing.rgba[n], 0) << n;
    }
}

/// A surface that fills the picture with one colour is what was asked for: no option of the volume changes it.
TEST_F(SurfaceOptions, WarningsOfSurfacesAloneDoNotMentionTheVolume) {
  const ProgramResult wall = runProgram(render({"--view", "+z", "--surface", file("wall.obj")}));
  EXPECT_EQ(wall.err.find("warning"), std::string::npos) << wall.err;
  const ProgramResult nothing =
      runProgram(render({"--volume", "off", "--surface", file("sphere.obj"), "--focal-point", "900,0,0"}));
  expectSays(nothing.err, "no surface, slice, line or isosurface is in sight");
  EXPECT_EQ(nothing.err.find("transfer function"), std::string::npos) << nothing.err;
}

TEST_F(SurfaceOptions, SaysWhyNoIsosurfaceIsSeen) {
  const ProgramResult nothing =
      runProgram(render({"--volume", "off", "--iso", "0.5", "--focal-point", "900,0,0"}));
  expectSays(nothing.err, "no isosurface is in sight");
  expectSays(nothing.err, "asked for 0.5 of f, which goes from 0 to 0.995661.");
  const ProgramResult clipped =
      runProgram(render({"--volume", "off", "--iso", "0.5", "--clip-box", "95,96,95,96,95,96"}));
  expectSays(clipped.err, "--clip-box contains none of the data");
}

/// A helix and a straight line, with the height and a number of the line as scalars, in every format.
TEST_F(SurfaceOptions, LinesAreTheSameFromEveryFormat) {
  std::string csv = "x,y,z,height,id\n", points, heights, cells;
  for (int n = 0; n < 60; ++n) {
    const bool helix = n < 50;
    const double angle = 0.3 * n, x = helix ? 3 + 1.5 * std::cos(angle) : n - 52.0,
                 y = helix ? 1.5 * std::sin(angle) : 1, z = helix ? 0.03 * n : 0.5;
    const std::string at = fmt::format("{} {} {}", x, y, z);
    csv += fmt::format("{},{},{},{},{}\n", x, y, z, z, helix ? "a" : "b");
    points += at + "\n";
    heights += fmt::format("{}\n", z);
    cells += fmt::format("{} ", n);
  }
  writeFileAtomically(file("lines.csv"), csv);
  const auto array = [](const char* type, const char* name, int components, const std::string& numbers) {
    return fmt::format(
        "<DataArray type=\"{}\" Name=\"{}\" NumberOfComponents=\"{}\" format=\"ascii\">{}</DataArray>\n",
        type, name, components, numbers);
  };
  const std::string data = "<PointData>" + array("Float64", "height", 1, heights) + "</PointData><CellData>" +
                           array("Float64", "line", 1, "1 2") + "</CellData><Points>" +
                           array("Float64", "points", 3, points) + "</Points>",
                    lines = array("Int64", "connectivity", 1, cells) + array("Int64", "offsets", 1, "50 60");
  const auto xml = [&](const char* type, const std::string& counts, const std::string& of_cells) {
    return fmt::format(
        "<VTKFile type=\"{0}\" version=\"0.1\" byte_order=\"LittleEndian\"><{0}><Piece NumberOfPoints=\"60\" "
        "{1}>{2}{3}</Piece></{0}></VTKFile>\n",
        type, counts, data, of_cells);
  };
  writeFileAtomically(file("lines.vtp"),
                      xml("PolyData", "NumberOfLines=\"2\"", "<Lines>" + lines + "</Lines>"));
  writeFileAtomically(file("lines.vtu"),
                      xml("UnstructuredGrid", "NumberOfCells=\"2\"",
                          "<Cells>" + lines + array("UInt8", "types", 1, "4 4") + "</Cells>"));
  const std::string legacy =
      "# vtk DataFile Version 3.0\nlines\nASCII\nDATASET POLYDATA\nPOINTS 60 double\n" + points +
      "VERTICES 1 2\n1 0\nLINES 2 62\n50 ";
  std::string counted = cells;
  counted.insert(counted.find("50 51"), "10 ");
  writeFileAtomically(file("lines.vtk"),
                      legacy + counted + "\nPOINT_DATA 60\nSCALARS height double\nLOOKUP_TABLE default\n" +
                          heights + "CELL_DATA 3\nSCALARS line double\nLOOKUP_TABLE default\n9 1 2\n");
  const Words look{"--lines-by", "height", "--scalar-bar", "--line-width", "4px"};
  const Image plain = picture({}), csv_lines = picture(Words{"--lines", file("lines.csv")} + look);
  EXPECT_LT(compareImages(plain, csv_lines).psnr_db, 35);
  for (const char* name : {"lines.vtp", "lines.vtu", "lines.vtk"})
    EXPECT_EQ(picture(Words{"--lines", file(name)} + look).rgba, csv_lines.rgba) << name;
  // The cells' array, of which vertices come first.
  const Words by_cell{"--lines-by", "line"};
  const Image of_cells = picture(Words{"--lines", file("lines.vtp")} + by_cell);
  EXPECT_EQ(picture(Words{"--lines", file("lines.vtk")} + by_cell).rgba, of_cells.rgba);
  EXPECT_NE(picture(Words{"--lines", file("lines.vtp")}).rgba, of_cells.rgba);
  const Image spheres = picture({"--points", file("lines.csv"), "--point-size", "0.2"});
  EXPECT_EQ(picture({"--points", file("lines.vtk"), "--point-size", "0.2"}).rgba, spheres.rgba);
  EXPECT_LT(compareImages(spheres, plain).psnr_db, 35);

  // Hidden and dimmed as surfaces are, by both painters, and with any threads.
  const Words both{"--lines", file("lines.vtp"), "--points", file("lines.csv"), "--lines-opacity",
                   "0.6",     "--view-angle",    "40",       "--lod-pixels",    "4"};
  const Image cpu = picture(both + Words{"--backend", "cpu"});
  EXPECT_GT(compareImages(cpu, picture(both + Words{"--backend", "osmesa"})).psnr_db, 70);
  EXPECT_EQ(picture(both + Words{"--backend", "cpu", "--threads", "1", "--memory", "96M"}).rgba, cpu.rgba);
  const auto isRed = [&](const Words& more) {
    const Image image =
        picture(Words{"--lines", file("lines.csv"), "--lines-colour", "#ff0000", "--tf", "viridis"} + more);
    int red = 0;
    for (size_t n = 0; n < image.rgba.size(); n += 4)
      red += image.rgba[n] > 0.5f && image.rgba[n + 1] < 0.15f;
    return red;
  };
  const int alone = isRed({"--volume", "off"});
  EXPECT_GT(alone, 300);
  EXPECT_LT(isRed({"--opacity", "0:1,1:1", "--opacity-unit", "1e-4"}), alone / 10);

  const auto refusal = [&](const Words& more) { return runProgram(render(more)).err; };
  expectSays(refusal({"--lines", file("lines.vtp"), "--lines-by", "heigth"}),
             "has no scalar 'heigth' (did you mean height?)");
  expectSays(refusal({"--lines", file("sphere.obj")}), "is no file of lines or points by its ending");
  expectSays(refusal({"--lines", file("none.csv")}), "none.csv: ");
  expectSays(refusal({"--lines", file("lines.csv"), "--line-width", "thin"}), "--line-width");
  expectSays(refusal({"--lines-by", "height"}), "--lines-by needs lines or points: --lines FILE");
  expectSays(refusal({"--lines-opacity", "0.5"}), "--lines-opacity needs lines or points: --lines FILE");
  expectSays(refusal({"--points", file("lines.csv"), "--line-width", "9px"}),
             "--line-width needs lines: --lines FILE");
  expectSays(refusal({"--lines", file("lines.csv"), "--point-size", "9px"}),
             "--point-size needs points: --points FILE");
  const auto damaged = [&](const std::string& from, const std::string& to) {
    std::string text = readTextFile(file("lines.vtp"));
    text.replace(text.find(from), from.size(), to);
    writeFileAtomically(file("wrong.vtp"), text);
    return refusal({"--lines", file("wrong.vtp")});
  };
  expectSays(damaged("ascii\">0 1 2", "ascii\">99 1 2"), "a cell refers to a point that does not exist");
  expectSays(damaged("50 60", "60 50"), "the offsets of its cells do not increase");
  expectSays(damaged("NumberOfLines=\"2\"", ""), "has no lines; --points draws the points of a file");
}

TEST_F(SurfaceOptions, ALineFromBehindTheViewerIsDrawnAsFarAsItIsSeen) {
  const auto drawn = [](const std::string& name, double begin) {
    writeFileAtomically(file(name), fmt::format("x,y,z,s,id\n{0},2.5,1,{0},1\n5,2.5,1,5,1\n"
                                                "50,90,90,5,2\n50,91,90,-100,2\n",
                                                begin));
    run({"render", file("wake.splats"), "-o", file("a.pfm"), "--size", "100x100", "--volume", "off",
         "--lines", file(name), "--lines-by", "s", "--line-width", "6px", "--position=-2,2.5,2.5",
         "--focal-point", "5,2.5,1.5", "--view-angle", "60"});
    return readImage(file("a.pfm"));
  };
  // Both are the same line where it is in sight, with the same colours.
  const Image near = drawn("near.csv", -1.5), far = drawn("far.csv", -100);
  EXPECT_GT(compareImages(near, far).psnr_db, 60);
  EXPECT_LT(compareImages(near, Image(near.size)).psnr_db, 40);
}

TEST_F(SurfaceOptions, AreDrawnThoughSplatsAreLargerThanSinglePrecision) {
  for (const Words& look : {Words{"--zoom", "1e25"}, Words{"--parallel-scale", "1e-30"}})
    for (const Words& what :
         {Words{"--slice", "4,0,2,0,1,0"}, Words{"--surface", "kmin"}, Words{"--iso", "0.3"}}) {
      if (look[0] != "--zoom" && !faults::isWholeSweep()) continue;
      const Image image = picture(look + what);
      EXPECT_TRUE(
          std::all_of(image.rgba.begin(), image.rgba.end(), [](float c) { return std::isfinite(c); }));
    }
}

TEST_F(SurfaceOptions, WarnsOfASliceThatMisses) {
  const ProgramResult result = run(render({"--slice", "0,0,900,0,0,1"}));
  EXPECT_TRUE(result.err.find("warning: --slice 0,0,900,0,0,1 misses the data, which lies in x ") !=
              std::string::npos)
      << result.err;
}

TEST_F(SurfaceOptions, WarnsOfLinesOutsideOfTheData) {
  writeFileAtomically(file("far.csv"), "x,y,z\n900,0,0\n901,0,0\n");
  writeFileAtomically(file("through.csv"), "x,y,z\n-900,0.5,0.5\n900,0.5,0.5\n");  // between its ends alone
  const ProgramResult far =
      run(render({"--lines", file("through.csv"), "--lines", file("far.csv"), "--points", file("far.csv")}));
  const std::string outside = ": all of it lies outside of the data, which has x ";
  EXPECT_NE(far.err.find("warning: --lines " + file("far.csv") + outside), std::string::npos) << far.err;
  EXPECT_NE(far.err.find("warning: --points " + file("far.csv") + outside), std::string::npos) << far.err;
  EXPECT_EQ(far.err.find("through.csv"), std::string::npos) << far.err;
}

TEST_F(SurfaceOptions, RefusesWrongUsage) {
  writeFileAtomically(*folder_ / "cut.stl", readTextFile(file("wall.obj")));
  const std::string cut = file("cut.stl"), sphere = file("sphere.obj");
  const struct {
    Words options;
    int status;
    std::string words;
  } refused[] = {
      {{"--slice", "0,0,0,0,0,0"}, 2, "--slice 0,0,0,0,0,0: the normal nx,ny,nz has no direction"},
      {{"--slice", "0,0,0"}, 2, "--slice 0,0,0: expected px,py,pz,nx,ny,nz"},
      {{"--slice", "0,0,0,0,0,1", "--slice-opacity", "0"}, 2, "--slice-opacity 0: expected a number above 0"},
      {{"--slice", "0,0,0,0,0,1", "--slice-opacity", "function0.5"},
       2,
       "function0.5: expected a number above 0 and at most 1, or function, or"},
      {{"--slice-opacity", "0.5"}, 2, "--slice-opacity needs a slice: --slice PX,PY,PZ,NX,NY,NZ"},
      {{"--volume", "off"},
       2,
       "--volume off leaves nothing to draw; give a --slice, a --surface, an --iso or --lines"},
      {{"--volume", "off", "--shade=2"}, 2, "--shade: takes no value (found '2')"},
      {{"--volume", "maybe"}, 2, "--volume maybe: expected on or off"},
      {{"--surface-colour", "#ff0000"}, 2, "--surface-colour needs a surface: --surface FILE"},
      {{"--surface", sphere, "--surface-colour", "red"},
       2,
       "--surface-colour red: expected #rrggbb such as #e07020, white or black"},
      {{"--surface", cut}, 1, cut + ": is truncated"},
      {{"--surface", file("none.stl")}, 1, file("none.stl")}};
  for (const auto& [options, status, words] : refused) {
    const ProgramResult result = runProgram(render(options, "refused.png"));
    EXPECT_EQ(result.status, status) << words << "\n" << result.err;
    expectSays(result.err, words);
    EXPECT_FALSE(std::filesystem::exists(file("refused.png")));
  }
  Words many;
  for (int n = 0; n < 9; ++n) many.insert(many.end(), {"--slice", "0,0,0,0,0,1"});
  expectSays(runProgram(render(many)).err, "--slice: given 9 times; a picture has at most 8 slices");
}

}  // namespace
}  // namespace curvisplat
