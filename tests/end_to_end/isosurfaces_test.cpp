// Isosurfaces against the ray march with the exact crossings, nine rays a pixel: alone and in the volume, opaque and
// translucent, at all levels of detail, and the same picture by every painter, with any threads and memory.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <fstream>
#include <glm/geometric.hpp>
#include <map>
#include <memory>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "preprocess/scenes/scenes.h"
#include "render/image/image_file.h"
#include "render/mesh/triangle_mesh.h"
#include "stream/base/file.h"
#include "tests/reference/known_pictures.h"
#include "tests/support/fault_sweep.h"
#include "tests/support/program_test.h"

namespace curvisplat {
namespace {

constexpr ImageSize kIsoPicture{256, 256};
constexpr double kValue = 0.5;

class Isosurfaces : public ProgramSuite<Isosurfaces> {
 protected:
  static void prepare() {
    // The first has more nodes than isosurfaces are contoured in the cells of, the second has not.
    convertGrid(SceneGridSource(makeScene("half-annulus"), {130, 64, 64}), *folder_ / "a.splats");
    convertGrid(SceneGridSource(makeScene("half-annulus"), {128, 64, 64}), *folder_ / "cells.splats");
  }

  /// Nine rays a pixel: outlines are smooth.
  Image marched(const OpticalFunction& exact, const glm::dvec3& colour, double opacity) const {
    const SceneField field(*annulus_);
    constexpr int kFine = 3;
    MarchSteps steps = stepsFor(field);
    if (exact(kValue).extinction == 0) steps.step = 1;  // the surface alone, whose places are exact
    const Image fine = toImage(referenceMarch(field, exact, halfAnnulusCamera(),
                                              {kFine * kIsoPicture.width, kFine * kIsoPicture.height}, steps,
                                              {nullptr, isoLayer(*annulus_, kValue, colour, opacity)}));
    Image image(kIsoPicture);
    for (int y = 0; y < kFine * kIsoPicture.height; ++y)
      for (int x = 0; x < kFine * kIsoPicture.width; ++x)
        for (size_t c = 0; c < 4; ++c)
          image.pixel(x / kFine, y / kFine)[c] += fine.pixel(x, y)[c] / (kFine * kFine);
    return image;
  }
  Image drawn(const TransferFunction& table, double opacity, bool volume, double lod,
              Backend backend = Backend::kCpu, const char* cache = "a.splats") const {
    FrameOptions options = knownFrame(size_);
    options.lod_pixels = lod;
    auto scene = std::make_shared<SurfaceScene>();
    scene->isovalues = {kValue};
    scene->iso_opacity = {opacity};
    scene->volume = volume;
    options.scene = scene;
    return drawCache(*folder_ / cache, table, halfAnnulusCamera(), options, nullptr, backend);
  }

  /// How far places are from the true surface, by the closed form and its slope; the least first.
  std::vector<double> distances(const std::vector<glm::dvec3>& places) const {
    std::vector<double> off;
    for (const glm::dvec3& at : places) {
      glm::dvec3 slope;
      for (int axis = 0; axis < 3; ++axis) {
        glm::dvec3 step(0.0);
        step[axis] = 1e-4;
        slope[axis] = (annulus_->scalar(at + step) - annulus_->scalar(at - step)) / 2e-4;
      }
      off.push_back(std::abs(annulus_->scalar(at) - kValue) / glm::length(slope));
    }
    std::sort(off.begin(), off.end());
    return off;
  }

  ImageSize size_ = kIsoPicture;  // of what is drawn
  const std::shared_ptr<const Scene> annulus_ = makeScene("half-annulus");
};

TEST_F(Isosurfaces, CrossingsHaveTheirOpacityAndTheirLight) {
  const KnownFunction function = KnownFunction::of("smooth");
  const glm::dvec3 colour = function.table.at(kValue).colour;
  const OpticalFunction nothing = [](double) { return OpticalProperties{}; };
  // By each splat's own crossings and normals the first row was at 36.4 dB, with four rays at outlines at 40.
  // Most of what is left is at outlines. In cells it is all at outlines, where surfaces have eight samples a pixel.
  const struct {
    double opacity;
    bool volume;
    std::array<double, 3> least_db;  // at the finest level, at 4 and at 8 pixels
    double least_in_cells_db;
  } pictures[] = {{1, false, {45.5, 45.5, 45}, 45},
                  {0.5, false, {48, 48, 47.5}, 47},
                  {1, true, {51.5, 51.5, 51}, 51},
                  {0.5, true, {54, 54, 53.5}, 52}};
  for (const auto& [opacity, volume, least_db, least_in_cells_db] : pictures) {
    if ((opacity < 1) != volume && !faults::isWholeSweep()) continue;
    const Image reference = marched(volume ? function.exact : nothing, colour, opacity);
    for (size_t n = 0; n < 3; ++n) {
      if (n == 1 && !faults::isWholeSweep()) continue;
      const double lod = std::array{0.0, 4.0, 8.0}[n];
      const double db = compareImages(drawn(function.table, opacity, volume, lod), reference).psnr_db;
      fmt::print("isosurface {} {}, {} pixels: {:.1f} dB\n", opacity, volume ? "in the volume" : "alone", lod,
                 db);
      EXPECT_GE(db, least_db[n]) << opacity << ' ' << volume << ' ' << lod;
    }
    const Image in_cells = drawn(function.table, opacity, volume, 0, Backend::kCpu, "cells.splats");
    const double db = compareImages(in_cells, reference).psnr_db;
    fmt::print("isosurface {} in cells: {:.1f} dB\n", opacity, db);
    EXPECT_GE(db, least_in_cells_db) << opacity << ' ' << volume;
  }
}

TEST_F(Isosurfaces, EveryPainterDrawsTheSame) {
  const TransferFunction table = KnownFunction::of("smooth").table;
  size_ = {96, 96};
  for (const bool volume : {false, true}) {
    const Image cpu = drawn(table, 1, volume, 8);
    EXPECT_GT(compareImages(drawn(table, 1, volume, 8, Backend::kOsmesa), cpu).psnr_db, 50) << volume;
  }
}

TEST_F(Isosurfaces, MeshesLieOnThemWithoutGaps) {
  const std::string said =
      run({"export", file("a.splats"), "-o", file("a.ply"), "--iso", "0.5", "--voxels", "200"}).out;
  expectSays(said, "a.ply: isosurface of f at 0.5: ");
  const InputFile ply(file("a.ply"));
  std::vector<std::byte> bytes(ply.size());
  ply.readAt(0, std::span(bytes));
  const RawMesh mesh = parseMesh(bytes, file("a.ply"));
  ASSERT_GT(mesh.triangles.size(), 10000u);
  const std::vector<double> off = distances(mesh.positions);  // a cell of the grid is 0.02 to 0.05 long
  fmt::print("mesh: 99 % within {:.5f}, all within {:.5f}\n", off[off.size() * 99 / 100], off.back());
  EXPECT_LT(off[off.size() * 99 / 100], 0.01);
  // An edge belongs to two triangles, once in each direction, or lies at the data's border.
  std::map<std::pair<uint32_t, uint32_t>, int> edges;
  for (const auto& corners : mesh.triangles)
    for (size_t n = 0; n < 3; ++n) ++edges[{corners[n], corners[(n + 1) % 3]}];
  size_t open = 0, inside = 0;
  for (const auto& [edge, count] : edges) {
    EXPECT_EQ(count, 1);
    if (edges.contains({edge.second, edge.first})) continue;
    ++open;
    const glm::dvec3 middle = 0.5 * (mesh.positions[edge.first] + mesh.positions[edge.second]);
    bool all = true;
    for (int n = 0; n < 6; ++n) {
      glm::dvec3 step(0.0);
      step[n / 2] = n % 2 ? 0.03 : -0.03;
      all = all && annulus_->contains(middle + step);
    }
    inside += all;
  }
  EXPECT_GT(open, 0u);
  EXPECT_EQ(inside, 0u) << "of " << open;
  // The same triangles in every format and with little memory.
  for (const char* name : {"a.vtp", "a.stl"})
    run({"export", file("a.splats"), "-o", file(name), "--iso", "0.5", "--voxels", "200", "--memory", "24M"});
  EXPECT_EQ(readMeshFile(file("a.stl")).triangles.size(), readMeshFile(file("a.ply")).triangles.size());
  run({"export", file("a.splats"), "-o", file("b.ply"), "--iso", "0.5", "--voxels", "200", "--memory",
       "24M"});
  const InputFile again(file("b.ply"));
  std::vector<std::byte> more(again.size());
  again.readAt(0, std::span(more));
  EXPECT_EQ(more, bytes);
}

TEST_F(Isosurfaces, MeshesOfTheGridsOwnCellsLieOnThemToo) {
  const std::string grid = file("own.xyz"), cache = file("own.splats");
  run({"generate", "half-annulus", "--size", "97x49x49", "-o", file("own")});
  run({"convert", grid, file("own.fun"), "-o", cache});
  const ProgramResult exported = run({"export", cache, "-o", file("own.ply"), "--iso", "0.5", "--source"});
  EXPECT_EQ(exported.err, "");
  const std::string& said = exported.out;
  expectSays(said, "own.ply: isosurface of f at 0.5: ");
  expectSays(said, "of the cells of " + grid);
  const InputFile first(file("own.ply"));
  std::vector<std::byte> bytes(first.size());
  first.readAt(0, std::span(bytes));
  const RawMesh mesh = parseMesh(bytes, file("own.ply"));
  ASSERT_GT(mesh.triangles.size(), 1000u);
  const std::vector<double> off = distances(mesh.positions);
  EXPECT_LT(off[off.size() * 99 / 100], 0.01);
  // Little memory, or files that are named, must give the same bytes.
  run({"export", cache, "-o", file("again.ply"), "--iso", "0.5", "--memory", "32M", "--source", grid,
       file("own.fun")});
  const InputFile again(file("again.ply"));
  std::vector<std::byte> more(again.size());
  again.readAt(0, std::span(more));
  EXPECT_EQ(more, bytes);
  run({"generate", "wake", "--size", "97x49x49", "-o", file("other")});
  const ProgramResult other =
      run({"export", cache, "-o", file("other.ply"), "--iso", "0.5", "--source", grid, file("other.fun")});
  expectSays(other.err, "warning: f is from 0.14");
  expectSays(other.err, "they may be of another time step");
  // Probes compare values at their points.
  const auto probed = [&](const std::string& values) {
    return run({"info", cache, "--probe-line", "-0.75,-0.3,0.1", "-0.6,0.4,0.9", "12", "--source", grid,
                values})
        .err;
  };
  EXPECT_EQ(probed(file("own.fun")), "");
  expectSays(probed(file("other.fun")),
             "the files of --source have no values within the ranges of the cache; they may be");
  std::string values = readTextFile(file("own.fun"));  // four integers, then the values: 0.14 to 1
  for (size_t at = 4 * sizeof(int32_t); at < values.size(); at += sizeof(float)) {
    float value = 0;
    std::memcpy(&value, &values[at], sizeof value);
    value = 1.14f - value;
    std::memcpy(&values[at], &value, sizeof value);
  }
  std::ofstream(file("turned.fun"), std::ios::binary) << values;
  std::filesystem::copy_file(file("own.nam"), file("turned.nam"));
  expectSays(probed(file("turned.fun")), "in the files of --source; they may be of another time step");
  const struct {
    Words options;
    int status;
    std::string words;
  } refused[] = {
      {{"-o", file("c.ply"), "--iso", "7", "--source"},
       2,
       "--iso 7: no isosurface: the values of f go from "},
      {{"-o", file("c.ply"), "--source"}, 2, "--source needs an isosurface: --iso VALUE"},
      {{"-o", file("c.ply"), "--iso", "0.5", "--voxels", "9", "--source"},
       2,
       "--voxels cannot be combined with --source"},
      {{"-o", grid, "--iso", "0.5", "--source"}, 2, "expected a name that ends with .ply, .stl or .vtp"},
      {{"-o", file("c.ply"), "--iso", "0.5", "--source", file("a.ply")}, 1, "a.ply"}};
  for (const auto& [options, status, words] : refused) {
    const ProgramResult result = runProgram(Words{"export", cache} + options);
    EXPECT_EQ(result.status, status) << result.err;
    expectSays(result.err, words);
  }
  const ProgramResult nowhere =
      runProgram({"export", file("a.splats"), "-o", file("c.ply"), "--iso", "0.5", "--source"});
  EXPECT_EQ(nowhere.status, 1);
  expectSays(nowhere.err, "name them after --source");
}

TEST_F(Isosurfaces, MeshesThatCannotBeAreRefused) {
  const struct {
    Words options;
    int status;
    std::string words;
  } refused[] = {
      {{"-o", file("c.vdb"), "--iso", "0.5"},
       2,
       "expected a name that ends with .ply, .stl or .vtp for --iso"},
      {{"-o", file("c.stl")}, 2, ".stl files hold isosurfaces; give --iso VALUE"},
      {{"-o", file("c.ply"), "--iso", "7"}, 2, "--iso 7: no isosurface: the values of f go from "},
      {{"-o", file("c.ply"), "--iso", "0.5", "--tf", "glow"}, 2, "--tf cannot be combined with --iso"},
      {{"-o", file("c.ply"), "--iso", "0.5", "--memory", "1M"}, 2, "is too little for an isosurface by"}};
  for (const auto& [options, status, words] : refused) {
    const ProgramResult result = runProgram(Words{"export", file("a.splats")} + options);
    EXPECT_EQ(result.status, status) << result.err;
    expectSays(result.err, words);
  }
}

TEST_F(Isosurfaces, TheProgramDrawsThemAndRefusesWrongUsage) {
  const std::string output = file("a.pfm");
  const auto render = [&](const Words& more) {
    return Words{"render",  file("a.splats"), "-o",  output,         "--size",
                 "150x150", "--view",         "iso", "--background", "white"} +
           more;
  };
  const std::string said = run(render({"--iso", "0.4,0.6", "--volume", "off"})).out;
  expectSays(said, "a.pfm: isosurfaces in ");
  EXPECT_EQ(said.find(" 0 splats"), std::string::npos) << said;
  const Image once = readImage(output);
  size_t seen = 0;
  for (size_t n = 0; n < once.rgba.size(); n += 4) seen += once.rgba[n] < 0.9f;
  EXPECT_GT(seen, 500u);
  run(render({"--iso", "0.4", "--iso", "0.6", "--volume", "off", "--threads", "1", "--memory", "96M"}));
  EXPECT_EQ(readImage(output).rgba, once.rgba);
  const struct {
    Words options;
    int status;
    std::string words;
  } refused[] = {{{"--iso", "7"}, 2, "--iso 7: no isosurface: the values of f go from "},
                 {{"--iso", "x"}, 2, "--iso"},
                 {{"--iso-opacity", "0.5"}, 2, "--iso-opacity needs an isosurface: --iso VALUE"},
                 {{"--iso", "0.5", "--iso-opacity", "2"}, 2, "--iso-opacity 2: expected a number above 0"},
                 {{"--iso-colour", "#ff0000"}, 2, "--iso-colour needs an isosurface: --iso VALUE"},
                 {{"--iso", "0.5", "--iso-colour", "red"}, 2, "--iso-colour"},
                 {{"--iso", "0.5", "--iso-colour", "transparent"}, 2, "give #rrggbb, and --iso-opacity"},
                 {{"--iso", "0.4,0.5,0.6", "--iso-colour", "#ff0000,function"},
                  2,
                  "--iso-colour: has 2 colours for 3 isosurfaces"}};
  for (const auto& [options, status, words] : refused) {
    const ProgramResult result = runProgram(render(options));
    EXPECT_EQ(result.status, status) << result.err;
    expectSays(result.err, words);
  }
}

/// A surface with a colour c is lit to factor c + white in each channel, clamped at 1: grey and red pictures have the same factor and
/// white. Both in the cells of a grid and in the field of splats, and where another scalar has the colours.
TEST_F(Isosurfaces, HaveColoursOfTheirOwn) {
  constexpr float kGrey = 0.4f;  // #666666, which the map "grey" has at 0.4
  const auto draw = [&](const std::string& cache, const Words& more) {
    run(Words{"render", file(cache), "-o", file("a.pfm"), "--size", "100x100", "--view", "iso",
              "--background", "#000000", "--volume", "off", "--iso", "0.4", "--no-scalar-bar"} +
        more);
    return readImage(file("a.pfm"));
  };
  const Words grey{"--scalar", "f", "--tf", "grey", "--range", "0,1"};
  for (const std::string cache : {"a.splats", "cells.splats"}) {
    const Image by_function = draw(cache, grey), own = draw(cache, grey + Words{"--iso-colour", "#666666"});
    const Image red = draw(cache, grey + Words{"--iso-colour", "#ff0000"});
    size_t seen = 0;
    for (size_t n = 0; n < own.rgba.size(); n += 4) {
      for (size_t c = 0; c < 3; ++c) EXPECT_NEAR(by_function.rgba[n + c], own.rgba[n + c], 1e-3f) << cache;
      const float white = red.rgba[n + 1];
      EXPECT_EQ(white, red.rgba[n + 2]);
      // Pixels at outlines are means of several rays, whose whites and factors are clamped one by one.
      if (red.rgba[n] >= 1) continue;
      EXPECT_NEAR((own.rgba[n] - white) / kGrey, red.rgba[n] - white, 2e-3f) << cache;
      seen += red.rgba[n] > 0.2f;
    }
    EXPECT_GT(seen, 300u) << cache;
    EXPECT_EQ(draw(cache, grey + Words{"--iso-colour", "function"}).rgba, by_function.rgba);
  }
}

}  // namespace
}  // namespace curvisplat
