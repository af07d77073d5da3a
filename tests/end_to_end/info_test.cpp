// `curvisplat info` on caches and on grid files, as a person runs it, and what conversion says of the files.
// What it says of a format's own parts: see the readers' tests.
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include <cmath>
#include <filesystem>
#include <limits>
#include <sstream>
#include <string>
#include <vector>

#include "tests/support/program_test.h"
#include "tests/support/test_caches.h"

namespace curvisplat {
namespace {

class InfoOfACache : public ProgramTest {
 protected:
  InfoOfACache() { SmallCache().write(path); }

  const std::filesystem::path path = folder_ / "a.splats";
};

TEST_F(InfoOfACache, PrintsItForPeople) {
  const ProgramResult result = run({"info", path});
  for (const char* word : {"small", "a.xyz", "6000", "density [kg/m3]", "geometry.bin", "bricks.vdb"})
    expectSays(result.out, word);
}

/// The names are those that `render --surface` takes: each draws a picture.
TEST_F(InfoOfACache, ListsTheFacesThatSurfacesAreMadeOf) {
  run({"generate", "wake", "--size", "12x10x8", "-o", file("wake")});
  const std::string with = file("with.splats"), without = file("without.splats");
  run({"convert", file("wake.xyz"), file("wake.fun"), "-o", with, "--surface", "k=3"});
  expectSays(run({"info", with}).out, "\nfaces      all, jmax, jmin, kmax, kmin, block 1:k=3\n");
  const auto faces = nlohmann::json::parse(run({"info", with, "--json"}).out)["faces"];
  ASSERT_EQ(faces.size(), 6u);
  for (const std::string name : faces)
    run({"render", with, "--surface", name, "-o", file("p.png"), "--size", "16x16"});
  run({"convert", file("wake.xyz"), file("wake.fun"), "-o", without, "--no-surfaces"});
  EXPECT_EQ(run({"info", without}).out.find("\nfaces "), std::string::npos);
  EXPECT_TRUE(nlohmann::json::parse(run({"info", without, "--json"}).out)["faces"].empty());
}

TEST_F(InfoOfACache, PrintsOneJsonObject) {
  const ProgramResult result = runProgram({"info", path, "--json", "--verify", "--probe", "900,0,0"});
  EXPECT_EQ(result.status, 1);
  expectSays(result.err, "the point 900, 0, 0 is outside of the data, which lies in x ");
  const auto json = nlohmann::json::parse(result.out);
  EXPECT_EQ(json["bricks"], 10);
  EXPECT_EQ(json["bricks_by_level"].size(), 2u);
  EXPECT_EQ(json["bricks_by_level"][1]["leaves"], 9);
  EXPECT_EQ(json["bricks_by_level"][1]["splats"], json["splats"]);
  EXPECT_TRUE(json["findings"].empty());
  EXPECT_TRUE(json["probe"].is_null());
  uint64_t bytes = 0;
  for (const auto& file : json["files"]) bytes += file["size"].get<uint64_t>();
  EXPECT_EQ(json["bytes"], bytes);
}

TEST_F(InfoOfACache, ProbesANode) {
  SmallCache cache;
  cache.write(folder_ / "b.splats");
  const glm::dvec3 at = cache.leaves[4].splats[10].position;
  const std::string point = fmt::format("{},{},{}", at.x, at.y, at.z);
  const ProgramResult text = run({"info", folder_ / "b.splats", "--probe=" + point});
  EXPECT_TRUE(text.out.starts_with(point.substr(0, point.find(',')))) << text.out;
  EXPECT_EQ(lineCount(text.out), 3) << "the probe and nothing else: " << text.out;
  EXPECT_NE(text.out.substr(0, text.out.find('\n')).find("(counted from 0), the middle of whose cell is at "),
            std::string::npos)
      << text.out;
  const ProgramResult result = runProgram({"info", folder_ / "b.splats", "--json", "--probe=" + point});
  const auto probe = nlohmann::json::parse(result.out)["probe"];
  ASSERT_TRUE(probe.is_object()) << result.out;
  EXPECT_LT(probe["distance"], 0.1);
  EXPECT_EQ(probe["values"].size(), 2u);
  EXPECT_EQ(probe["values"][1]["name"], "mach");
}

TEST_F(InfoOfACache, ProbesAFileOfPoints) {
  SmallCache cache;
  cache.write(folder_ / "b.splats");
  const glm::dvec3 at = cache.leaves[4].splats[10].position;
  overwriteFile(folder_ / "points.csv", fmt::format("x,y,z\n{},{},{}\n900 0 0\n", at.x, at.y, at.z));
  const ProgramResult table = run({"info", folder_ / "b.splats", "--probe", folder_ / "points.csv"});
  const ProgramResult one =
      runProgram({"info", folder_ / "b.splats", "--json", fmt::format("--probe={},{},{}", at.x, at.y, at.z)});
  const auto values = nlohmann::json::parse(one.out)["probe"]["values"];
  EXPECT_EQ(lineCount(table.out), 3) << table.out;
  expectSays(table.out,
             "x,y,z,density,mach,block,i,j,k,sample_x,sample_y,sample_z,sample_density,sample_mach\n");
  expectSays(table.out,
             fmt::format(",{},{},1,", values[0]["value"].get<float>(), values[1]["value"].get<float>()));
  expectSays(table.out, "900,0,0,,,,,,,,,,,\n");
  overwriteFile(folder_ / "points.csv", "0,0,0\n1,2\n");
  expectRefused({"info", folder_ / "b.splats", "--probe", folder_ / "points.csv"}, 1,
                {"points.csv", "line 2"});
}

/// Nodes of a lattice, and x: a point that is more than a quarter of a cell beyond a border is outside.
TEST_F(InfoOfACache, EndsAtTheBordersOfTheGrid) {
  std::string values;
  for (int n = 0; n < 6 * 6 * 6; ++n) values += fmt::format("{}\n", n % 6);
  overwriteFile(
      folder_ / "x.vtk",
      "# vtk DataFile Version 3.0\nx\nASCII\nDATASET STRUCTURED_POINTS\nDIMENSIONS 6 6 6\nORIGIN 0 0 0\n"
      "SPACING 1 1 1\nPOINT_DATA 216\nSCALARS f float 1\nLOOKUP_TABLE default\n" +
          values);
  run({"convert", folder_ / "x.vtk", "-o", folder_ / "x.splats", "--refine", "1"});
  const auto statusAt = [&](double along, int axis) {
    glm::dvec3 at(2.3, 1.6, 3.2);
    at[axis] = along;
    return runProgram({"info", folder_ / "x.splats", fmt::format("--probe={},{},{}", at.x, at.y, at.z)})
        .status;
  };
  for (int axis = 0; axis < 3; ++axis)
    for (const auto& [along, status] :
         {std::pair(0.02, 0), {4.98, 0}, {-0.3, 1}, {5.3, 1}, {-0.4, 1}, {5.4, 1}})
      EXPECT_EQ(statusAt(along, axis), status) << along << " along " << axis;
  const auto probe =
      nlohmann::json::parse(run({"info", folder_ / "x.splats", "--json", "--probe=-0.03,2,2"}).out)["probe"];
  EXPECT_EQ(probe["values"][0]["value"], 0);
}

/// Nodes of a sheared, bent lattice, and a scalar that is linear in i, j and k: trilinear in the cells, exactly.
TEST_F(InfoOfACache, ProbesTheFilesCells) {
  const auto place = [](double i, double j, double k) {
    return glm::dvec3(i + 0.2 * j * k, 0.7 * j + 0.05 * i * k, 0.3 * k + 0.02 * i * j);
  };
  std::string vts =
      "<VTKFile type=\"StructuredGrid\"><StructuredGrid WholeExtent=\"0 9 0 7 0 5\"><Piece Extent=\"0 9 0 7 "
      "0 "
      "5\"><Points><DataArray type=\"Float64\" NumberOfComponents=\"3\" format=\"ascii\">";
  std::string values;
  for (int k = 0; k < 6; ++k)
    for (int j = 0; j < 8; ++j)
      for (int i = 0; i < 10; ++i) {
        const glm::dvec3 at = place(i, j, k);
        vts += fmt::format("{} {} {}\n", at.x, at.y, at.z);
        values += fmt::format("{}\n", i + 10 * j + 100 * k + 50 * i * j * k);
      }
  vts += "</DataArray></Points><PointData><DataArray type=\"Float64\" Name=\"f\" format=\"ascii\">" + values +
         "</DataArray></PointData></Piece></StructuredGrid></VTKFile>";
  overwriteFile(folder_ / "bent.vts", vts);
  run({"convert", folder_ / "bent.vts", "-o", folder_ / "bent.splats"});
  const double i = 3.3, j = 4.1, k = 2.9;
  // Where the cell's map takes these local coordinates: products of the three are trilinear, too.
  const glm::dvec3 at = place(i, j, k);
  const std::string point = fmt::format("{},{},{}", at.x, at.y, at.z);
  const auto probe = nlohmann::json::parse(
      run({"info", folder_ / "bent.splats", "--json", "--probe=" + point, "--source"}).out)["probe"];
  EXPECT_NEAR(probe["values"][0]["value"], i + 10 * j + 100 * k + 50 * i * j * k, 1e-6);
  EXPECT_EQ(probe["values"][0]["mean"], 3 + 40 + 300 + 50 * 36);
  EXPECT_EQ(probe["i"], 3);
  EXPECT_EQ(probe["j"], 4);
  EXPECT_EQ(probe["k"], 3);
  EXPECT_NEAR(probe["place"][0], place(3, 4, 3).x, 1e-9);

  const ProgramResult line = run({"info", folder_ / "bent.splats", "--probe-line", "-9,2,1", point, "5",
                                  "--source", folder_ / "bent.vts", "-o", folder_ / "line.png"});
  EXPECT_EQ(lineCount(line.out), 6) << line.out;
  expectSays(line.out, "-9,2,1,,,,,,,,,,0\n");
  EXPECT_TRUE(bytesOfFile(folder_ / "line.png").starts_with("\x89PNG"));

  SmallCache().write(folder_ / "other.splats");
  expectRefused({"info", folder_ / "other.splats", "--probe=" + point, "--source", folder_ / "bent.vts"}, 1,
                {"bent.vts"});
  std::filesystem::remove(folder_ / "bent.vts");
  expectRefused({"info", folder_ / "bent.splats", "--probe=" + point, "--source"}, 1,
                {"bent.splats", "name them after --source"});
}

/// An ASCII .vts of 9 x 9 x 9 nodes at whole numbers.
std::string cubeWith(double (*value)(double x, double y, double z, int step), int step) {
  std::string points, values;
  for (int n = 0; n < 729; ++n) {
    const int x = n % 9, y = n / 9 % 9, z = n / 81;
    points += fmt::format("{} {} {}\n", x, y, z);
    values += fmt::format("{}\n", value(x, y, z, step));
  }
  const std::string extent = "Extent=\"0 8 0 8 0 8\">";
  return "<VTKFile type=\"StructuredGrid\"><StructuredGrid Whole" + extent + "<Piece " + extent +
         "<Points><DataArray type=\"Float64\" NumberOfComponents=\"3\" format=\"ascii\">" + points +
         "</DataArray></Points><PointData><DataArray type=\"Float64\" Name=\"f\" format=\"ascii\">" + values +
         "</DataArray></PointData></Piece></StructuredGrid></VTKFile>";
}

/// The column of a table, without its heading; where it is empty, NaN.
std::vector<double> columnOf(const std::string& table, const std::string& name) {
  std::istringstream lines(table);
  std::string line, field;
  std::vector<double> column;
  size_t wanted = 0;
  for (bool heading = true; std::getline(lines, line); heading = false) {
    std::istringstream fields(line);
    for (size_t n = 0; std::getline(fields, field, ','); ++n) {
      if (heading && field == name) wanted = n;
      if (!heading && n == wanted)
        column.push_back(field.empty() ? std::numeric_limits<double>::quiet_NaN() : std::stod(field));
    }
  }
  return column;
}

TEST_F(InfoOfACache, ProbesAllStepsOfASeries) {
  const auto linear = [](double x, double y, double z, int step) {
    return (1 + step) * x + 10 * y - z + 100 * step;
  };
  Words convert{"convert"};
  for (int step = 0; step < 4; ++step) {
    const std::filesystem::path file = folder_ / fmt::format("run_{}.vts", step);
    overwriteFile(file, cubeWith(linear, step));
    convert.push_back(file);
  }
  run(convert + Words{"-o", folder_ / "run.splats"});
  const auto valuesOf = [&](const Words& options) {
    return columnOf(run(Words{"info", folder_ / "run.splats"} + options).out, "f");
  };
  const std::vector<double> all = valuesOf({"--probe", "3.25,4.5,2.75", "--steps", "all"});
  ASSERT_EQ(all.size(), 4u);
  for (int step = 0; step < 4; ++step)
    EXPECT_NEAR(all[static_cast<size_t>(step)], linear(3.25, 4.5, 2.75, step), 0.05) << step;
  const std::vector<double> some = valuesOf({"--probe", "3.25,4.5,2.75", "--steps", "1:3:2"});
  EXPECT_EQ(some, (std::vector<double>{all[1], all[3]}));
  EXPECT_EQ(valuesOf({"--probe-line", "1,1,1", "7,7,7", "5", "--steps", "2:3"}).size(), 10u);
}

/// Errors that `info` states bound those of values along a line, against the same line at full precision.
TEST_F(InfoOfACache, ErrorsAreThoseOfItsValues) {
  overwriteFile(folder_ / "f.vts",
                cubeWith([](double x, double y, double z,
                            int) { return 100 * std::sin(0.7 * x) * std::cos(0.4 * y) + 3 * z * z; },
                         0));
  nlohmann::json said;
  std::vector<double> values[2], samples[2];
  for (const bool fine : {false, true}) {
    const std::filesystem::path cache = folder_ / (fine ? "fine.splats" : "normal.splats");
    run({"convert", folder_ / "f.vts", "-o", cache, "--value-precision", fine ? "fine" : "normal"});
    const std::string table = run({"info", cache, "--probe-line", "0.1,0.2,0.3", "7.9,7.8,7.7", "2000"}).out;
    values[fine] = columnOf(table, "f");
    samples[fine] = columnOf(table, "sample_f");
    if (!fine) said = nlohmann::json::parse(run({"info", cache, "--json"}).out);
  }
  const auto& range = said["picture_errors"][0]["range"];
  const double width = range[1].get<double>() - range[0].get<double>();
  EXPECT_GT(width, 100);
  double largest = 0, squares = 0, of_samples = 0;
  for (size_t n = 0; n < values[0].size(); ++n) {
    const double error = std::abs(values[0][n] - values[1][n]);
    largest = std::max(largest, error);
    squares += error * error / static_cast<double>(values[0].size());
    of_samples = std::max(of_samples, std::abs(samples[0][n] - samples[1][n]));
  }
  EXPECT_GT(largest, 0);
  EXPECT_LE(largest, said["picture_errors"][0]["largest"].get<double>() * width);
  // Neighbours' errors even out in part.
  const double typical = said["picture_errors"][0]["typical"].get<double>() * width;
  EXPECT_LT(std::sqrt(squares), typical);
  EXPECT_GT(std::sqrt(squares), 0.1 * typical);
  EXPECT_LE(of_samples, 1.05 * said["stored_errors"][0]["values"]["largest"].get<double>());
  EXPECT_GE(of_samples, 0.5 * said["stored_errors"][0]["values"]["largest"].get<double>());
}

/// A long tail, at the precision of which values between 0 and 1 are rounded to a few numbers.
TEST_F(InfoOfACache, StepsThatAreTooWideAreWarnedOf) {
  std::string vts =
      "<VTKFile type=\"StructuredGrid\"><StructuredGrid WholeExtent=\"0 19 0 19 0 19\"><Piece Extent=\"0 19 "
      "0 19 0 "
      "19\"><Points><DataArray type=\"Float64\" NumberOfComponents=\"3\" format=\"ascii\">";
  std::string values;
  for (int n = 0; n < 8000; ++n) {
    vts += fmt::format("{} {} {}\n", n % 20, n / 20 % 20, n / 400);
    values += fmt::format("{}\n", n == 4210 ? 1e5 : 0.05 * (n % 20) + 0.001 * (n / 400));
  }
  vts += "</DataArray></Points><PointData><DataArray type=\"Float64\" Name=\"f\" format=\"ascii\">" + values +
         "</DataArray></PointData></Piece></StructuredGrid></VTKFile>";
  overwriteFile(folder_ / "tail.vts", vts);
  for (const std::string precision : {"normal", "auto"}) {
    run({"convert", folder_ / "tail.vts", "-o", folder_ / (precision + ".splats"), "--value-precision",
         precision});
    for (const Words& asked : {Words{"--iso", "0.5"}, Words{"--range", "0.2,0.8"},
                               Words{"--range", "0,1e5", "--asinh", "0.5,0.3"}}) {
      const ProgramResult picture = run(Words{"render", folder_ / (precision + ".splats"), "-o",
                                              folder_ / "p.png", "--size", "32x32", "--tf", "viridis"} +
                                        asked);
      const bool warned = picture.err.find("its stored values, ") != std::string::npos;
      EXPECT_EQ(warned, precision == "normal") << picture.err;
      if (!warned) continue;
      expectSays(picture.err, "convert again with --value-precision auto or fine");
      if (asked.back() == "0.5,0.3") expectSays(picture.err, "the linear part of asinh");
    }
  }
}

TEST_F(InfoOfACache, VerifyFindsDamage) {
  std::string bytes = bytesOfFile(path / "var.1.bin");
  bytes[200] ^= 8;
  overwriteFile(path / "var.1.bin", bytes);
  run({"info", path});
  const ProgramResult result = runProgram({"info", path, "--verify"});
  EXPECT_EQ(result.status, 1);
  expectSays(result.out, "finding: ");
  EXPECT_EQ(lineCount(result.err), 1) << result.err;
}

TEST_F(InfoOfACache, RefusesInOneLine) {
  std::filesystem::create_directory(folder_ / "empty");
  for (const std::string name : {"empty", "missing"}) expectRefused({"info", folder_ / name}, 1, {name});
  EXPECT_EQ(runProgram({"info", path, "--probe", "1,2"}).status, 2);
  EXPECT_EQ(runProgram({"info", path, "solution.q"}).status, 2);
}

class InfoGrid : public ProgramTest {
 protected:
  static std::string shared(const std::string& name) {
    return (std::filesystem::path(CURVISPLAT_SHARED_DATA) / name).string();
  }
  void SetUp() override {
    if (!std::filesystem::is_directory(CURVISPLAT_SHARED_DATA))
      GTEST_SKIP() << "needs " << CURVISPLAT_SHARED_DATA;
  }
  static bool contains(const std::string& text, const std::string& part) {
    return text.find(part) != std::string::npos;
  }
};

TEST_F(InfoGrid, PrintsAllProperties) {
  const Words files{shared("bluntfin/bluntfinxyz.bin"), shared("bluntfin/bluntfinq.bin")};
  const ProgramResult text = run({"info", files[0], files[1]});
  for (const char* part :
       {"40x32x32, 39 degenerate cells", "cells     37479; 39 degenerate", "single precision",
        "scalar    density (100): 0.1", "vorticity_magnitude (211)", "Mach 2.95", "estimate"})
    EXPECT_TRUE(contains(text.out, part)) << part << "\n" << text.out;
  const ProgramResult result = runProgram({"info", files[0], files[1], "--json"});
  const auto json = nlohmann::json::parse(result.out);
  EXPECT_EQ(json["cells"]["degenerate"], 39);
  EXPECT_EQ(json["blocks"][0]["nk"], 32);
  EXPECT_EQ(json["scalars"].size(), 5u);
  EXPECT_EQ(json["derived"].size(), 19u);
  EXPECT_EQ(json["estimate"]["splats"], 40960);
  EXPECT_GT(json["estimate"]["seconds"], 0);
  EXPECT_TRUE(json["overlaps"].empty());
}

TEST_F(InfoGrid, InfoAndConvertReportOverlaps) {
  const std::string overlapping = shared("overset/cylinder_chimera_overlapping_singledonor.x");
  const ProgramResult info = run({"info", overlapping, "--json"});
  EXPECT_FALSE(nlohmann::json::parse(info.out)["overlaps"].empty());
  EXPECT_TRUE(contains(runProgram({"info", overlapping}).out, "each point is drawn once"))
      << "as convert does";
  const ProgramResult converted =
      run({"convert", overlapping, "-o", folder_ / "o.splats", "--scalar", "volume"});
  EXPECT_TRUE(contains(converted.err, "note: blocks overlap in about ")) << converted.err;
  EXPECT_TRUE(contains(converted.err, "each point is drawn once")) << converted.err;
  const ProgramResult all =
      run({"convert", overlapping, "-o", folder_ / "all.splats", "--scalar", "volume", "--overlap", "all"});
  EXPECT_TRUE(contains(all.err, "warning: blocks overlap in about ")) << all.err;
  const ProgramResult abutting = run({"convert", shared("overset/cylinder_chimera_abutting.x"), "-o",
                                      folder_ / "a.splats", "--scalar", "k"});
  EXPECT_FALSE(contains(abutting.err, "overlap")) << abutting.err;
}

// Every PLOT3D file converts, or is refused for a stated reason.
TEST_F(InfoGrid, EveryPlot3dFileConvertsOrIsRefusedWithAReason) {
  const struct {
    Words files;
    std::string scalar;   // "": none is named
    std::string refusal;  // "": converts
  } cases[] = {
      {{"plot3d_multi/multi.p3d"}, "", ""},
      {{"plot3d_multi/test.p3d"}, "", "combxyz.bin, which does not exist"},
      {{"plot3d_multi/mbwavelet_ascii.xyz", "plot3d_multi/mbwavelet_ascii.q"}, "112", ""},
      {{"plot3d_multi/multi-ascii.xyz", "plot3d_multi/multi-ascii.q"}, "pressure", ""},
      {{"plot3d_multi/multi-bin-C.xyz", "plot3d_multi/multi-bin-C.q"}, "211", ""},
      {{"plot3d_multi/multi-bin.xyz", "plot3d_multi/multi-bin.q"}, "density", ""},
      {{"plot3d_multi/multi-bin.xyz", "plot3d_multi/multi-bin-oflow.q"}, "q_criterion", ""},
      {{"plot3d_multi/multi-bin-2D.xyz", "plot3d_multi/multi-bin-2D.q"}, "", "2-D"},
      {{"combustor/combxyz.bin", "combustor/combq.bin"}, "velocity_magnitude", ""},
      {{"lox_post/postxyz.bin", "lox_post/postq.bin"}, "vorticity_magnitude", ""},
      {{"nek/leadingEdge_block.xyz"}, "jacobian", ""},
      {{"nek/leadingEdge_block.xyz"}, "", "choose a derived one with --scalar"},
      {{"nek/leadingEdge_block.xyz", "nek/leadingEdge_block.fun"}, "", "number of variables is missing"},
      {{"fortran/sduct.new.x.bin"}, "j", ""},
      {{"delta_wing/delta_cfl3d.fmt"}, "volume", ""},
  };
  for (const auto& one : cases) {
    Words arguments{"convert"};
    for (const std::string& file : one.files) arguments.push_back(shared(file));
    arguments.insert(arguments.end(), {"-o", folder_ / "c.splats", "--overwrite"});
    if (!one.scalar.empty()) arguments.insert(arguments.end(), {"--scalar", one.scalar});
    const ProgramResult result = runProgram(arguments);
    SCOPED_TRACE(one.files.back() + " " + one.scalar + ": " + result.err);
    EXPECT_EQ(result.status, one.refusal.empty() ? 0 : 1);
    EXPECT_TRUE(contains(result.err, one.refusal));
    EXPECT_FALSE(contains(result.err, "overlap"));
  }
}

}  // namespace
}  // namespace curvisplat
