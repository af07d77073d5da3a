// Series of every format that has time steps: each step must be what converting that step alone gives.
#include <gtest/gtest.h>

#include <array>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "preprocess/formats/open/open_grid.h"
#include "preprocess/formats/open/series_files.h"
#include "stream/cache/cache_reader.h"
#include "stream/cache/cache_verify.h"
#include "tests/support/cgns_writer.h"
#include "tests/support/earth_files.h"
#include "tests/support/expect_error.h"
#include "tests/support/faulty_system_calls.h"
#include "tests/support/netcdf_writer.h"
#include "tests/support/program_test.h"
#include "tests/support/vts_writer.h"

namespace curvisplat {
namespace {

namespace fs = std::filesystem;

class SeriesFormats : public ProgramTest {
 protected:
  /// Converts `series` to a.splats with --steps all and compares step n with what `alone(n)` names.
  template <typename Alone>
  void expectEachAsAlone(const std::string& series, const std::vector<uint32_t>& geometries,
                         const Alone& alone, const Words& more = {}) {
    run(Words{"convert", series, "--steps", "all", "-o", file("a.splats"), "--overwrite"} + more);
    const CacheReader cache(file("a.splats"));
    ASSERT_EQ(cache.series().steps.size(), geometries.size());
    for (size_t step = 0; step < geometries.size(); ++step) {
      SCOPED_TRACE(step);
      EXPECT_EQ(cache.series().steps[step].geometry, geometries[step]);
      run(Words{"convert"} + alone(step) + Words{"-o", file("b.splats"), "--overwrite"} + more);
      const CacheReader found = cache.atStep(step), wanted(file("b.splats"));
      for (const std::string& finding : verifyCache(found).findings) ADD_FAILURE() << finding;
      expectSame(found, wanted);
    }
  }

  static void expectSame(const CacheReader& found, const CacheReader& wanted) {
    ASSERT_EQ(found.bricks().size(), wanted.bricks().size());
    EXPECT_EQ(found.manifest().blanked_nodes, wanted.manifest().blanked_nodes);
    SplatGeometry geometry, wanted_geometry;
    SplatVariable values, wanted_values;
    for (uint32_t brick = 0; brick < wanted.bricks().size(); ++brick) {
      found.readGeometry(brick, geometry);
      wanted.readGeometry(brick, wanted_geometry);
      EXPECT_EQ(geometry.x, wanted_geometry.x);
      EXPECT_EQ(geometry.border_code, wanted_geometry.border_code);
      for (size_t v = 0; v < wanted.manifest().variables.size(); ++v) {
        EXPECT_EQ(found.manifest().variables[v].min, wanted.manifest().variables[v].min);
        found.readVariable(brick, v, values);
        wanted.readVariable(brick, v, wanted_values);
        EXPECT_EQ(values.mean, wanted_values.mean);
        EXPECT_EQ(values.slope2, wanted_values.slope2);
        EXPECT_EQ(values.variance, wanted_values.variance);
      }
    }
  }
};

TEST_F(SeriesFormats, TimeDimensionOfNetcdf) {
  nemo::write(file("nemo.nc"), NetcdfFileType::kNetcdf4, false);
  expectEachAsAlone(file("nemo.nc"), {0, 0, 0}, [&](size_t step) {
    return Words{file("nemo.nc"), "--time-step", std::to_string(step)};
  });
  // Levels that follow the surface move with it.
  roms::write(file("roms.nc"), NetcdfFileType::kClassic, "ocean_s_coordinate_g2");
  expectEachAsAlone(file("roms.nc"), {0, 1},
                    [&](size_t step) {
                      return Words{file("roms.nc"), "--time-step", std::to_string(step)};
                    },
                    {"--scalar", "temp"});
}

/// A history of a grid that has a file of its own; `times` in `unit`.
void writeHistory(const std::string& path, const std::vector<double>& times,
                  const std::string& unit = "days since 2000-01-01") {
  NetcdfWriter writer(path, NetcdfFileType::kClassic);
  writer.dimension("time", times.size(), true);
  for (const auto& [name, length] : {std::pair("z", 5), {"y", 6}, {"x", 7}})
    writer.dimension(name, static_cast<size_t>(length));
  writer.variable("time", NetcdfNumbers::kDoublePrecision, {"time"}, {{"units", unit}},
                  [&](const std::vector<size_t>& at) { return times[at[0]]; });
  writer.variable("temp", NetcdfNumbers::kSinglePrecision, {"time", "z", "y", "x"},
                  {{"coordinates", "lon lat z"}}, [&](const std::vector<size_t>& at) {
                    return times[at[0]] + static_cast<double>(at[1] + at[2] * at[3]);
                  });
}

/// The grid of these; with `times`, which are not those of the histories.
void writeGrid(const std::string& path, const std::vector<double>& times = {}) {
  NetcdfWriter writer(path, NetcdfFileType::kClassic);
  for (const auto& [name, length] : {std::pair("z", 5), {"y", 6}, {"x", 7}})
    writer.dimension(name, static_cast<size_t>(length));
  const auto degrees = [](const char* name, const char* unit) {
    return NetcdfAttributes{{"standard_name", name}, {"units", unit}};
  };
  writer.variable("lon", NetcdfNumbers::kDoublePrecision, {"y", "x"}, degrees("longitude", "degrees_east"),
                  [](const std::vector<size_t>& at) {
                    return static_cast<double>(at[1]) + 0.1 * static_cast<double>(at[0]);
                  });
  writer.variable("lat", NetcdfNumbers::kDoublePrecision, {"y", "x"}, degrees("latitude", "degrees_north"),
                  [](const std::vector<size_t>& at) { return 40 + static_cast<double>(at[0]); });
  writer.variable("z", NetcdfNumbers::kDoublePrecision, {"z"},
                  {{"units", "m"}, {"positive", "down"}, {"axis", "Z"}},
                  [](const std::vector<size_t>& at) { return 10 * static_cast<double>(at[0]); });
  if (times.empty()) return;
  writer.dimension("time", times.size());
  writer.variable("time", NetcdfNumbers::kDoublePrecision, {"time"}, {{"units", "days since 1900-01-01"}},
                  [&](const std::vector<size_t>& at) { return times[at[0]]; });
}

TEST_F(SeriesFormats, NetcdfGridWithHistoryFilesOneAfterTheOther) {
  writeGrid(file("grid.nc"));
  writeHistory(file("his_0001.nc"), {0, 1});
  writeHistory(file("his_0002.nc"), {2, 3.5});
  expectEachAsAlone(
      file("his_*.nc"), {0, 0, 0, 0},
      [&](size_t step) {
        return Words{file(step < 2 ? "his_0001.nc" : "his_0002.nc"), "--time-step", std::to_string(step % 2)};
      },
      {file("grid.nc")});
  EXPECT_EQ(CacheReader(file("a.splats")).series().steps[3].time, 3.5);

  // A restart that went back: the file and its step are named. Flat, since on the sphere there is a warning, too.
  writeHistory(file("his_0003.nc"), {4, 3});
  expectRefused({"convert", file("grid.nc"), file("his_0001.nc"), file("his_0002.nc"), file("his_0003.nc"),
                 "--steps", "all", "--flat", "-o", file("c.splats")},
                1, {"step 5", "his_0003.nc, time step 1", "its time 3 is not after 4"});
  EXPECT_EQ(CacheReader(file("c.splats")).series().steps.size(), 5u);
}

/// Times of the steps of a cache.
std::vector<double> timesOf(const std::string& cache) {
  std::vector<double> times;
  const CacheReader reader(cache);
  for (const SeriesStep& step : reader.series().steps) times.push_back(step.time);
  return times;
}

TEST_F(SeriesFormats, FilesThatCountTheirTimesFromOtherDates) {
  writeGrid(file("grid.nc"));
  writeHistory(file("his_0001.nc"), {0, 1});
  writeHistory(file("his_0002.nc"), {0, 36}, "hours since 2000-01-03 00:00:00");
  run({"convert", file("his_*.nc"), file("grid.nc"), "-o", file("a.splats")});
  EXPECT_EQ(timesOf(file("a.splats")), (std::vector<double>{0, 1, 2, 3.5}));
  EXPECT_EQ(CacheReader(file("a.splats")).seriesManifest().time_unit, "days since 2000-01-01");
  const ProgramResult info = runProgram({"info", file("a.splats")});
  expectSays(info.out, "3.5  2000-01-04 12:00:00         0");
  // Added later, resumed, and in parts.
  run({"convert", file("his_0001.nc"), file("grid.nc"), "--steps", "all", "-o", file("b.splats")});
  run({"convert", file("his_0002.nc"), file("grid.nc"), "--add-steps", "--to", file("b.splats")});
  run({"convert", file("his_*.nc"), file("grid.nc"), "--resume", "-o", file("b.splats")});
  EXPECT_EQ(timesOf(file("b.splats")), timesOf(file("a.splats")));
  for (const char* part : {"1/2", "2/2"})
    run({"convert", file("his_*.nc"), file("grid.nc"), "--part", part, "-o", file("c.splats")});
  run({"convert", file("c.splats.parts"), "--join", "-o", file("c.splats")});
  EXPECT_EQ(timesOf(file("c.splats")), timesOf(file("a.splats")));

  writeHistory(file("his_0003.nc"), {5, 6}, "months since 2000-01-01");
  expectRefused({"convert", file("his_0003.nc"), file("grid.nc"), "--add-steps", "--to", file("a.splats")}, 1,
                {"step 4",
                 "its times are in 'months since 2000-01-01', which cannot be converted to 'days "
                 "since 2000-01-01', the unit of the steps before it"});
}

TEST_F(SeriesFormats, PartsOfTextFilesKeepTheirNumbersBesideTheCache) {
  for (const char* name : {"c_0.vts", "c_1.vts"})
    std::ofstream(file(name)) << vtsFile(annulusVtsGrid(5, 4, 3), {.format = VtsEncoding::Format::kAscii});
  for (const char* part : {"1/2", "2/2"})
    run({"convert", file("c_*.vts"), "--part", part, "-o", file("c.splats")});
  run({"convert", file("c.splats.parts"), "--join", "-o", file("c.splats")});
  EXPECT_EQ(timesOf(file("c.splats")).size(), 2u);
}

TEST_F(SeriesFormats, TimesAreThoseOfTheDataNotOfAGridFile) {
  writeHistory(file("his_0001.nc"), {1, 2});
  writeHistory(file("his_0002.nc"), {4});
  for (const std::vector<double>& times : {std::vector<double>{7}, {7, 8}, {7, 8, 9}}) {
    writeGrid(file("grid.nc"), times);
    for (const bool grid_first : {true, false}) {
      const Words files = grid_first ? std::vector{file("grid.nc"), file("his_*.nc")}
                                     : std::vector{file("his_*.nc"), file("grid.nc")};
      run({"convert", files[0], files[1], "-o", file("a.splats"), "--overwrite"});
      EXPECT_EQ(timesOf(file("a.splats")), (std::vector<double>{1, 2, 4})) << times.size() << grid_first;
      EXPECT_EQ(CacheReader(file("a.splats")).seriesManifest().time_unit, "days since 2000-01-01");
    }
  }
}

TEST_F(SeriesFormats, FilesHoldDifferentNumbersOfSteps) {
  writeGrid(file("grid.nc"));
  writeHistory(file("his_0001.nc"), {0});  // such as the state that a run begins with
  writeHistory(file("his_0002.nc"), {1, 2});
  writeHistory(file("his_0003.nc"), {3, 4, 5});
  for (const auto& entry : fs::directory_iterator(folder_.path()))
    fs::last_write_time(entry.path(), fs::file_time_type::clock::now() - std::chrono::hours(1));
  run({"convert", file("his_*.nc"), file("grid.nc"), "-o", file("a.splats")});
  EXPECT_EQ(timesOf(file("a.splats")), (std::vector<double>{0, 1, 2, 3, 4, 5}));
  // Followed, stopped within a file, and followed again.
  Words follow{"convert", file("his_*.nc"), file("grid.nc"), "--follow", "--until", "2",
               "-o",      file("b.splats")};
  run(follow);
  EXPECT_EQ(timesOf(file("b.splats")), (std::vector<double>{0, 1}));
  follow[5] = "6";
  follow.push_back("--resume");
  run(follow);
  EXPECT_EQ(timesOf(file("b.splats")), timesOf(file("a.splats")));

  // One that cannot be opened is left out like any other step.
  fs::resize_file(file("his_0002.nc"), 100);
  const Words broken{"convert", file("his_*.nc"), file("grid.nc"), "-o", file("c.splats")};
  const ProgramResult stopped = runProgram(broken);
  EXPECT_EQ(stopped.status, 1);
  expectSays(stopped.err, "step 1 (" + file("his_0002.nc") + ")");
  run({"convert", file("his_*.nc"), file("grid.nc"), "-o", file("d.splats"), "--keep-going"});
  EXPECT_EQ(timesOf(file("d.splats")), (std::vector<double>{0, 3, 4, 5}));
}

TEST_F(SeriesFormats, BaseIterativeDataOfCgns) {
  {
    CgnsWriter writer(file("a.cgns"), CgnsFileType::kHdf5);
    const auto field = [](const char* name, double of_i, double of_j, double of_k, double add) {
      return CgnsWriterField{name, [=](int64_t i, int64_t j, int64_t k) {
                               return of_i * static_cast<double>(i) + of_j * static_cast<double>(j * j) +
                                      of_k * static_cast<double>(k) + add;
                             }};
    };
    writer.base("base");
    writer.zone("zone", {6, 5, 4});
    for (const double shift : {0.0, 0.25})
      writer.coordinates(shift == 0 ? "GridCoordinates" : "Moved",
                         {field("CoordinateX", 1, 0.01, 0, shift), field("CoordinateY", 0, 0.5, 0.1, 0),
                          field("CoordinateZ", 0, 0, 1, 0)});
    for (const int step : {0, 1, 2})
      writer.solution("step" + std::to_string(step), "Vertex",
                      {field("Density", 0.1 * step, 0.2, 0.3, step)});
    writer.baseSteps({0.5, 1, 1.5});
    writer.zoneSteps({"step0", "step1", "step2"}, {"GridCoordinates", "GridCoordinates", "Moved"});
  }
  expectEachAsAlone(file("a.cgns"), {0, 0, 1}, [&](size_t step) {
    return Words{file("a.cgns"), "--time-step", std::to_string(step)};
  });
  EXPECT_EQ(CacheReader(file("a.splats")).series().steps[2].time, 1.5);
}

TEST_F(SeriesFormats, ZonesOfCgnsThatChangeAreNamedOrLeftOut) {
  const auto write = [&](const std::vector<Words>& zones) {
    CgnsWriter writer(file("a.cgns"), CgnsFileType::kHdf5);
    const auto field = [](const char* name, double i, double j, double k) {
      return CgnsWriterField{name, [=](int64_t at_i, int64_t at_j, int64_t at_k) {
                               return i * static_cast<double>(at_i) + j * static_cast<double>(at_j) +
                                      k * static_cast<double>(at_k);
                             }};
    };
    writer.base("base");
    writer.baseSteps({0.5, 1, 1.5, 2}, zones);
    for (const char* name : {"Always", "Later", "Other"}) {
      writer.zone(name, {6, 5, name[0] == 'O' ? 3 : 4});
      writer.coordinates("GridCoordinates", {field("CoordinateX", 1, 0, 0), field("CoordinateY", 0, 1, 0),
                                             field("CoordinateZ", 0, 0, 1)});
      writer.solution("Only", "Vertex", {field("Density", 1, 2, 3)});
    }
  };
  const Words words{"convert",        file("a.cgns"), "--steps",  "all",    "-o",
                    file("a.splats"), "--overwrite",  "--scalar", "Density"};
  const std::string other =
      "a cache holds steps of the same blocks: convert the others to a cache of their own";
  const Words always{"Always", "Null"}, both{"Always", "Later"};
  struct Case {
    std::vector<Words> zones;
    std::string told;
  };
  for (const auto& [zones, told] :
       {Case{{always, always, both, always}, "it has 2 blocks (new: Later); the steps before it have 1; "},
        Case{{both, both, always, both}, "it has 1 block; the steps before it have 2 (now gone: Later); "},
        Case{{{"Later"}, {"Later"}, {"Other"}, {"Later"}},
             "its block 1 (Other) has 6x5x3 nodes; in the steps before it 6x5x4; "}}) {
    SCOPED_TRACE(told);
    write(zones);
    expectRefused(words, 1,
                  {std::string("step 2 (") + file("a.cgns") + ", time step 2) cannot be converted: ", told,
                   other, std::string("; the cache has 2 steps; --keep-going leaves out such steps")});
    EXPECT_EQ(CacheReader(file("a.splats")).series().steps.size(), 2u);

    Words kept = words;
    kept.emplace_back("--keep-going");
    const ProgramResult result = run(kept);
    EXPECT_NE((result.out + result.err).find("step 2"), std::string::npos) << result.out << result.err;
    EXPECT_NE((result.out + result.err).find(told), std::string::npos) << result.out << result.err;
    const CacheReader cache(file("a.splats"));
    ASSERT_EQ(cache.series().steps.size(), 3u);
    EXPECT_EQ(cache.series().steps[2].time, 2);
    EXPECT_TRUE(verifyCache(cache.atStep(2)).findings.empty());
  }
}

/// Two zones of the same size: 1 + x and 1 + x + 100, and the second lies 10 further along x.
void writeTwoZones(const std::string& path, const Words& names, double time) {
  CgnsWriter writer(path, CgnsFileType::kHdf5);
  writer.base("base");
  writer.baseSteps({time});
  for (const std::string& name : names) {
    const double other = name == "b" || name == "right" ? 1 : 0;
    const auto field = [](const char* called, double start, std::array<double, 3> along) {
      return CgnsWriterField{called, [=](int64_t i, int64_t j, int64_t k) {
                               return start + along[0] * static_cast<double>(i) +
                                      along[1] * static_cast<double>(j) + along[2] * static_cast<double>(k);
                             }};
    };
    writer.zone(name, {6, 5, 4});
    writer.coordinates("GridCoordinates",
                       {field("CoordinateX", 10 * other, {1, 0, 0}), field("CoordinateY", 0, {0, 1, 0}),
                        field("CoordinateZ", 0, {0, 0, 1})});
    writer.solution("Only", "Vertex", {field("Density", 100 * other + time, {1, 0, 0})});
  }
}

TEST_F(SeriesFormats, ZonesInAnotherOrderAreFoundByName) {
  writeTwoZones(file("a_1.cgns"), {"a", "b"}, 1);
  writeTwoZones(file("a_2.cgns"), {"b", "a"}, 2);
  writeTwoZones(file("in_order.cgns"), {"a", "b"}, 2);
  run({"convert", file("a_*.cgns"), "-o", file("a.splats"), "--scalar", "Density"});
  run({"convert", file("in_order.cgns"), "-o", file("b.splats"), "--scalar", "Density"});
  const CacheReader cache(file("a.splats"));
  ASSERT_EQ(cache.series().steps.size(), 2u);
  EXPECT_EQ(cache.series().geometries(), 1u) << "the same blocks in another order";
  expectSame(cache.atStep(1), CacheReader(file("b.splats")));
}

TEST_F(SeriesFormats, ZonesOfOtherNamesAreTakenInOrderAndSaid) {
  // The number of a file's step is no other name.
  writeTwoZones(file("n_1.cgns"), {"a1", "b1"}, 1);
  writeTwoZones(file("n_2.cgns"), {"a2", "b2"}, 2);
  const Words words{"convert",  file("n_*.cgns"), "-o",         file("n.splats"),
                    "--scalar", "Density",        "--overwrite"};
  ProgramResult result = run(words);
  EXPECT_EQ(result.err.find("names do not tell"), std::string::npos) << result.err;

  writeTwoZones(file("n_2.cgns"), {"left", "right"}, 2);
  writeTwoZones(file("n_3.cgns"), {"left", "right"}, 3);
  result = run(words);
  const size_t said =
      result.err.find("block 1 is called left, in the first step a1; since names do not tell");
  ASSERT_NE(said, std::string::npos) << result.err;
  EXPECT_EQ(result.err.find("names do not tell", said + 70), std::string::npos) << "once: " << result.err;
  EXPECT_EQ(CacheReader(file("n.splats")).series().steps.size(), 3u);
}

TEST_F(SeriesFormats, NumbersOfATecplotTextAreCountedOnce) {
  {
    std::ofstream text(file("a.dat"));
    text << "VARIABLES = X Y Z p\n";
    for (int step = 0; step < 5; ++step) {
      text << "ZONE I=20, J=20, K=40, DATAPACKING=POINT, STRANDID=1, SOLUTIONTIME=" << step << "\n";
      for (int n = 0; n < 16000; ++n)
        text << fmt::format("{:.15f} {:.15f} {:.15f} {:.15f}\n", 1.0 * (n % 20), 1.0 * (n / 20 % 20),
                            1.0 * (n / 400), 0.1 * n + step);
    }
  }
  OpenGridOptions options;
  options.grid = file("a.dat");
  const std::vector<StepFiles> steps = stepsOf(options);
  ASSERT_EQ(steps.size(), 5u);
  const auto reads = [](const OpenGridOptions& of_step) {
    faults::FaultySystemCalls disk;
    const ScopedSystemCalls in_place(disk);
    EXPECT_EQ(openData(of_step)->description().times.size(), 5u);
    return disk.reads.load();
  };
  options.time_step = 3;
  EXPECT_LT(2 * reads(steps[3].options), reads(options));
  // The text is another one: what was counted before is not used.
  std::ofstream(file("a.dat"), std::ios::app) << "ZONE I=2, J=2, K=2, STRANDID=1, SOLUTIONTIME=9\n0 0 0\n";
  expectError([&] { openData(steps[3].options); }, {"3 numbers; expected 32"});
}

TEST_F(SeriesFormats, CellCentredFilesAndTheirCollections) {
  std::string pvd = "<VTKFile type=\"Collection\" version=\"0.1\"><Collection>";
  std::string series = R"({"file-series-version": "1.0", "files": [)";
  for (int step = 0; step < 3; ++step) {
    VtsGrid grid = annulusVtsGrid(9, 8, 7);
    for (VtsArray& array : grid.cell_data)
      for (double& value : array.values) value = static_cast<float>(value * (1 + 0.1 * step) + step);
    const std::string name = "c_" + std::to_string(step) + ".vts";
    std::ofstream(file(name), std::ios::binary) << vtsFile(grid, {});
    pvd += "<DataSet timestep=\"" + std::to_string(0.5 * step) + "\" file=\"" + name + "\"/>";
    series += (step ? ", " : "") + std::string(R"({"name": ")") + name + R"(", "time": )" +
              std::to_string(2 * step) + "}";
  }
  std::ofstream(file("c.pvd")) << pvd << "</Collection></VTKFile>";
  std::ofstream(file("c.vts.series")) << series << "]}";
  const Words cells{"--scalar", "T"};
  const auto alone = [&](size_t step) { return Words{file("c_" + std::to_string(step) + ".vts")}; };
  expectEachAsAlone(file("c_*.vts"), {0, 0, 0}, alone, cells);
  EXPECT_TRUE(CacheReader(file("a.splats")).manifest().cells);
  expectEachAsAlone(file("c.pvd"), {0, 0, 0}, alone, cells);
  EXPECT_EQ(CacheReader(file("a.splats")).series().steps[2].time, 1);
  expectEachAsAlone(file("c.vts.series"), {0, 0, 0}, alone, cells);
  EXPECT_EQ(CacheReader(file("a.splats")).series().steps[2].time, 4);
  // Without quotes the shell expands the pattern.
  run({"convert", file("c_0.vts"), file("c_2.vts"), file("c_1.vts"), "--scalar", "T", "-o",
       file("d.splats")});
  EXPECT_EQ(CacheReader(file("d.splats")).series().steps.size(), 3u);
}

}  // namespace
}  // namespace curvisplat
