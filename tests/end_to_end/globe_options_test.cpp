// Lines, cameras and coordinates in longitude, latitude and height, of caches of NetCDF grids and others.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <glm/geometric.hpp>
#include <string>
#include <tuple>

#include "render/image/image.h"
#include "render/image/image_file.h"
#include "stream/cache/manifest.h"
#include "stream/cache/series.h"
#include "stream/model/globe.h"
#include "tests/support/netcdf_writer.h"
#include "tests/support/program_test.h"

namespace curvisplat {
namespace {

using Index = std::vector<size_t>;
constexpr auto kDouble = NetcdfNumbers::kDoublePrecision;
constexpr Globe kEarth{Globe::Shape::kSphere, 6371, 20, 0};

/// A sea of 20 x 16 degrees, 4 km deep, at three times, six hours apart; in each of two caches.
class GlobePictures : public ProgramSuite<GlobePictures> {
 protected:
  static void prepare() {
    writeSea(*folder_ / "sea.nc");
    const Words all{"--steps", "all", "--vertical-scale", "20"};
    run(Words{"convert", file("sea.nc"), "-o", file("sea.splats")} + all);
    run(Words{"convert", file("sea.nc"), "-o", file("flat.splats"), "--flat"} + all);
    writeDrift(*folder_ / "drift.nc", "hours since 2001-01-01");
  }

  /// `across`: how much values change within a layer.
  static void writeSea(const std::filesystem::path& path, double west = -5, double south = 40,
                       double across = 1) {
    NetcdfWriter file(path, NetcdfFileType::kClassic);
    for (const auto& [name, length] : {std::pair("time", 3), {"depth", 5}, {"lat", 17}, {"lon", 21}})
      file.dimension(name, static_cast<size_t>(length));
    file.variable("time", kDouble, {"time"}, {{"units", "days since 2001-01-01"}},
                  [](const Index& n) { return 0.25 * static_cast<double>(n[0]); });
    file.variable("depth", kDouble, {"depth"}, {{"units", "m"}, {"positive", "down"}},
                  [](const Index& n) { return 1000.0 * static_cast<double>(n[0]); });
    file.variable("lat", kDouble, {"lat"}, {{"units", "degrees_north"}},
                  [=](const Index& n) { return south + static_cast<double>(n[0]); });
    file.variable("lon", kDouble, {"lon"}, {{"units", "degrees_east"}},
                  [=](const Index& n) { return west + static_cast<double>(n[0]); });
    file.variable("temp", kDouble, {"time", "depth", "lat", "lon"}, {}, [=](const Index& n) {
      return static_cast<double>(n[0] + n[1] * n[1]) + across * static_cast<double>(n[2] + 2 * n[3]);
    });
  }

  /// A float that goes east by a degree in an hour, at 500 m, for twelve hours; and one that stays for three.
  static void writeDrift(const std::filesystem::path& path, const std::string& unit) {
    NetcdfWriter file(path, NetcdfFileType::kNetcdf4);
    file.dimension("trajectory", 2);
    file.dimension("obs", 13);
    const std::vector<std::string> dims{"trajectory", "obs"};
    const auto there = [](const NetcdfFunction& value) {
      return [value](const Index& n) { return n[0] == 1 && n[1] > 3 ? -999.0 : value(n); };
    };
    const NetcdfDoubleList fill{{-999.0}};
    file.variable("time", kDouble, dims, {{"units", unit}, {"_FillValue", fill}},
                  there([](const Index& n) { return static_cast<double>(n[1]); }));
    file.variable("lon", kDouble, dims, {{"units", "degrees_east"}, {"_FillValue", fill}},
                  there([](const Index& n) { return n[0] == 1 ? 12.0 : static_cast<double>(n[1]); }));
    file.variable("lat", kDouble, dims, {{"units", "degrees_north"}, {"_FillValue", fill}},
                  there([](const Index& n) { return n[0] == 1 ? 53.0 : 45.0; }));
    file.variable("z", kDouble, dims, {{"units", "m"}, {"positive", "down"}, {"_FillValue", fill}},
                  there([](const Index& n) { return n[0] == 1 ? 10.0 * static_cast<double>(n[1]) : 500.0; }));
  }

  static Image picture(const Words& more, const std::string& cache = "sea") {
    return pictureOf(file(cache + ".splats"), file("a.pfm"),
                     Words{"--volume", "off", "--look-at", "5,48", "--from-height", "4000"} + more,
                     "160x120");
  }
  static constexpr double kSame = 50;
  /// Expects the same picture but for rounding.
  static void expectSame(const Image& a, const Image& b, double psnr_db = kSame) {
    EXPECT_GT(compareImages(a, b).psnr_db, psnr_db);
  }
  static std::string csv(const std::string& name, const std::string& text) {
    writeFileAtomically(file(name), text);
    return file(name);
  }
};

TEST_F(GlobePictures, TheCacheKeepsItsGlobe) {
  EXPECT_EQ(readManifest(file("sea.splats")).globe, kEarth);
  const auto flat = readManifest(file("flat.splats")).globe;
  ASSERT_TRUE(flat.has_value());
  EXPECT_EQ(flat->shape, Globe::Shape::kFlat);
  EXPECT_EQ(flat->middle_longitude, 5);
  EXPECT_EQ(flat->vertical_scale, 20);
}

TEST_F(GlobePictures, LinesLieWhereTheGridIs) {
  for (const std::string cache : {"sea", "flat"}) {
    const Globe globe = *readManifest(file(cache + ".splats")).globe;
    std::string world = "x,y,z,id\n";
    for (const auto& [line, places] : {std::pair(0, 13), {1, 4}})
      for (int n = 0; n < places; ++n) {
        const glm::dvec3 at =
            globe.placeAt(line == 0 ? glm::dvec3(n, 45, -0.5) : glm::dvec3(12, 53, -0.01 * n));
        world += fmt::format("{},{},{},{}\n", at.x, at.y, at.z, line);
      }
    const Image expected = picture({"--lines", csv("world.csv", world), "--lines-time", "all"}, cache);
    EXPECT_EQ(picture({"--lines", file("drift.nc"), "--lines-time", "all"}, cache).rgba, expected.rgba);
    EXPECT_NE(picture({"--lines", file("drift.nc")}, cache).rgba, expected.rgba);
  }
  // Degrees in a cache that has none need --globe, which says the same here.
  run({"generate", "globe", "--size", "8x8x4", "-o", file("shell")});
  run({"convert", file("shell.xyz"), file("shell.fun"), "-o", file("shell.splats")});
  expectRefused({"render", file("shell.splats"), "-o", file("a.png"), "--lines", file("drift.nc")}, 1,
                {"drift.nc: has longitudes and latitudes, but the cache does not say where its grid has "
                 "them; --globe "});
  run({"render", file("shell.splats"), "-o", file("a.png"), "--lines", file("drift.nc"), "--globe", "1,20"});
}

TEST_F(GlobePictures, TrajectoriesFollowTheTimeOfThePicture) {
  const std::string east = csv("east.csv",
                               "lon,lat,depth\n0,45,500\n1,45,500\n2,45,500\n3,45,500\n"
                               "4,45,500\n5,45,500\n6,45,500\n\n12,53,0\n12,53,10\n12,53,20\n12,53,30\n");
  // The second step is six hours after the first.
  expectSame(picture({"--lines", file("drift.nc"), "--step", "1"}), picture({"--lines", east}));
  const Image at_six = picture({"--points", csv("one.csv", "lon,lat,depth\n6,45,500\n")});
  expectSame(picture({"--points", file("drift.nc"), "--step", "1"}), at_six);
  // The last two hours, in the unit of the series: days.
  expectSame(picture({"--lines", file("drift.nc"), "--step", "1", "--lines-time", "0.08333333333333333"}),
             picture({"--lines", csv("tail.csv", "lon,lat,depth\n4,45,500\n5,45,500\n6,45,500\n")}));
  // Between two steps, and of a series of pictures.
  const Image half = picture({"--points", file("drift.nc"), "--time", "0.375", "--interpolate"});
  expectSame(half, picture({"--points", csv("half.csv", "lon,lat,depth\n9,45,500\n")}));
  run(Words{"render", file("sea.splats"), "-o", file("f%d.pfm"), "--size", "160x120", "--volume", "off",
            "--look-at", "5,48", "--from-height", "4000", "--points", file("drift.nc"), "--steps", "all",
            "--interpolate", "--frames", "5"});
  expectSame(readImage(file("f3.pfm")), half);
  expectSame(readImage(file("f2.pfm")), at_six);
  EXPECT_LT(compareImages(readImage(file("f0.pfm")), half).psnr_db, kSame);
  // Text has times of the series' unit.
  const std::string timed = csv("timed.csv", "lon,lat,depth,time\n5,45,500,0\n7,45,500,0.5\n");
  expectSame(picture({"--points", timed, "--step", "1"}), at_six, 35);  // on the chord between two places
  // Times that do not compare.
  writeDrift(*folder_ / "steps.nc", "1");
  const ProgramResult whole =
      run({"render", file("sea.splats"), "-o", file("a.png"), "--lines", file("steps.nc")});
  expectSays(
      whole.err,
      "steps.nc: its times, in '1', do not compare with those of the cache, in 'days since 2001-01-01'");
  expectRefused({"render", file("sea.splats"), "-o", file("a.png"), "--lines", file("steps.nc"),
                 "--lines-time", "past"},
                1, {"steps.nc: its times, in '1', do not compare"});
  for (const char* const wrong : {"0", "-1", "later"})
    expectRefused({"render", file("sea.splats"), "-o", file("a.png"), "--lines", east,
                   fmt::format("--lines-time={}", wrong)},
                  2, {"--lines-time"});
  expectRefused({"render", file("sea.splats"), "-o", file("a.png"), "--lines-time", "all"}, 2,
                {"--lines-time needs lines or points: --lines FILE"});
}

TEST_F(GlobePictures, MapsAreDrawnAroundTheData) {
  const auto map = [](double west) {
    return fmt::format(R"({{"type": "LineString", "coordinates": [[{0}, 50], [{1}, 50]]}})", west,
                       west + 0.5);
  };
  const std::string near = csv("near.geojson", map(5)), far = csv("far.geojson", map(120));
  expectSame(picture({"--lines", near}), picture({"--lines", csv("near.csv", "lon,lat\n5,50\n5.5,50\n")}));
  const Image none = picture({"--lines", far});
  for (size_t n = 0; n < none.rgba.size(); ++n) ASSERT_EQ(none.rgba[n], none.rgba[n % 4]);
  expectRefused({"render", file("sea.splats"), "-o", file("a.png"), "--lines", near, "--lines-by", "speed"},
                1, {"--lines-by speed: the files have no scalars; leave it out"});
  EXPECT_NE(picture({"--lines", near, "--lines", file("drift.nc"), "--lines-by", "lat"}).rgba,
            picture({"--lines", near, "--lines", file("drift.nc")}).rgba);
}

TEST_F(GlobePictures, ACameraLooksDownAtAPlace) {
  const glm::dvec3 column = kEarth.column(5, 48), north = kEarth.column(5, 138);
  const auto text = [](const glm::dvec3& v) { return fmt::format("{},{},{}", v.x, v.y, v.z); };
  const auto with = [&](const Words& camera) {
    return pictureOf(file("sea.splats"), file("a.pfm"), camera, "160x120").rgba;
  };
  EXPECT_EQ(with({"--look-at", "5,48", "--from-height", "3000"}),
            with({"--position=" + text(9371.0 * column), "--focal-point=" + text(6371.0 * column),
                  "--view-up=" + text(north), "--view-angle", "30"}));
  EXPECT_NE(with({"--look-at", "5,48", "--from-height", "3000", "--view-angle", "40"}),
            with({"--look-at", "5,48", "--from-height", "3000"}));
  const auto refused = [&](const Words& words, int status, const std::string& says) {
    expectRefused(Words{"render", file("sea.splats"), "-o", file("a.png")} + words, status, {says});
  };
  refused({"--look-at", "5,48"}, 2, "--look-at and --from-height need one another");
  refused({"--look-at", "5,98", "--from-height", "9"}, 2,
          "--look-at 5,98: expected a longitude and a latitude");
  refused({"--look-at", "5,48", "--from-height", "-9"}, 2, "--from-height");
  refused({"--look-at", "5,48", "--from-height", "9", "--view", "+x"}, 2,
          "--look-at cannot be combined with --view");
}

TEST_F(GlobePictures, TheAxesGridHasLongitudesLatitudesAndDepths) {
  const auto grid = [](const std::string& cache, const Words& more) {
    return pictureOf(file(cache + ".splats"), file("a.pfm"),
                     Words{"--look-at", "5,48", "--from-height", "6000", "--volume", "off", "--background",
                           "black", "--axes-titles", ",,"} +
                         more,
                     "300x300");
  };
  for (const std::string cache : {"sea", "flat"}) {
    // The same lines as lines of places: those of the box's bottom, 4 km deep.
    const std::string far = csv("far.geojson", R"({"type": "Point", "coordinates": [120, 0]})");
    const Image axes = grid(cache, {"--axes-grid", "--lines", far});
    for (const auto& [place, expected] :
         {std::pair("0,43.3,4000", true), {"7.7,50,4000", true}, {"7.7,43.3,4000", false}}) {
      const Image point =
          grid(cache, {"--points", csv("p.csv", std::string("lon,lat,depth\n") + place + "\n"),
                       "--point-size", "4px", "--lines-colour", "#ff0000"});
      bool inked = false;
      int pixels = 0;
      for (int y = 0; y < 300; ++y)
        for (int x = 0; x < 300; ++x) {
          const bool is_point =
              point.pixel(x, y)[0] > 0.2f && point.pixel(x, y)[1] < 0.5f * point.pixel(x, y)[0];
          pixels += is_point;
          inked |= is_point && axes.pixel(x, y)[1] > 0.02f;
        }
      EXPECT_GT(pixels, 0) << cache << ' ' << place;
      EXPECT_EQ(inked, expected) << cache << ' ' << place;
    }
  }
}

/// A map whose squares of ten degrees have colours of their own.
glm::vec3 colourOfSquare(int column, int row) {
  return {static_cast<float>(7 * column) / 255, static_cast<float>(14 * row) / 255, 0.4f};
}

std::string mapOfSquares(const std::string& file) {
  Image map({360, 180});
  for (int y = 0; y < 180; ++y)
    for (int x = 0; x < 360; ++x) {
      const glm::vec3 colour = colourOfSquare(x / 10, y / 10);
      for (int c = 0; c < 3; ++c) map.pixel(x, y)[c] = colour[c];
      map.pixel(x, y)[3] = 1;
    }
  writeImage(map, file);
  return file;
}

TEST_F(GlobePictures, AnImageOfTheEarthLiesWhereItsPlacesAre) {
  const std::string map = mapOfSquares(file("map.png"));
  const auto middle = [&](const std::string& cache, const std::string& place, const Words& more = {}) {
    const Image drawn = pictureOf(
        file(cache + ".splats"), file("a.pfm"),
        Words{"--volume", "off", "--look-at=" + place, "--from-height", "900", "--map", map} + more, "61x41");
    return glm::vec3(drawn.pixel(30, 20)[0], drawn.pixel(30, 20)[1], drawn.pixel(30, 20)[2]);
  };
  // Longitude and latitude of the middles of squares, whose columns count from 180 degrees west, rows from 90 north.
  for (const std::string cache : {"sea", "flat"})
    for (const auto& [place, column, row] :
         {std::tuple("5,45", 18, 4), {"-125,-35", 5, 12}, {"95,75", 27, 1}}) {
      const glm::vec3 found = middle(cache, place), expected = colourOfSquare(column, row);
      for (int c = 0; c < 3; ++c) EXPECT_NEAR(found[c], expected[c], 0.5 / 255) << cache << ' ' << place;
    }
  // A light of the picture lights it, too; its own height is the data's lowest.
  EXPECT_NE(middle("sea", "5,45", {"--light", "0.2,0.2,0"}), middle("sea", "5,45"));
  const Image lowest = picture({"--map", map});
  expectSame(picture({"--map", map, "--map-height=-4"}), lowest);
  EXPECT_LT(compareImages(picture({"--map", map, "--map-height", "20"}), lowest).psnr_db, kSame);
}

TEST_F(GlobePictures, TheEarthHidesWhatIsBehindIt) {
  const auto seen = [](const Words& more) {
    return pictureOf(file("sea.splats"), file("a.pfm"),
                     Words{"--volume", "off", "--position", "30000,0,0", "--focal-point", "0,0,0",
                           "--view-up", "0,0,1", "--view-angle", "35"} +
                         more,
                     "120x120");
  };
  const Words behind{"--lines", csv("behind.csv", "lon,lat\n150,0\n170,10\n-160,20\n")};
  const Words before{"--lines", csv("before.csv", "lon,lat\n-30,0\n10,10\n")};
  const Image earth = seen({"--map", "#204060"});
  const Image through = seen(behind);
  EXPECT_GT(std::count_if(through.rgba.begin(), through.rgba.end(),
                          [](float value) { return value > 0.3f && value < 0.99f; }),
            50);
  EXPECT_EQ(seen(Words{"--map", "#204060"} + behind).rgba, earth.rgba);
  EXPECT_NE(seen(Words{"--map", "#204060"} + before).rgba, earth.rgba);
  // A long segment runs along the Earth, not through it: its picture is that of a line of many places.
  std::string places = "lon,lat\n";
  for (int n = -60; n <= 60; ++n) places += fmt::format("{},0\n", n);
  const Words equator{"--map", "#204060", "--lines", csv("long.csv", "lon,lat\n-60,0\n60,0\n")};
  const Image along = seen(equator), whole = seen({"--map", "#204060", "--lines", csv("places.csv", places)});
  EXPECT_LT(compareImages(earth, whole).psnr_db, 30);
  expectSame(along, whole);
  EXPECT_EQ(seen({"--map", "#204060", "--points", file("long.csv")}).rgba,
            seen({"--map", "#204060", "--points", csv("two.csv", "lon,lat\n-60,0\n\n60,0\n")}).rgba);
  const auto refused = [](const std::string& cache, const Words& more, int status, const std::string& why) {
    expectRefused(Words{"render", file(cache + ".splats"), "-o", file("a.png")} + more, status, {why});
  };
  writeImage(Image({30, 30}), file("square.png"));
  refused("sea", {"--map", file("square.png")}, 1,
          "square.png: has 30 x 30 pixels; a map of the whole Earth (equirectangular, ");
  refused("sea", {"--map", file("sea.nc")}, 1, "sea.nc: not a PNG, ");
  refused("sea", {"--map", file("none.png")}, 1, "none.png");
  refused("sea", {"--map", "#12"}, 2, "--map #12: expected the file of an image, or a colour #rrggbb");
  refused("sea", {"--map", "#123456", "--map-height", "1e39"}, 2,
          "--map-height 1e39: expected at most 1e+09");
  refused("sea", {"--no-scalar-bar", "--scalar-bar-title", "t"}, 2, "no bar with --no-scalar-bar");
  std::string png = bytesOfFile(mapOfSquares(file("large.png")));
  png.replace(16, 8,
              std::string("\0\0\x75\x30\0\0\x3a\x98", 8));  // 30000 x 15000; the checksum is wrong, too
  overwriteFile(file("large.png"), png);
  refused("sea", {"--map", file("large.png")}, 1,
          "has 30000 x 15000 pixels, more than the 67108864 of a map");
  writeImage(Image({2, 1}), file("large.exr"));
  std::string exr = bytesOfFile(file("large.exr"));
  const size_t window = exr.find("dataWindow") + std::string("dataWindow.box2i.size").size() + 8;
  exr.replace(window, 8, std::string("\x2f\x75\0\0\x97\x3a\0\0", 8));  // the last column and row
  overwriteFile(file("large.exr"), exr);
  refused("sea", {"--map", file("large.exr")}, 1,
          "large.exr: has 30000 x 15000 pixels, more than the 67108864 of a map");
  // TinyEXR makes floats of all channels, however short the file is.
  std::vector<ImageChannel> channels;
  for (const char* name : {"P", "Q"}) channels.push_back({name, {0, 0}});
  writeExr(Image({2, 1}), channels, file("channels.exr"));
  refused("sea", {"--map", file("channels.exr")}, 1,
          "channels.exr: has 6 channels; a map has at most 4 (R, G, B, A)");
  overwriteFile(file("large.pfm"), "PF\n30000 15000\n-1\n");
  refused("sea", {"--map", file("large.pfm")}, 1,
          "large.pfm: has 30000 x 15000 pixels, more than the 67108864 of a map");
  overwriteFile(file("padded.pfm"), "PF\n2 1\n-1\n");
  std::filesystem::resize_file(file("padded.pfm"), uint64_t{1} << 32);  // sparse
  refused("sea", {"--map", file("padded.pfm")}, 1, "padded.pfm: has 4294967296 bytes for 2 x 1 pixels; ");
  expectRefused({"view", file("sea.nc"), "--map", "#123456"}, 2, {"--map, --step and --time need a cache"});
  refused("sea", {"--map-height", "2"}, 2, "--map-height 2 needs a map: --map FILE");
  refused("sea", {"--map", "#123456", "--map-height=-1e6"}, 2, "lies below the middle of the Earth");
  run({"generate", "half-annulus", "--size", "8x8x4", "-o", file("tube")});
  run({"convert", file("tube.xyz"), file("tube.fun"), "-o", file("tube.splats")});
  refused("tube", {"--map", "#123456"}, 1, "the cache does not say where its grid has them; --globe ");
}

/// A place at either side of the Earth.
TEST_F(GlobePictures, WithTheEarthThePictureLooksDownAtTheData) {
  for (const double west : {-145.0, 35.0, 120.0}) {
    writeSea(file("far.nc"), west, west < 0 ? -48 : 20);
    const std::string name = file(fmt::format("far{}.splats", west));
    run({"convert", file("far.nc"), "-o", name, "--vertical-scale", "20"});
    const Image seen = pictureOf(name, file("a.pfm"), {"--map", "#204060", "--tf", "glow"}, "160x120");
    int of_data = 0;  // the Earth is blue
    for (size_t n = 0; n < seen.rgba.size(); n += 4) of_data += seen.rgba[n] > seen.rgba[n + 2];
    EXPECT_GT(of_data, 1000) << west;
  }
}

TEST_F(GlobePictures, LayersThatAreSeenAsOneAreExplained) {
  writeSea(*folder_ / "layers.nc", -5, 40, 0);
  run({"convert", file("layers.nc"), "-o", file("layers.splats")});
  expectSays(run({"render", file("layers.splats"), "-o", file("a.png"), "--size", "200x160"}).err,
             "the picture is of one colour; if layers above one another are seen as one, convert with "
             "--vertical-scale 50; or try --range 1%,99%");
}

TEST_F(GlobePictures, HeightsAreStretchedAtDrawing) {
  // The flat map was converted with 20.
  const auto flat = [](const Words& more) {
    return pictureOf(
        file("flat.splats"), file("a.pfm"),
        Words{"--axes-grid", "--view", "iso", "--points", csv("p.csv", "lon,lat,depth\n5,48,4000\n"),
              "--clip-box=-1000,1000,4000,9000,-60,0"} +
            more,
        "160x120");
  };
  const Image whole = flat({});
  EXPECT_EQ(flat({"--vertical-scale", "20"}).rgba, whole.rgba);
  const Image five = flat({"--vertical-scale", "100"});
  EXPECT_EQ(five.rgba, flat({"--scale", "1,1,5"}).rgba);
  EXPECT_NE(five.rgba, whole.rgba);
  // It is the factor of z where a grid has no globe.
  run({"generate", "half-annulus", "--size", "8x8x4", "-o", file("ring")});
  run({"convert", file("ring.xyz"), file("ring.fun"), "-o", file("ring.splats")});
  EXPECT_EQ(pictureOf(file("ring.splats"), file("a.pfm"), {"--vertical-scale", "3"}, "60x40").rgba,
            pictureOf(file("ring.splats"), file("a.pfm"), {"--scale", "1,1,3"}, "60x40").rgba);
  // A camera above a place has its height in kilometres, whatever heights are scaled with.
  const auto above = [](const Words& more) {
    return pictureOf(file("flat.splats"), file("a.pfm"),
                     Words{"--volume", "off", "--look-at", "5,48", "--points",
                           csv("sea.csv", "lon,lat,depth\n4,48,0\n6,50,0\n")} +
                         more,
                     "160x120");
  };
  const Image high = above({"--from-height", "4000"});
  expectSame(above({"--from-height", "4000", "--vertical-scale", "500"}), high);
  EXPECT_LT(compareImages(high, above({"--from-height", "6000"})).psnr_db, kSame);
  const auto refused = [](const std::string& cache, const Words& more, const std::string& why) {
    expectRefused(Words{"render", file(cache + ".splats"), "-o", file("a.png"), "--vertical-scale"} + more, 2,
                  {why});
  };
  refused("sea", {"3"},
          "the data lies on a sphere, where heights have no axis of their own; convert the grid with ");
  refused("flat", {"3", "--scale", "1,1,2"}, "--scale stretches z as well; give one of them");
  refused("flat", {"0"}, "--vertical-scale 0");
  refused("flat", {"1e9"}, "expected a factor that stretches z by ");
}

}  // namespace
}  // namespace curvisplat
