// `curvisplat render` with several pictures: orbits, paths, movies, first images and their statistics.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <memory>
#include <nlohmann/json.hpp>

#include "render/image/image.h"
#include "render/image/image_file.h"
#include "stream/base/file.h"
#include "stream/cache/cache_reader.h"
#include "tests/support/program_test.h"

namespace curvisplat {
namespace {

namespace fs = std::filesystem;

/// Puts another value in the place of an environment variable's, until the end of the scope.
class ScopedEnvironment {
 public:
  ScopedEnvironment(const char* name, const std::string& value) : name_(name), before_(std::getenv(name)) {
    setenv(name, value.c_str(), 1);
  }
  ~ScopedEnvironment() { setenv(name_, before_.c_str(), 1); }
  ScopedEnvironment(const ScopedEnvironment&) = delete;
  ScopedEnvironment& operator=(const ScopedEnvironment&) = delete;

 private:
  const char* name_;
  const std::string before_;
};

class Frames : public ProgramSuite<Frames> {
 protected:
  static void prepare() { madeCache(file("small"), "half-annulus", "48x24x24"); }

  static std::string cache(const std::string& name = "small") { return file(name + ".splats"); }

  /// A cache of 246,000 nodes, in several bricks; made by the first who asks.
  static std::string large() {
    if (!fs::exists(cache("large"))) madeCache(file("large"), "half-annulus", "96x64x40");
    return cache("large");
  }

  /// Draws small pictures of the small cache, unless `options` have another size.
  static Words cached(const Words& options) { return sized(Words{"render", cache()} + options, "64x48"); }
  static void expectDrawn(const Words& options) {
    const ProgramResult result = run(cached(options));
    EXPECT_EQ(result.err, "");
    EXPECT_EQ(lineCount(result.out), 2) << result.out;  // the second: what was chosen from the data
  }
  static nlohmann::json json(const std::string& name) { return jsonOf(file(name)); }
  static std::string bytes(const std::string& name) { return readTextFile(file(name)); }

  /// A program of that name in a folder of its own, which becomes all of PATH but for the system's.
  static std::string folderWith(const std::string& program, const std::string& script) {
    const std::string folder = file("path_" + program);
    fs::create_directories(folder);
    std::ofstream(folder + "/" + program) << "#!/bin/sh\n" << script;
    fs::permissions(folder + "/" + program, fs::perms::owner_all);
    return folder + ":/usr/bin:/bin";
  }
};

TEST_F(Frames, AnOrbitOfTwoTurnsDrawsEachPictureTwice) {
  expectDrawn({"-o", file("turn_%03d.png"), "--orbit", "720", "--frames", "8"});
  for (int n = 0; n < 8; ++n) ASSERT_TRUE(fs::exists(file(fmt::format("turn_{:03}.png", n)))) << n;
  EXPECT_FALSE(fs::exists(file("turn_008.png")));
  EXPECT_EQ(bytes("turn_000.png"), bytes("turn_004.png"));
  EXPECT_EQ(bytes("turn_001.png"), bytes("turn_005.png"));
  EXPECT_LT(compareImages(readImage(file("turn_000.png")), readImage(file("turn_001.png"))).psnr_db, 35);
}

TEST_F(Frames, AnOrbitBeginsAtTheCameraThatWasGiven) {
  const Words camera{"--view", "+x", "--view-angle", "25"};
  Words orbit = Words{"-o", file("o%d.exr"), "--orbit", "90", "--frames", "2"} + camera;
  expectDrawn(orbit);
  expectDrawn(Words{"-o", file("still.exr")} + camera);
  EXPECT_EQ(bytes("o0.exr"), bytes("still.exr"));
  // 180 degrees in two steps: the second looks from +y.
  orbit[3] = "180";
  orbit[1] = file("p%d.exr");
  expectDrawn(orbit + Words{"--stats", file("p.json")});
  const auto position = json("p.json")["frames"][1]["camera"]["position"];
  const auto focal_point = json("p.json")["frames"][1]["camera"]["focal_point"];
  EXPECT_NEAR(position[0].get<double>(), focal_point[0].get<double>(), 1e-9);
  EXPECT_GT(position[1].get<double>(), focal_point[1].get<double>() + 1);
}

/// The orbit is in perspective, from the side of a picture without options, and further away, with all of the data.
TEST_F(Frames, AnOrbitBeginsAtTheChosenView) {
  expectDrawn({"-o", file("chosen.png"), "--stats", file("chosen.json")});
  expectDrawn({"-o", file("c%d.png"), "--orbit", "360", "--frames", "7", "--stats", file("c.json")});
  const auto direction = [&](const nlohmann::json& frame) {
    std::array<double, 4> towards{};
    for (size_t axis = 0; axis < 3; ++axis)
      towards[axis] = frame["camera"]["position"][axis].get<double>() -
                      frame["camera"]["focal_point"][axis].get<double>();
    towards[3] = std::hypot(towards[0], towards[1], towards[2]);
    return towards;
  };
  const nlohmann::json still = json("chosen.json")["frames"][0], frames = json("c.json")["frames"];
  const auto one = direction(still), first = direction(frames[0]);
  for (size_t axis = 0; axis < 3; ++axis)
    EXPECT_NEAR(first[axis] / first[3], one[axis] / one[3], 0.1) << axis;
  EXPECT_EQ(frames[0]["camera"]["view_angle_deg"], still["camera"]["view_angle_deg"]);
  for (const auto& frame : frames) {
    EXPECT_EQ(frame["splats_off_screen"], 0);
    EXPECT_NEAR(direction(frame)[3], first[3], 1e-9);
  }
}

TEST_F(Frames, AnOrbitKeepsAllOfTheDataInEveryPicture) {
  expectDrawn({"-o", file("all_%d.exr"), "--orbit", "360", "--frames", "5", "--view", "+x", "--stats",
               file("all.json")});
  const auto frames = json("all.json")["frames"];
  for (const auto& frame : frames) {
    EXPECT_EQ(frame["splats_off_screen"], 0);
    EXPECT_EQ(frame["camera"]["parallel_scale"], frames[0]["camera"]["parallel_scale"]);
  }
}

TEST_F(Frames, NamesNeedExactlyOneFrameNumber) {
  for (const char* name : {"a.png", "a%d%d.png", "a%s.png", "a%.png", "a%5.png", "a%x.png", "a%-3d.png",
                           "a%ld.png", "a%0100d.png", "a%%d.png", "a%d_%04d.exr"})
    expectRefused(cached({"-o", file(name), "--orbit", "90", "--frames", "2"}), 2, {"frame_%04d.png"});
  expectRefused(cached({"-o", file("a%d.jpg"), "--orbit", "90", "--frames", "2"}), 2, {".png"});
  expectDrawn({"-o", file("100%%_%2d.png"), "--orbit", "90", "--frames", "1"});
  EXPECT_TRUE(fs::exists(file("100%_ 0.png")));
  // Nor may a frame be what else is written.
  expectRefused(
      cached({"-o", file("a%02d.png"), "--orbit", "90", "--frames", "2", "--stats", file("./a01.png")}), 1,
      {"a frame of -o would overwrite it"});
  expectRefused(
      cached({"-o", file("a%2d.png"), "--orbit", "90", "--frames", "2", "--first-image", file("a 0.png")}), 1,
      {"a frame of -o would overwrite it"});
  fs::create_symlink("a01.png", file("linked.json"));
  expectRefused(
      cached({"-o", file("a%02d.png"), "--orbit", "90", "--frames", "2", "--stats", file("linked.json")}), 1,
      {"a frame of -o would overwrite it"});
  expectDrawn({"-o", file("a%02d.png"), "--orbit", "90", "--frames", "1", "--stats", file("a1.png")});
  expectDrawn({"-o", file("a%02d.png"), "--orbit", "90", "--frames", "1", "--stats", file("a01.png")});
  // One picture is written to the name as it is.
  expectDrawn({"-o", file("a%d.png")});
  EXPECT_TRUE(fs::exists(file("a%d.png")));
}

TEST_F(Frames, PartsDrawTheFramesOfTheWhole) {
  const Words orbit{"--orbit", "360", "--frames", "5"};
  const auto with = [&](const Words& options) { return options + orbit; };
  expectDrawn(with({"-o", file("whole_%d.png")}));
  for (const char* part : {"1/3", "2/3", "3/3"}) {
    const std::string json_name = fmt::format("part{}.json", part[0]);
    expectDrawn(with({"-o", file("part_%d.png"), "--part", part, "--stats", file(json_name)}));
    const nlohmann::json stats = json(json_name);
    for (const auto& frame : stats["frames"]) EXPECT_EQ(frame["frame"].get<int>() % 3, part[0] - '1');
  }
  for (int n = 0; n < 5; ++n)
    EXPECT_EQ(bytes(fmt::format("whole_{}.png", n)), bytes(fmt::format("part_{}.png", n))) << n;
  // Nothing else: a part writes no frame of another.
  expectDrawn(with({"-o", file("one_%d.png"), "--part", "2/3"}));
  for (int n = 0; n < 5; ++n) EXPECT_EQ(fs::exists(file(fmt::format("one_{}.png", n))), n % 3 == 1) << n;
  // More parts than frames: some have nothing to do.
  const ProgramResult idle = run(cached(with({"-o", file("idle_%d.png"), "--part", "7/9"})));
  expectSays(idle.out, "no frames in this part");
}

TEST_F(Frames, ImpossiblePartsAreWrongUsage) {
  for (const char* part : {"0/3", "4/3", "1", "/3", "1/", "a/3", "1/3x", "-1/3", "1/1000000"})
    expectRefused(cached({"-o", file("p_%d.png"), "--orbit", "9", "--frames", "2", "--part", part}), 2,
                  {"--part " + std::string(part)});
  expectRefused(cached({"-o", file("p.png"), "--part", "1/2"}), 2, {"there is only one"});
  expectRefused(cached({"-o", file("p.mp4"), "--orbit", "9", "--part", "1/2"}), 2, {"ffmpeg"});
  expectRefused(
      cached({"-o", file("p_%d.png"), "--orbit", "9", "--part", "1/2", "--first-image", file("f.png")}), 2,
      {"--first-image"});
}

TEST_F(Frames, APathGoesThroughItsKeyFrames) {
  std::ofstream(file("path.json")) << R"({"key_frames": [
    {"time": 0, "position": [5, 0, 0.5], "focal_point": [-0.4, 0, 0.5], "view_up": [0, 0, 1],
     "parallel_scale": 1.5},
    {"time": 1, "position": [4, 3, 1.5], "focal_point": [-0.4, 0, 0.5], "view_up": [0, 0, 1],
     "parallel_scale": 1.2},
    {"time": 4, "position": [0, 5, 0.5], "focal_point": [-0.4, 0, 0.5], "view_up": [0, 1, 1],
     "parallel_scale": 0.9}]})";
  expectDrawn({"-o", file("path_%d.png"), "--path", file("path.json"), "--frames", "5"});
  expectDrawn({"-o", file("key_1.png"), "--position", "4,3,1.5", "--focal-point", "-0.4,0,0.5", "--view-up",
               "0,0,1", "--parallel-scale", "1.2"});
  expectDrawn({"-o", file("key_2.png"), "--position", "0,5,0.5", "--focal-point", "-0.4,0,0.5", "--view-up",
               "0,1,1", "--parallel-scale", "0.9"});
  EXPECT_EQ(bytes("path_1.png"), bytes("key_1.png"));
  EXPECT_EQ(bytes("path_4.png"), bytes("key_2.png"));
  EXPECT_NE(bytes("path_2.png"), bytes("path_3.png"));
  std::ofstream(file("broken.json")) << R"({"key_frames": [{"time": 0, "position": [5, 0]}]})";
  expectRefused(cached({"-o", file("broken_%d.png"), "--path", file("broken.json"), "--frames", "5"}), 1,
                {"key_frames[0].position"});
  expectRefused(cached({"-o", file("broken_%d.png"), "--path", file("none.json"), "--frames", "5"}), 1,
                {"none.json"});
}

TEST_F(Frames, CamerasOfAPathMoveWithItsScale) {
  std::ofstream(file("scaled.json"))
      << R"({"scale": [1, 1, 2], "key_frames": [{"time": 0, "position": [5, 0, 2], "focal_point": [-0.4, 0, 1],
      "view_up": [0, 0, 1], "parallel_scale": 1.5}]})";
  const Words film{"--path", file("scaled.json"), "--frames", "1"};
  const auto expectCamera = [&](const Words& scale, const Words& camera) {
    run(cached(Words{"-o", file("scaled_%d.png")} + film + scale));
    run(cached(Words{"-o", file("still.png"), "--parallel-scale", "1.5"} + camera + scale));
    EXPECT_EQ(bytes("scaled_0.png"), bytes("still.png")) << scale.back();
  };
  expectCamera({"--vertical-scale", "3"}, {"--position", "5,0,2.5", "--focal-point", "-0.4,0,1.5"});
  expectCamera({"--scale", "1,1,2"}, {"--position", "5,0,2", "--focal-point", "-0.4,0,1"});
  expectCamera({"--scale", "1,1,1"}, {"--position", "5,0,1.5", "--focal-point", "-0.4,0,0.5"});
}

TEST_F(Frames, AFilmShowsTheFunctionsAndCutsOfItsKeyFrames) {
  const std::string camera =
      R"("position": [5, 0, 0.5], "focal_point": [-0.4, 0, 0.5], "view_up": [0, 0, 1], "parallel_scale": 1.5)";
  std::ofstream(file("film.json")) << fmt::format(
      R"({{"scalar": "f", "key_frames": [
    {{"time": 0, {0}, "function": {{"map": "viridis", "range": [0.25, 2], "opacities": "0:0,0.5:0.7,1:0.1",
      "opacity_unit": 0.5}}, "clip_planes": [[0, 0, 0.5, 0, 0, 1]], "slices": [[0, 0, 0.5, 0, 0, 1]]}},
    {{"time": 2, {0}, "function": {{"map": "plasma", "range": [0, 1.5], "opacities": "0:0.1,1:0.5",
      "opacity_unit": 0.25}}, "clip_planes": [[0, 0, 0.25, 0, 0, 1]], "clip_box": [-2, 2, -2, 1, -2, 2]}}]}})",
      camera);
  const Words still{"--scalar",      "f",          "--position",   "5,0,0.5",
                    "--focal-point", "-0.4,0,0.5", "--scalar-bar", "--parallel-scale",
                    "1.5",           "--opacity"};
  const Words first{"0:0,0.5:0.7,1:0.1", "--tf", "viridis",      "--range",      "0.25,2",
                    "--opacity-unit",    "0.5",  "--clip-plane", "0,0,0.5,0,0,1"};
  const Words last{"0:0.1,1:0.5",    "--tf",           "plasma",        "--range",
                   "0,1.5",          "--opacity-unit", "0.25",          "--clip-plane",
                   "0,0,0.25,0,0,1", "--clip-box",     "-2,2,-2,1,-2,2"};
  run(cached(Words{"-o", file("still_0.png"), "--slice", "0,0,0.5,0,0,1"} + still + first));
  run(cached(Words{"-o", file("still_2.png")} + still + last));
  const Words film{"--path", file("film.json"), "--frames", "3", "--scalar-bar"};
  const ProgramResult drawn = run(cached(Words{"-o", file("film_%d.png")} + film));
  EXPECT_EQ(drawn.err, "");
  EXPECT_EQ(drawn.out.find("chosen from the data"), std::string::npos) << drawn.out;
  EXPECT_EQ(bytes("film_0.png"), bytes("still_0.png"));
  EXPECT_EQ(bytes("film_2.png"), bytes("still_2.png"));
  EXPECT_NE(bytes("film_1.png"), bytes("still_0.png"));
  EXPECT_NE(bytes("film_1.png"), bytes("still_2.png"));
  // Each frame is the same whatever was drawn before it; also where the film has the colours alone.
  run(cached(Words{"-o", file("part_%d.png"), "--part", "2/3"} + film));
  EXPECT_EQ(bytes("film_1.png"), bytes("part_1.png"));
  const Words opacities{"--opacity-by", "f",         "--opacity-range", "0,1",
                        "--opacity",    "0:0,1:0.5", "--opacity-unit",  "0.5"};
  run(cached(Words{"-o", file("two_%d.png")} + film + opacities));
  run(cached(Words{"-o", file("two_still.png"), "--tf", "plasma", "--range", "0,1.5", "--clip-plane",
                   "0,0,0.25,0,0,1", "--clip-box", "-2,2,-2,1,-2,2"} +
             Words(still.begin(), still.end() - 1) + opacities));
  EXPECT_EQ(bytes("two_2.png"), bytes("two_still.png"));

  for (const auto& [more, word] :
       {std::pair<Words, const char*>{{"--tf", "grey", "--range", "0,1"}, "--tf and --range"},
        {{"--clip-plane", "0,0,0,0,0,1"}, "--clip-plane"},
        {{"--clip-box", "0,1,0,1,0,1"}, "--clip-box"},
        {{"--slice", "0,0,0,0,0,1"}, "--slice"},
        {{"--scalar", "g"}, "--scalar"}})
    expectRefused(cached(Words{"-o", file("no_%d.png")} + film + more), 2,
                  {"film.json: its key frames have", word});
  run(cached(Words{"-o", file("alone_%d.png"), "--volume", "off"} + film));  // with the slice of the film
}

TEST_F(Frames, AFailingFrameIsNamedAndTheOnesBeforeItStay) {
  // Half way the camera passes through its focal point.
  std::ofstream(file("through.json")) << R"({"key_frames": [
    {"time": 0, "position": [4, 0, 0], "focal_point": [0, 0, 0], "view_up": [0, 0, 1], "parallel_scale": 2},
    {"time": 4, "position": [-4, 0, 0], "focal_point": [0, 0, 0], "view_up": [0, 0, 1], "parallel_scale": 2}]})";
  expectRefused(cached({"-o", file("through_%d.png"), "--path", file("through.json"), "--frames", "5"}), 1,
                {"frame 2:"});
  EXPECT_TRUE(fs::exists(file("through_1.png")));
  EXPECT_FALSE(fs::exists(file("through_2.png")));

  fs::create_directory(file("disk_3.png"));  // nothing can be written there
  expectRefused(cached({"-o", file("disk_%d.png"), "--orbit", "90", "--frames", "5"}), 1, {"frame 3:"});
  EXPECT_TRUE(fs::exists(file("disk_2.png")));
  EXPECT_FALSE(fs::exists(file("disk_4.png")));
}

TEST_F(Frames, StatisticsListFramesAndTheirPercentiles) {
  expectDrawn({"-o", file("s_%d.png"), "--orbit", "90", "--frames", "20", "--size", "16x16", "--stats",
               file("s.json")});
  const auto stats = json("s.json");
  ASSERT_EQ(stats["frames"].size(), 20u);
  EXPECT_EQ(stats["summary"]["frames"], 20);
  std::vector<double> totals;
  for (const auto& frame : stats["frames"]) totals.push_back(frame["seconds"]["total"]);
  std::sort(totals.begin(), totals.end());
  const auto& summary = stats["summary"]["seconds"]["total"];
  EXPECT_EQ(summary["p50"], totals[9]);
  EXPECT_EQ(summary["p95"], totals[18]);
  EXPECT_EQ(summary["max"], totals[19]);
  for (const char* key : {"plan", "read", "decode", "project", "sort", "upload", "draw",
                          "workers_waited_for_reads", "workers_waited"})
    EXPECT_TRUE(stats["summary"]["seconds"][key]["p95"].is_number()) << key;
  for (const char* key : {"bricks_drawn", "bricks_cached", "splats_drawn", "bytes_read", "mean_queue_depth"})
    EXPECT_TRUE(stats["summary"][key]["p50"].is_number()) << key;
  // All of it stays in memory: the frames read every brick at most once.
  uint64_t bricks_read = 0;
  for (const auto& frame : stats["frames"]) {
    bricks_read += frame["bricks_read"].get<uint64_t>();
    EXPECT_EQ(frame["bricks_read"].get<uint64_t>() + frame["bricks_cached"].get<uint64_t>(),
              frame["bricks_drawn"]);
  }
  EXPECT_LE(bricks_read, CacheReader(cache()).bricks().size());
}

TEST_F(Frames, MaxSplatsHolds) {
  const auto draw = [](const std::string& of, const std::string& output, const Words& more) {
    run(Words{"render", of, "-o", file(output), "--stats", file("splats.json"), "--lod-pixels", "0", "--size",
              "64x64"} +
        more);
  };
  draw(large(), "few.exr", {"--max-splats", "98765"});
  EXPECT_LE(json("splats.json")["frames"][0]["splats_read"], 98765);
  EXPECT_EQ(json("splats.json")["max_splats"], 98765);
  // More than there are change nothing.
  draw(cache(), "many.exr", {"--max-splats", "9M"});
  draw(cache(), "free.exr", {});
  EXPECT_EQ(bytes("many.exr"), bytes("free.exr"));
}

TEST_F(Frames, AFirstImageIsWrittenEarlierAndLooksLikeTheFinalOne) {
  const Words direct{"render", large(), "-o", file("direct.exr"), "--size", "256x256", "--channels", "none"};
  Words progressive = direct;
  progressive[3] = file("final.exr");
  run(direct);
  run(progressive + Words{"--first-image", file("first.exr"), "--stats", file("first.json")});
  EXPECT_EQ(bytes("final.exr"), bytes("direct.exr"));

  const double psnr_db = compareImages(readImage(file("first.exr")), readImage(file("final.exr"))).psnr_db;
  const auto stats = json("first.json");
  const auto &first = stats["first_image"], &final = stats["frames"][0];
  fmt::print("first image: {:.1f} dB, {} of {} splats\n", psnr_db, first["splats_read"].get<uint64_t>(),
             final["splats_read"].get<uint64_t>());
  EXPECT_GE(psnr_db, 25);
  EXPECT_GT(final["splats_read"], 150'000);
  EXPECT_LE(first["splats_read"], 100'000);
  EXPECT_LE(first["bytes_read"], 4 << 20);
  EXPECT_GT(stats["time_to_first_image_s"], 0);
}

TEST_F(Frames, AMovieIsRawFramesToFfmpeg) {
  // A stand-in that keeps its arguments and what it is given; its last argument is file:OUTPUT.
  const ScopedEnvironment path(
      "PATH", folderWith("ffmpeg", "for word; do echo \"$word\"; last=$word; done > '" + file("words") +
                                       "'\nexec cat > \"${last#file:}\"\n"));
  expectDrawn({"-o", file("movie.mp4"), "--orbit", "90", "--frames", "3", "--frame-rate", "12.5"});
  expectDrawn({"-o", file("movie_%d.png"), "--orbit", "90", "--frames", "3"});
  const std::string movie = bytes("movie.mp4"), words = bytes("words");
  ASSERT_EQ(movie.size(), 3u * 64 * 48 * 3);
  for (const char* word : {"\n64x48\n", "\n12.5\n", "\nrgb24\n", "\nrawvideo\n"}) expectSays(words, word);
  for (int frame = 0; frame < 3; ++frame) {
    const Image picture = readImage(file(fmt::format("movie_{}.png", frame)));
    for (size_t pixel = 0; pixel < 64 * 48; ++pixel)
      for (size_t c = 0; c < 3; ++c)
        ASSERT_EQ(static_cast<uint8_t>(movie[(frame * 64 * 48 + pixel) * 3 + c]),
                  std::lround(picture.rgba[4 * pixel + c] * 255))
            << frame << ' ' << pixel;
  }
}

TEST_F(Frames, APageHasThePicturesInIt) {
  expectDrawn(
      {"-o", file("a<b.html"), "--orbit", "90", "--frames", "3", "--frame-rate", "12.5", "--size", "65x47"});
  expectDrawn({"-o", file("page_%d.png"), "--orbit", "90", "--frames", "3", "--size", "65x47"});
  const std::string page = bytes("a<b.html");
  for (const char* text : {"<title>a&#60;b</title>", "1000 / 12.5", "width=\"65\" height=\"47\""})
    expectSays(page, text);
  size_t at = 0;
  for (int frame = 0; frame < 3; ++frame) {
    const std::string_view before = "data:image/png;base64,";
    at = page.find(before, at);
    ASSERT_NE(at, std::string::npos) << frame;
    std::string picture;
    uint32_t bits = 0;
    int count = 0;
    for (at += before.size(); page[at] != '"' && page[at] != '='; ++at) {
      const char c = page[at];
      const int six = c == '/'   ? 63
                      : c == '+' ? 62
                      : c <= '9' ? c - '0' + 52
                      : c <= 'Z' ? c - 'A'
                                 : c - 'a' + 26;
      bits = bits << 6 | static_cast<uint32_t>(six);
      if ((count += 6) >= 8) picture += static_cast<char>(bits >> (count -= 8));
    }
    EXPECT_TRUE(picture == bytes(fmt::format("page_{}.png", frame))) << frame;
  }
  EXPECT_EQ(page.find("data:", at), std::string::npos);
  // It loads nothing.
  for (const char* other : {"http", "src=\"/", "@import", "url("})
    EXPECT_EQ(page.find(other), std::string::npos) << other;
  expectRefused(cached({"-o", file("b.html")}), 2, {"--orbit, --path or --steps"});
  expectRefused(cached({"-o", file("none/b.html"), "--orbit", "90", "--frames", "2"}), 1, {"none"});
  EXPECT_FALSE(fs::exists(file("b.html")));
}

TEST_F(Frames, StoppedByASignalAreReportedAndLeaveNothingUnfinished) {
  for (const int signal : {SIGINT, SIGTERM, SIGHUP}) {
    const fs::path out = folder_->path() / fmt::format("stopped{}", signal);
    fs::create_directory(out);
    FolderWatch watch(out);
    RunningProgram program({"render", cache(), "-o", out / "f_%d.png", "--orbit", "360", "--frames", "99999",
                            "--size", "64x48", "--stats", out / "stats.json"});
    watch.waitUntil([&] { return fs::exists(out / "f_2.png"); });
    program.signal(signal);
    const ProgramResult result = program.wait();
    expectRefused(result, 128 + signal, {});
    const size_t frames = json(out / "stats.json")["frames"].size();
    EXPECT_GE(frames, 3u);
    expectSays(result.err, fmt::format("interrupted after {} of 99999 frames", frames));
    EXPECT_EQ(std::distance(fs::directory_iterator(out), {}), static_cast<ptrdiff_t>(frames + 1));
  }
}

TEST_F(Frames, AMovieStoppedByASignalIsRemoved) {
  const fs::path out = folder_->path() / "stopped_movie";
  fs::create_directory(out);
  const ScopedEnvironment path("PATH", folderWith("ffmpeg",
                                                  "for word; do last=$word; done\n"
                                                  "cat > \"${last#file:}\"\n"));
  FolderWatch watch(out);
  RunningProgram program(
      {"render", cache(), "-o", out / "m.mp4", "--orbit", "360", "--frames", "99999", "--size", "64x48"});
  const auto hasBytes = [&] {
    for (const auto& entry : fs::directory_iterator(out))
      if (entry.file_size() > 0) return true;
    return false;
  };
  watch.waitUntil(hasBytes);
  program.signal(SIGTERM);
  const ProgramResult result = program.wait();
  EXPECT_EQ(result.status, 128 + SIGTERM) << result.err;
  expectSays(result.err, "m.mp4 was not written");
  EXPECT_TRUE(fs::is_empty(out));
}

TEST_F(Frames, LeftoversOfAKilledRunAreRemovedByTheNext) {
  const fs::path out = folder_->path() / "killed";
  fs::create_directory(out);
  {
    const ScopedEnvironment path("PATH", folderWith("ffmpeg", "cat > /dev/null\n"));
    FolderWatch watch(out);
    RunningProgram program(
        {"render", cache(), "-o", out / "m.mp4", "--orbit", "360", "--frames", "99999", "--size", "64x48"});
    watch.waitUntil([&] { return !fs::is_empty(out); });
    program.signal(SIGKILL);
    EXPECT_EQ(program.wait().status, 128 + SIGKILL);
  }
  ASSERT_FALSE(fs::is_empty(out));
  expectDrawn({"-o", out / "a.png"});
  EXPECT_EQ(std::distance(fs::directory_iterator(out), {}), 1);
}

TEST_F(Frames, AMovieFollowsALink) {
  const ScopedEnvironment path("PATH", folderWith("ffmpeg",
                                                  "for word; do last=$word; done\n"
                                                  "exec cat > \"${last#file:}\"\n"));
  fs::create_symlink("linked.mp4", file("link.mp4"));
  expectDrawn({"-o", file("link.mp4"), "--orbit", "90", "--frames", "2"});
  EXPECT_TRUE(fs::is_symlink(file("link.mp4")));
  EXPECT_EQ(bytes("linked.mp4").size(), 2u * 64 * 48 * 3);
}

TEST_F(Frames, AMovieThatFailsLeavesNothing) {
  const Words movie{"-o", file("failed.mp4"), "--orbit", "90", "--frames", "3"};
  {
    const ScopedEnvironment path("PATH",
                                 folderWith("ffmpeg", "echo 'no such encoder' >&2\necho more >&2\nexit 3\n"));
    expectRefused(cached(movie), 1,
                  {"ffmpeg ended with status 3 before the movie was complete: no such encoder"});
  }
  {
    const ScopedEnvironment path("PATH", folderWith("ffmpeg", "cat > /dev/null\nkill -9 $$\n"));
    expectRefused(cached(movie), 1, {"signal 9"});
  }
  {
    const ScopedEnvironment path("PATH", file("empty"));
    expectRefused(cached(movie), 1, {"ffmpeg, which writes movies, was not found in PATH"});
  }
  for (const auto& entry : fs::directory_iterator(folder_->path()))
    for (const char* part : {"failed", ".curvisplat"})
      EXPECT_EQ(entry.path().filename().string().find(part), std::string::npos) << entry.path();
  expectRefused(cached({"-o", file("failed.mp4")}), 2, {"--orbit, --path or --steps"});
  expectRefused(cached({"-o", file("failed.mp4"), "--orbit", "9", "--frames", "2", "--size", "65x48"}), 2,
                {"even"});
  expectRefused(
      cached({"-o", file("failed.mp4"), "--orbit", "9", "--frames", "2", "--background", "transparent"}), 2,
      {"transparent"});
  expectRefused(cached({"-o", file("failed.mp4"), "--orbit", "9", "--frames", "2", "--frame-rate", "0"}), 2,
                {"--frame-rate"});
}

TEST_F(Frames, AMovieIsMadeWhereThereIsFfmpeg) {
  if (std::system("command -v ffmpeg > /dev/null") != 0) GTEST_SKIP() << "needs ffmpeg";
  expectDrawn({"-o", file("real.mp4"), "--orbit", "90", "--frames", "10"});
  const std::string head = bytes("real.mp4").substr(0, 12);
  EXPECT_EQ(head.substr(4, 4), "ftyp");
  expectDrawn({"-o", file("real.gif"), "--orbit", "90", "--frames", "3", "--size", "65x47"});
  EXPECT_EQ(bytes("real.gif").substr(0, 6), "GIF89a");
}

}  // namespace
}  // namespace curvisplat
