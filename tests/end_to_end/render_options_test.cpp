// `curvisplat render`, option by option, on a small half-annulus.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <glm/vec4.hpp>
#include <memory>
#include <span>

#include "preprocess/formats/plot3d/plot3d_writer.h"
#include "preprocess/scenes/scenes.h"
#include "render/colour/function_parts.h"
#include "render/image/image.h"
#include "render/image/image_file.h"
#include "stream/base/progress.h"
#include "tests/support/program_test.h"

namespace curvisplat {
namespace {

const glm::dvec3 kStretch(1, 0.5, 3);

/// The scene with its coordinates stretched, as another grid.
class StretchedSource : public GridSource {
 public:
  explicit StretchedSource(const GridSource& source) : source_(source) {}
  const GridDescription& description() const override { return source_.description(); }
  void read(uint32_t block, const NodeBox& box, std::span<const uint32_t> scalars,
            NodeArrays& out) const override {
    source_.read(block, box, scalars, out);
    for (double& x : out.x) x *= kStretch.x;
    for (double& y : out.y) y *= kStretch.y;
    for (double& z : out.z) z *= kStretch.z;
  }

 private:
  const GridSource& source_;
};

class RenderOptions : public ProgramSuite<RenderOptions> {
 protected:
  static void prepare() {
    const SceneGridSource scene(makeScene("half-annulus", std::nullopt), {48, 24, 24});
    convert(scene, "plain");
    convert(StretchedSource(scene), "stretched");
  }

  static void convert(const GridSource& source, const std::string& name) {
    Progress progress;
    writePlot3d(source, *folder_ / name, progress);
    run({"convert", file(name + ".xyz"), file(name + ".fun"), "-o", cache(name)});
  }
  static std::string cache(const std::string& name = "plain") { return file(name + ".splats"); }

  /// Renders the plain cache at 96x96, unless `options` have another size, and expects success.
  static Image render(const Words& options, const std::string& output = "a.exr",
                      const std::string& which = "plain") {
    last_ = run(sized(Words{"render", cache(which), "-o", file(output)} + options, "96x96"));
    return readImage(file(output));
  }
  /// Expects one line on stderr with `word` in it, this exit status, and no picture.
  static void expectNotDrawn(const Words& arguments, int status, const std::string& word) {
    const ProgramResult result = runProgram(arguments);
    expectRefused(result, status, {word});
    EXPECT_EQ(result.out, "");
  }
  static void expectUsageError(const Words& options, const std::string& word) {
    expectNotDrawn(Words{"render", cache(), "-o", file("refused.png")} + options, 2, word);
    EXPECT_FALSE(std::filesystem::exists(file("refused.png")));
  }

  static inline ProgramResult last_;
};

void expectPixel(const Image& image, int x, int y, const glm::vec4& expected, float tolerance = 0) {
  for (int c = 0; c < 4; ++c) EXPECT_NEAR(image.pixel(x, y)[c], expected[c], tolerance) << "channel " << c;
}

size_t pixelsOtherThan(const Image& image, const glm::vec4& background) {
  size_t count = 0;
  for (int y = 0; y < image.size.height; ++y)
    for (int x = 0; x < image.size.width; ++x)
      count += !std::equal(image.pixel(x, y), image.pixel(x, y) + 4, &background[0]);
  return count;
}

TEST_F(RenderOptions, DefaultsGiveAPictureAndTheOptionsThatWereChosen) {
  const Image image = render({}, "a.png");
  EXPECT_EQ(last_.err, "");
  EXPECT_EQ(lineCount(last_.out), 2) << last_.out;
  expectSays(last_.out, "chosen from the data: --tf glow --range");
  EXPECT_GT(pixelsOtherThan(image, kDefaultBackground), 96u * 96 / 10);
}

TEST_F(RenderOptions, SizeIsThatOfThePicture) {
  const Image image = render({"--size", "120x40"});
  EXPECT_EQ(image.size.width, 120);
  EXPECT_EQ(image.size.height, 40);
}

TEST_F(RenderOptions, BackgroundShowsWhereNothingIs) {
  expectPixel(render({"--background", "white"}), 0, 0, {1, 1, 1, 1});
  expectPixel(render({"--background", "black"}), 0, 0, {0, 0, 0, 1});
  expectPixel(render({"--background", "#ff8000"}), 0, 0, {1, 128 / 255.0f, 0, 1}, 1e-6f);
}

TEST_F(RenderOptions, TransparentPngHasTheDatasAlpha) {
  const Image transparent = render({"--tf", "viridis", "--background", "transparent"}, "a.png");
  const Image black = render({"--tf", "viridis", "--background", "black"}, "b.png");
  expectPixel(transparent, 0, 0, {0, 0, 0, 0});
  bool translucent = false;
  for (size_t n = 0; n < transparent.rgba.size(); n += 4) {
    const float alpha = transparent.rgba[n + 3];
    translucent |= alpha > 0.2f && alpha < 0.8f;
    // PNG's colours are not multiplied by alpha: their rounding shrinks with it, black's does not.
    for (size_t c = 0; c < 3; ++c)
      ASSERT_NEAR(transparent.rgba[n + c], black.rgba[n + c], 2.0 / 255) << "at " << n;
  }
  EXPECT_TRUE(translucent);
}

TEST_F(RenderOptions, ClipBoxLeavesTheRestEmpty) {
  const Words camera{
      "--position",       "-0.5,0,9", "--view-up",    "0,1,0", "--focal-point", "-0.5,0,0.5",
      "--parallel-scale", "1.2",      "--background", "white"};  // views fit what the box leaves
  const Image whole = render(camera), half = render(camera + Words{"--clip-box", "-2,2,-2,0,-2,2"});
  // Seen along z with y up and its centre, 0, in the middle: what is left is in the lower half. The scalar of cells at the
  // grid's borders is another where the box cuts them.
  size_t above = 0, below_differs = 0, above_whole = 0;
  for (int y = 0; y < 96; ++y)
    for (int x = 0; x < 96; ++x) {
      const bool drawn = half.pixel(x, y)[0] != 1 || half.pixel(x, y)[1] != 1 || half.pixel(x, y)[2] != 1;
      above += y < 43 && drawn;
      above_whole += y < 43 && whole.pixel(x, y)[1] != 1;
      const float difference = std::abs(half.pixel(x, y)[1] - whole.pixel(x, y)[1]);
      below_differs += difference > (y > 65 ? 1e-5f : y > 53 ? 1e-3f : 1.0f);
    }
  EXPECT_GT(above_whole, 500u);
  EXPECT_EQ(above, 0u);
  EXPECT_EQ(below_differs, 0u);
}

TEST_F(RenderOptions, ScaleIsTheScaledGrid) {
  const Image scaled =
      render({"--scale", fmt::format("{},{},{}", kStretch.x, kStretch.y, kStretch.z)}, "a.exr");
  const Image grid = render({}, "b.exr", "stretched");
  // Cells grow by other factors in the stretched grid, whose splats are moved and skewed by that.
  EXPECT_GT(compareImages(scaled, grid).psnr_db, 46);
  EXPECT_LT(compareImages(render({}), grid).psnr_db, 30) << "scaling changes nothing";
}

TEST_F(RenderOptions, ExrPfmAndPngAgree) {
  const Image exr = render({"--channels", "none"}, "a.exr"), pfm = render({}, "a.pfm"),
              png = render({}, "a.png");
  EXPECT_EQ(compareImages(exr, pfm).largest, 0);
  // With depth the background is put behind the picture afterwards: the last bit may differ.
  EXPECT_LE(compareImages(render({}, "a.exr"), pfm).largest, 2e-7);
  EXPECT_LE(compareImages(exr, png).largest, 0.5 / 255 + 1e-6);
}

TEST_F(RenderOptions, NarrowPerspectiveIsNearlyOrthographic) {
  const Image parallel = render({"--view", "iso"}), narrow = render({"--view-angle", "0.5"});
  EXPECT_GT(compareImages(parallel, narrow).psnr_db, 40);
  const Image wide = render({"--view-angle", "60"});
  EXPECT_LT(compareImages(parallel, wide).psnr_db, 30);
}

TEST_F(RenderOptions, APlacedCameraIsTheNamedOne) {
  // From a corner direction at the data's centre, (-0.5, 0, 0.5), z up, all of it in view: what iso does.
  const Image iso = render({"--view", "iso"}, "a.exr"),
              placed = render({"--position", "9.5,10,10.5"}, "b.exr");
  EXPECT_GT(compareImages(iso, placed).psnr_db, 60);
  const Image aside = render({"--position", "9.5,10,10.5", "--focal-point", "-0.4,0,0.5", "--view-up",
                              "0,1,0", "--parallel-scale", "2"});
  EXPECT_LT(compareImages(iso, aside).psnr_db, 30);
}

TEST_F(RenderOptions, AClipPlaneLeavesWhatABoxWithThatFaceLeaves) {
  const Words camera{
      "--position",       "-0.5,0,9", "--view-up",    "0,1,0", "--focal-point", "-0.5,0,0.5",
      "--parallel-scale", "1.2",      "--background", "white"};  // views fit what the box leaves
  const Image box = render(camera + Words{"--clip-box", "-9,9,-9,0.25,-9,9"}),
              plane = render(camera + Words{"--clip-plane", "3,0.25,7,0,-2,0"}),
              two = render(camera + Words{"--clip-plane", "0,0.25,0,0,-1,0", "--clip-plane=0,0,0,1,0,0"});
  EXPECT_LT(compareImages(box, plane).largest, 1e-5);
  EXPECT_GT(pixelsOtherThan(box, {1, 1, 1, 1}), 500u);
  size_t left = 0, right = 0;
  for (int y = 0; y < 96; ++y)
    for (int x = 0; x < 96; ++x) {
      const bool drawn = two.pixel(x, y)[1] != 1;
      left += x < 46 && drawn;
      right += x >= 50 && drawn;
    }
  EXPECT_EQ(left, 0u);
  EXPECT_GT(right, 40u);
}

TEST_F(RenderOptions, LightChangesColoursAndNotWhatIsCovered) {
  const Words lights[] = {{"--shade"},
                          {"--light", "0.2,0.5,0"},
                          {"--light-direction", "1,0,1"},
                          {"--shade", "--classify", "flat"}};
  // All splats: layers are merged in unlit pictures only.
  const Words covered{"--background", "transparent", "--lod-pixels", "0"};
  const Image unlit = render(covered, "a.exr");
  for (const auto& words : lights) {
    const Image shaded = render(covered + words, "a.exr");
    double changed = 0, alpha = 0;
    for (size_t n = 0; n < shaded.rgba.size(); ++n) {
      double& of = n % 4 == 3 ? alpha : changed;
      of = std::max(of, static_cast<double>(std::abs(shaded.rgba[n] - unlit.rgba[n])));
    }
    EXPECT_GT(changed, 0.02) << words.front();
    if (words.size() < 3) {
      EXPECT_LT(alpha, 0.002) << words.front();
    }
  }
}

TEST_F(RenderOptions, ARangeThatMissesTheScalarIsWarnedOf) {
  render({"--range", "5,6"});
  expectSays(last_.err, "warning: the range 5..6");
  expectSays(last_.err, "the picture is empty");
  expectSays(last_.err, "fully transparent");
  render({"--range", "-6,-5"});
  expectSays(last_.err, "warning: the range -6..-5");
  EXPECT_EQ(last_.err.find("empty"), std::string::npos) << last_.err;
}

TEST_F(RenderOptions, AnEmptyPictureIsExplained) {
  EXPECT_EQ(pixelsOtherThan(render({"--clip-box", "5,6,5,6,5,6"}), kDefaultBackground), 0u);
  expectSays(last_.err, "--clip-box contains none of the data");
  EXPECT_EQ(pixelsOtherThan(render({"--clip-plane", "9,0,0,1,0,0"}), kDefaultBackground), 0u);
  expectSays(last_.err, "--clip-plane and --clip-box leave none of the data");
  EXPECT_EQ(
      pixelsOtherThan(render({"--position", "9,0,0", "--focal-point", "9,9,0", "--parallel-scale", "1"}),
                      kDefaultBackground),
      0u);
  expectSays(last_.err, "does not see the data's box");
  render({"--opacity", "0:0,1:0"});
  expectSays(last_.err, "is fully transparent; choose another --tf or --opacity");
  render({"--gradient-opacity", "0:0,1:0"});
  expectSays(last_.err, "times --gradient-opacity is transparent for all visible values");
  render({"--zoom", "1e30"});
  expectSays(last_.err, "splats are off the screen; try --view iso, or a smaller --zoom");
  render({"--opacity-unit", "1e12"}, "a.png");
  expectSays(last_.err, "--opacity-unit");
}

TEST_F(RenderOptions, TransferFunctionFilesAreUsedAndTheirNotesPrinted) {
  std::ofstream(file("red.json")) << R"([{"Name": "red", "RGBPoints": [0,1,0,0, 1,1,0,0]}])";
  const Image image = render({"--tf", file("red.json"), "--background", "black"});
  EXPECT_EQ(lineCount(last_.err), 1) << last_.err;
  expectSays(last_.err, "note: ");
  expectSays(last_.err, "no Points");
  float red = 0, others = 0;
  for (size_t n = 0; n < image.rgba.size(); n += 4) {
    red = std::max(red, image.rgba[n]);
    others = std::max({others, image.rgba[n + 1], image.rgba[n + 2]});
  }
  EXPECT_GT(red, 0.1f);
  EXPECT_EQ(others, 0.0f);

  std::ofstream(file("bad.json")) << R"([{"Name": "bad", "RGBPoints": [0,1,0]}])";
  expectNotDrawn({"render", cache(), "-o", file("refused.png"), "--tf", file("bad.json")}, 1,
                 "RGBPoints is ");
}

TEST_F(RenderOptions, FlatClassificationAndLodDiffer) {
  const Image pixel = render({"--lod-pixels", "0"});
  EXPECT_GT(compareImages(pixel, render({"--lod-pixels", "0", "--classify", "flat"})).largest, 1e-3);
}

TEST_F(RenderOptions, WrongOptionsAreUsageErrors) {
  const struct {
    Words options;
    const char* word;
  } cases[] = {{{"--view", "iso", "--position", "1,2,3"}, "--view"},
               {{"--view", "iso", "--view-up", "0,0,1"}, "--view"},
               {{"--focal-point", "1,2,3"}, "--position"},
               {{"--view-up", "1,2,3"}, "--position"},
               {{"--position", "1,2,3", "--focal-point", "1,2,3"}, "focal point"},
               {{"--position", "1,2,3", "--view-up", "0,0,0"}, "--view-up"},
               {{"--position", "1,2"}, "x,y,z"},
               {{"--parallel-scale", "1", "--view-angle", "20"}, "--parallel-scale"},
               {{"--parallel-scale", "0"}, "--parallel-scale"},
               {{"--view-angle", "180"}, "--view-angle"},
               {{"--view-angle", "40", "--zoom", "0.2"}, "view angle of 40 degrees becomes 200"},
               {{"--zoom", "0"}, "--zoom"},
               {{"--azimuth", "east"}, "--azimuth"},
               {{"--path", "a.json", "--roll", "3"}, "key frames place the camera"},
               {{"--gradient-opacity", "0.5"}, "--gradient-opacity"},
               {{"--gradient-opacity", "0:0,2:1"}, "0 to 1"},
               {{"--view", "front"}, "iso"},
               {{"--size", "600"}, "WIDTHxHEIGHT"},
               {{"--size", "0x600"}, "WIDTHxHEIGHT"},
               {{"--size", "100000x600"}, "--size"},
               {{"--range", "1,1"}, "--range"},
               {{"--range", "2"}, "LO,HI"},
               {{"--range", "nan,1"}, "finite"},
               {{"--opacity-unit", "-1"}, "--opacity-unit"},
               {{"--lod-pixels", "-1"}, "--lod-pixels"},
               {{"--classify", "both"}, "--classify"},
               {{"--scale", "1,0,1"}, "--scale"},
               {{"--scale", "1,1,1e-7"}, "between 1e-06 and 1e+06"},
               {{"--scale", "1e7,1,1"}, "between 1e-06 and 1e+06"},
               {{"--clip-box", "1,0,0,1,0,1"}, "--clip-box"},
               {{"--clip-box", "0,1,0,1"}, "x0,x1,y0,y1,z0,z1"},
               {{"--clip-plane", "0,1,0,1"}, "px,py,pz,nx,ny,nz"},
               {{"--clip-plane", "0,0,0,0,0,0"}, "no direction"},
               {{"--clip-plane", "0,0,0,1,0,0", "--clip-plane", "0,0,0,1,0,0", "--clip-plane", "0,0,0,1,0,0",
                 "--clip-plane", "0,0,0,1,0,0", "--clip-plane", "0,0,0,1,0,0", "--clip-plane", "0,0,0,1,0,0",
                 "--clip-plane", "0,0,0,1,0,0"},
                "at most 6"},
               {{"--light", "0.5,0.6,0"}, "at most 1"},
               {{"--light", "-1,0,0"}, "between 0 and 1"},
               {{"--light", "1,0"}, "ambient,diffuse,specular"},
               {{"--light-direction", "0,0,0"}, "not 0,0,0"},
               {{"--shadow", "1.5"}, "--shadow 1.5: expected a number from 0 (none) to 1"},
               {{"--shadow", "dark"}, "--shadow"},
               {{"--ambient-occlusion", "nan"}, "--ambient-occlusion"},
               {{"--background", "pink"}, "#rrggbb"},
               {{"--background", "#12345g"}, "#rrggbb"},
               {{"--backend", "metal"}, "auto, osmesa, egl, egl-quads or cpu"},
               {{"--memory", "lots"}, "512M"},
               {{"--max-splats", "10"}, "--max-splats"},
               {{"--max-splats", "-1"}, "above zero"},
               {{"--first-image", "a.jpg"}, ".png"},
               {{"--orbit", "90"}, "all frames would have the same name"},
               {{"--path", "a.json"}, "all frames would have the same name"},
               {{"--frames", "3"}, "--orbit, --path"},
               {{"--orbit", "90", "--path", "a.json", "--frames", "3"}, "cannot be combined"},
               {{"--path", "a.json", "--frames", "3", "--view", "iso"}, "key frames place the camera"},
               {{"--orbit", "90", "--frames", "0"}, "1 to 100000"},
               {{"--orbit", "90", "--frames", "-3"}, "1 to 100000"},
               {{"--orbit", "90", "--frames", "3"}, "all frames would have the same name"},
               {{"--frame-rate", "24"}, "NAME.mp4, NAME.gif or NAME.html"},
               {{"--tf", "virdis"}, "did you mean viridis?"}};
  for (const auto& c : cases) {
    SCOPED_TRACE(c.options[0] + " " + c.options[1]);
    expectUsageError(c.options, c.word);
  }
  expectNotDrawn({"render", cache(), "-o", file("a.jpg")}, 2, ".png");
  expectNotDrawn({"render", cache(), "-o", file("a.avi"), "--orbit", "90"}, 2, "'.avi' is not the ending of");
  expectNotDrawn({"render", cache(), "-o", file("a.pfm"), "--background", "transparent"}, 2, "transparent");
}

TEST_F(RenderOptions, BadInputAndOutputAreOneLine) {
  expectNotDrawn({"render", cache(), "-o", file("a.png"), "--scalar", "entropy"}, 1, "entropy");
  expectNotDrawn({"render", cache("missing"), "-o", file("a.png")}, 1, "missing.splats");
  expectNotDrawn({"render", file("plain.xyz"), "-o", file("a.png")}, 1, "plain.xyz");
  expectNotDrawn({"render", cache(), "-o", file("no/a.png")}, 1, "no");
  expectNotDrawn({"render", cache(), "-o", file("a.png"), "--stats", file("no/a.json")}, 1, "--stats");
  expectNotDrawn({"render", cache(), "-o", file("a.png"), "--tf", file("missing.json")}, 1, "missing.json");
  std::filesystem::create_directory(file("folder.png"));
  expectNotDrawn({"render", cache(), "-o", file("folder.png")}, 1, "folder.png");
}

TEST_F(RenderOptions, ALimitAboveTheMachinesMemoryIsAccepted) {
  render({"--memory", "1000T"});
  run({"convert", file("plain.xyz"), file("plain.fun"), "-o", file("bounded.splats"), "--memory", "1000T"});
}

TEST_F(RenderOptions, AnUnknownScalarNamesThoseThereAre) {
  const ProgramResult result = runProgram({"render", cache(), "-o", file("a.png"), "--scalar", "entropy"});
  expectSays(result.err, "it has f");
  render({"--scalar", "f"});
}

TEST_F(RenderOptions, StatisticsReportWhatWasDone) {
  const std::string stats = file("stats.json");
  setenv("CURVISPLAT_START", "1", 1);  // a fork's command line is its parent's
  render({"--stats", stats, "--threads", "2", "--view-angle", "25", "--scale", "1,1,2", "--memory", "64M"});
  unsetenv("CURVISPLAT_START");
  const auto json = jsonOf(stats);
  for (const char* key : {"program",
                          "version",
                          "command",
                          "peak_memory_bytes",
                          "cache",
                          "scalar",
                          "image",
                          "backend",
                          "threads",
                          "memory_bytes",
                          "lod_pixels",
                          "classify",
                          "scale",
                          "clip_box",
                          "clip_planes",
                          "light",
                          "background",
                          "transfer_function",
                          "time_to_first_image_s",
                          "frames",
                          "summary"})
    EXPECT_TRUE(json.contains(key)) << key;
  ASSERT_EQ(json["frames"].size(), 1u);
  const auto& frame = json["frames"][0];
  for (const char* key : {"seconds",          "bricks_drawn",     "bricks_culled",
                          "splats_read",      "splats_drawn",     "bytes_read",
                          "largest_level",    "bricks_cached",    "bricks_read",
                          "read_requests",    "mean_queue_depth", "read_by",
                          "cache_peak_bytes", "pager_peak_bytes", "ring_peak_bytes",
                          "sweep_peak_bytes", "regions",          "slabs",
                          "bricks_again",     "bricks_unreadable"})
    EXPECT_TRUE(frame.contains(key)) << key;
  for (const char* key : {"plan", "read", "decode", "project", "sort", "upload", "draw", "total",
                          "workers_waited_for_reads", "workers_waited", "painter_waited"})
    EXPECT_TRUE(frame["seconds"][key].is_number()) << key;
  EXPECT_EQ(json["command"][1], "render");
  EXPECT_EQ(json["threads"], 2);
  EXPECT_EQ(json["memory_bytes"], 64 << 20);
  EXPECT_EQ(json["image"]["width"], 96);
  EXPECT_EQ(frame["camera"]["projection"], "perspective");
  EXPECT_EQ(frame["camera"]["view_angle_deg"], 25);
  EXPECT_EQ(json["scale"][2], 2);
  EXPECT_EQ(json["transfer_function"]["name"], "glow");
  EXPECT_GT(json["peak_memory_bytes"], 1 << 20);
  EXPECT_GT(frame["splats_drawn"], 0);
  EXPECT_GT(frame["bytes_read"], 0);
  EXPECT_GT(frame["read_requests"], 0);
  EXPECT_GT(frame["mean_queue_depth"], 0);
  EXPECT_EQ(frame["bricks_read"], frame["bricks_drawn"]);
  EXPECT_LE(frame["cache_peak_bytes"].get<uint64_t>() + frame["pager_peak_bytes"].get<uint64_t>() +
                frame["ring_peak_bytes"].get<uint64_t>() + frame["sweep_peak_bytes"].get<uint64_t>(),
            json["memory_bytes"].get<uint64_t>());
  EXPECT_GT(json["time_to_first_image_s"], 0);
  EXPECT_FALSE(json.contains("first_image"));
  for (const char* of : {"p50", "p95", "max"}) {
    EXPECT_EQ(json["summary"]["seconds"]["total"][of], frame["seconds"]["total"]);
    EXPECT_EQ(json["summary"]["splats_drawn"][of], frame["splats_drawn"]);
  }
}

}  // namespace
}  // namespace curvisplat
