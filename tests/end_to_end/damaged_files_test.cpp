// `curvisplat render` of a cache with bricks that cannot be read. Damaged HDF5 files: libcgns, libnetcdf and
// HDF5 would print their own stacks of errors. The program prints one line, also at its end, when HDF5
// closes what it could not.
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "render/image/image.h"
#include "render/image/image_file.h"
#include "stream/base/file.h"
#include "stream/cache/cache_reader.h"
#include "tests/support/cgns_writer.h"
#include "tests/support/earth_files.h"
#include "tests/support/program_test.h"
#include "tests/support/test_caches.h"

namespace curvisplat {
namespace {

TEST(DamagedCache, IsRefusedOrDrawnFromCoarserLevels) {
  const TemporaryFolder folder;
  const auto file = [&](const char* name) { return (folder / name).string(); };
  writeRandomCache(folder / "a.splats");
  const auto render = [&](const char* output, const std::vector<std::string>& more) {
    std::vector<std::string> arguments{"render", file("a.splats"), "-o",           file(output),
                                       "--size", "64x48",          "--lod-pixels", "0"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return runProgram(arguments);
  };
  ProgramResult result = render("whole.exr", {});
  ASSERT_EQ(result.status, 0) << result.err;

  {
    const CacheReader cache(folder / "a.splats");
    std::fstream geometry(cache.geometryPath(), std::ios::in | std::ios::out | std::ios::binary);
    geometry.seekp(static_cast<std::streamoff>(cache.bricks().back().geometry.offset));
    geometry.put('\x55').put('\x5a').put('\xa5');
  }
  const std::string last = "brick " + std::to_string(CacheReader(folder / "a.splats").bricks().size() - 1);
  result = render("refused.exr", {});
  EXPECT_EQ(result.status, 1);
  expectSays(result.err, last);
  EXPECT_FALSE(std::filesystem::exists(file("refused.exr")));

  result = render("coarser.exr", {"--keep-going", "--stats", file("stats.json")});
  EXPECT_EQ(result.status, 0) << result.err;
  expectSays(result.err, "warning: 1 of ");
  expectSays(result.err, last);
  const auto stats = jsonOf(file("stats.json"));
  const auto& unreadable = stats["frames"][0]["bricks_unreadable"];
  ASSERT_EQ(unreadable.size(), 1u);
  EXPECT_EQ("brick " + std::to_string(unreadable[0]["brick"].get<uint32_t>()), last);
  const double psnr_db = compareImages(readImage(file("coarser.exr")), readImage(file("whole.exr"))).psnr_db;
  EXPECT_TRUE(std::isfinite(psnr_db));
  EXPECT_GT(psnr_db, 15);
}

namespace fs = std::filesystem;

void writeCgns(const fs::path& path) {
  CgnsWriter writer(path, CgnsFileType::kHdf5);
  writer.base("Base");
  writer.zone("Zone", {5, 4, 3});
  writer.coordinates("GridCoordinates",
                     {{"CoordinateX", [](int64_t i, int64_t, int64_t) { return static_cast<double>(i); }},
                      {"CoordinateY", [](int64_t, int64_t j, int64_t) { return static_cast<double>(j); }},
                      {"CoordinateZ", [](int64_t, int64_t, int64_t k) { return static_cast<double>(k); }}});
  writer.solution("Solution", "Vertex",
                  {{"Density", [](int64_t i, int64_t j, int64_t) { return static_cast<double>(i + j); }}});
}

/// The offsets at which the headers of HDF5's objects, groups and heaps begin.
std::vector<size_t> structures(const std::string& bytes) {
  std::vector<size_t> found;
  for (const char* mark : {"OHDR", "OCHK", "TREE", "SNOD", "HEAP", "FRHP", "FHDB", "BTHD", "BTLF"})
    for (size_t at = bytes.find(mark); at != std::string::npos; at = bytes.find(mark, at + 1))
      found.push_back(at);
  return found;
}

class DamagedGrid : public ProgramTest {
 protected:
  /// Runs `convert` on copies of `whole`, each damaged by `damage` at one of `places`.
  template <typename Damage>
  void expectOneLine(const fs::path& whole, const std::vector<size_t>& places, const Damage& damage) {
    const std::string bytes = readTextFile(whole);
    const fs::path copy = folder_ / ("damaged" + whole.extension().string());
    int refused = 0;
    for (const size_t place : places) {
      std::string damaged = bytes;
      damage(damaged, place);
      writeFileAtomically(copy, damaged);
      const ProgramResult result = runProgram({"convert", copy, "-o", folder_ / "a.splats", "--overwrite"});
      refused += result.status != 0;
      EXPECT_TRUE(result.status == 0 || lineCount(result.err) == 1) << place << ": " << result.err;
      EXPECT_EQ(result.err.find("HDF5-DIAG"), std::string::npos) << place << ": " << result.err;
      EXPECT_EQ(result.err.find("closing library"), std::string::npos) << place << ": " << result.err;
    }
    EXPECT_GT(refused, 0);
  }
};

TEST_F(DamagedGrid, OfHdf5IsRefusedInOneLine) {
  const fs::path cgns = folder_ / "a.cgns", netcdf = folder_ / "a.nc";
  writeCgns(cgns);
  roms::write(netcdf, NetcdfFileType::kNetcdf4Compressed, "ocean_s_coordinate_g2");
  for (const fs::path& whole : {cgns, netcdf}) {
    std::vector<size_t> places = structures(readTextFile(whole));
    ASSERT_GT(places.size(), 10u) << whole;
    for (size_t n = 0; places.size() > 40; ++n)
      places.erase(places.begin() + static_cast<long>(n % places.size()));
    expectOneLine(whole, places, [](std::string& bytes, size_t place) {
      for (size_t n = 12; n < 20; ++n) bytes[place + n] = static_cast<char>(~bytes[place + n]);
    });
  }
}

// Chunks that cannot be decompressed fail while values are read, in another thread than the one that opened
// the file.
TEST_F(DamagedGrid, OfHdf5WithUnreadableValuesIsRefusedInOneLine) {
  const fs::path netcdf = folder_ / "a.nc";
  roms::write(netcdf, NetcdfFileType::kNetcdf4Compressed, "ocean_s_coordinate_g2");
  std::vector<size_t> places;
  const std::string bytes = readTextFile(netcdf);
  for (size_t at = bytes.find("\x78\x5e"); at != std::string::npos; at = bytes.find("\x78\x5e", at + 1))
    places.push_back(at);  // zlib's mark
  ASSERT_GT(places.size(), 3u);
  expectOneLine(netcdf, places, [](std::string& damaged, size_t place) { damaged[place] = 0; });
}

}  // namespace
}  // namespace curvisplat
