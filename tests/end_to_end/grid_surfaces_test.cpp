// Faces of the grid as surfaces in the volume: against the ray march of the same, at any level of detail, the same
// picture by every painter, and what is refused.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <glm/geometric.hpp>
#include <memory>
#include <set>

#include "preprocess/convert/convert.h"
#include "preprocess/scenes/scenes.h"
#include "render/image/image_file.h"
#include "render/surface/face_meshes.h"
#include "stream/base/error.h"
#include "stream/cache/faces_file.h"
#include "tests/reference/function_grid.h"
#include "tests/reference/known_pictures.h"
#include "tests/support/fault_sweep.h"
#include "tests/support/program_test.h"

namespace curvisplat {
namespace {

constexpr ImageSize kCylinderPicture{256, 256};
const glm::vec3 kCylinderColour{0.6f, 0.7f, 0.8f};
constexpr double kInner = 0.3;

/// The half-annulus's inner cylinder, jmin, lit from where the viewer is.
std::vector<ReferenceLayer> innerWall(const Scene& scene, const glm::dvec3& origin,
                                      const glm::dvec3& direction) {
  const double a = direction.x * direction.x + direction.y * direction.y;
  const double b = origin.x * direction.x + origin.y * direction.y;
  const double c = origin.x * origin.x + origin.y * origin.y - kInner * kInner;
  const double root2 = b * b - a * c;
  if (root2 <= 0) return {};
  for (const double sign : {-1.0, 1.0}) {
    const double distance = (-b + sign * std::sqrt(root2)) / a;
    const glm::dvec3 at = origin + distance * direction;
    const glm::dvec3 normal = glm::dvec3(at.x, at.y, 0) / kInner;
    if (!scene.contains(at + 1e-9 * normal)) continue;
    const glm::dvec3 colour =
        (0.3 + 0.7 * std::abs(glm::dot(normal, direction))) * glm::dvec3(kCylinderColour);
    return {{distance, colour, 1}};
  }
  return {};
}

/// The mean of 2 x 2 rays a pixel.
Image marchedCylinder(const Scene& scene, const KnownFunction& function, const Camera& camera) {
  const SceneField field(scene);
  const ImageSize size{2 * kCylinderPicture.width, 2 * kCylinderPicture.height};
  const Image image =
      toImage(referenceMarch(field, function.exact, camera, size, stepsFor(field),
                             {nullptr, [&](const glm::dvec3& origin, const glm::dvec3& direction) {
                                return innerWall(scene, origin, direction);
                              }}));
  Image mean(kCylinderPicture);
  for (int y = 0; y < size.height; ++y)
    for (int x = 0; x < size.width; ++x)
      for (int c = 0; c < 4; ++c) mean.pixel(x / 2, y / 2)[c] += image.pixel(x, y)[c] / 4;
  return mean;
}

std::shared_ptr<SurfaceScene> sceneOfFace(const std::filesystem::path& cache, int axis, FaceSide side) {
  auto scene = std::make_shared<SurfaceScene>();
  GridSurface& surface = scene->grid_surfaces.emplace_back();
  surface.faces = FacesReader::open(cache, CacheReader(cache).manifest());
  surface.colour = kCylinderColour;
  for (uint32_t n = 0; n < surface.faces->faces().size(); ++n) {
    const GridFace& face = surface.faces->faces()[n];
    if (face.axis == axis && face.side == side)
      surface.parts.push_back({n, {0, 0}, {face.nodes[0] - 1, face.nodes[1] - 1}});
  }
  return scene;
}

TEST(GridSurfaces, AWallOfTheGridLiesInTheVolume) {
  const TemporaryFolder folder;
  const std::shared_ptr<const Scene> annulus = makeScene("half-annulus");
  const auto cache = folder / "a.splats";
  convertGrid(SceneGridSource(annulus, {256, 32, 128}), cache);
  const KnownFunction function = KnownFunction::of("smooth");
  const Image reference = marchedCylinder(*annulus, function, halfAnnulusCamera());
  FrameOptions options = knownFrame(kCylinderPicture);
  options.scene = sceneOfFace(cache, 1, FaceSide::kMin);
  const struct { double lod, least_db; } levels[] = {{0, 48.5}, {1, 48.5}, {4, 45}};
  for (const auto& level : levels) {
    options.lod_pixels = level.lod;
    const double db =
        compareImages(drawCache(cache, function.table, halfAnnulusCamera(), options), reference).psnr_db;
    fmt::print("wall, {} pixels: {:.1f} dB\n", level.lod, db);
    EXPECT_GE(db, level.least_db) << level.lod;
  }
  options.scene = nullptr;
  EXPECT_LT(compareImages(drawCache(cache, function.table, halfAnnulusCamera(), options), reference).psnr_db,
            30);
}

TEST(GridSurfaces, DetailFollowsThePixelsAndTheMemory) {
  const TemporaryFolder folder;
  const auto cache = folder / "a.splats";
  convertGrid(SceneGridSource(makeScene("half-annulus"), {600, 4, 400}), cache);
  const GridSurface surface = sceneOfFace(cache, 1, FaceSide::kMin)->grid_surfaces[0];
  const auto view = [&](int pixels, double scale) {
    Camera camera = halfAnnulusCamera();
    camera.parallel_scale *= scale;
    return ScreenView::of(camera, {pixels, pixels}, glm::dvec3(1.0), kLowPass, 1e-3);
  };
  const auto nodes_of = [&](const ChosenPatches& chosen) {
    size_t nodes = 0;
    for (const auto& [part, patch] : chosen) nodes += surface.faces->patches()[patch].nodeCount();
    return nodes;
  };
  const auto at = [&](int pixels, double lod, double scale = 1, size_t most = 1 << 24) {
    return nodes_of(choosePatches(surface, view(pixels, scale), lod, most));
  };
  EXPECT_GE(at(4096, 0.5), 600u * 400);
  EXPECT_LT(at(256, 1), 600u * 400 / 2);
  EXPECT_LT(at(256, 8), 6000u);
  EXPECT_LT(at(4096, 0.5, 0.05), 600u * 400 / 4);  // most of it is out of sight
  EXPECT_LE(at(4096, 0.5, 1, 50'000), 50'000u);
}

/// No ray passes between patches of different levels: a camera near one end sees all levels.
TEST(GridSurfaces, LevelsMeetWithoutGaps) {
  const TemporaryFolder folder;
  const auto cache = folder / "a.splats";
  convertGrid(SceneGridSource(makeScene("half-annulus"), {600, 4, 400}), cache);
  FrameOptions options = knownFrame(kCylinderPicture);
  auto scene = sceneOfFace(cache, 1, FaceSide::kMax);
  scene->volume = false;
  options.scene = scene;
  options.lod_pixels = 6;
  Camera camera;
  camera.projection = Projection::kPerspective;
  camera.view_angle_deg = 60;
  camera.position = {-0.5, 0.2, 0.4};
  camera.focal_point = {-1, 0, 0.5};
  camera.view_up = {0, 0, 1};
  const ScreenView view = ScreenView::of(camera, kCylinderPicture, glm::dvec3(1.0), kLowPass, 1e-3);
  std::set<std::array<uint32_t, 2>> strides;
  for (const auto& [part, patch] : choosePatches(scene->grid_surfaces[0], view, 6, 1 << 24))
    strides.insert(scene->grid_surfaces[0].faces->patches()[patch].stride);
  EXPECT_GE(strides.size(), 2u);
  const Image picture = drawCache(cache, KnownFunction::of("smooth").table, camera, options);
  options.lod_pixels = 0.5;
  const Image fine = drawCache(cache, KnownFunction::of("smooth").table, camera, options);
  size_t gaps = 0;
  for (int y = 0; y < kCylinderPicture.height; ++y)
    for (int x = 0; x < kCylinderPicture.width; ++x)
      gaps += fine.pixel(x, y)[0] < 0.97f && picture.pixel(x, y)[0] > 0.97f;
  EXPECT_EQ(gaps, 0u);
  EXPECT_GT(compareImages(picture, fine).psnr_db, 35);
}

class GridSurfaceOptions : public ProgramSuite<GridSurfaceOptions> {
 protected:
  static void prepare() {
    run({"generate", "wake", "--size", "64x28x32", "-o", file("wake")});
    run({"convert", file("wake.xyz"), file("wake.fun"), "-o", file("wake.splats"), "--surface", "k=20"});
    run({"convert", file("wake.xyz"), file("wake.fun"), "-o", file("bare.splats"), "--no-surfaces"});
  }

  static Words render(const Words& more, const std::string& cache = "wake.splats") {
    return Words{"render",  file(cache), "-o",  file("a.pfm"),  "--size",
                 "200x150", "--view",    "iso", "--background", "white"} +
           more;
  }
  static Image picture(const Words& more) {
    run(render(more));
    return readImage(file("a.pfm"));
  }
};

TEST_F(GridSurfaceOptions, EveryPainterDrawsTheSame) {
  for (const char* angle : {"", "40"}) {
    Words options{"--surface", "jmin,kmax", "--surface", "k=20:i=10-40", "--surface-by", "f"};
    if (*angle) options = options + Words{"--view-angle", angle};
    const Image cpu = picture(Words{"--backend", "cpu"} + options);
    EXPECT_GT(compareImages(cpu, picture(Words{"--backend", "osmesa"} + options)).psnr_db, 50) << angle;
    if (!*angle && !faults::isWholeSweep()) continue;
    EXPECT_EQ(picture(Words{"--backend", "cpu", "--threads", "1", "--memory", "160M"} + options).rgba,
              cpu.rgba);
    const Image last = picture(Words{"--backend", "cpu", "--first-image", file("first.png")} + options);
    EXPECT_EQ(last.rgba, cpu.rgba);
  }
}

TEST_F(GridSurfaceOptions, APartOfAFaceIsAPartOfItsPicture) {
  const auto seen = [&](const std::string& surface) {
    const Image image = picture({"--volume", "off", "--surface", surface, "--surface-colour", "#000000"});
    size_t pixels = 0;
    for (size_t n = 0; n < image.rgba.size(); n += 4) pixels += image.rgba[n] < 0.5f;
    return pixels;
  };
  const size_t whole = seen("k=20"), left = seen("k=20:i=0-40"), right = seen("k=20:i=40-63");
  EXPECT_GT(left, 100u);
  EXPECT_GT(right, 100u);
  EXPECT_NEAR(static_cast<double>(left + right), static_cast<double>(whole),
              0.03 * static_cast<double>(whole));
}

/// A grid over waves: its nodes below k = `blanked` are blanked, and those below k = `first` are left out.
FunctionGridSource overWaves(uint64_t blanked, uint64_t first) {
  return {{gridBlock(41, 31, 21 - first)}, 1, [=](const GridNode& node) {
            const auto i = static_cast<double>(node.i), j = static_cast<double>(node.j);
            const auto k = static_cast<double>(node.k + first);
            return NodeValues{{i, j, k + 2 * std::sin(0.3 * i) * std::cos(0.2 * j)},
                              {static_cast<float>(k)},
                              node.k + first < blanked};
          }};
}

TEST_F(GridSurfaceOptions, BlankedCellsEndAtASurface) {
  ConvertOptions options;
  options.output = file("blanked.splats");
  options.scalars = {0};
  options.blank_faces = true;
  Progress progress;
  convert(overWaves(8, 0), options, progress);
  convertGrid(overWaves(8, 8), file("cut.splats"));
  const auto drawn = [&](const std::string& cache, const Words& more) {
    run(render(Words{"--lod-pixels", "0", "--view-angle", "30"} + more, cache));
    return readImage(file("a.pfm"));
  };
  const auto alone = [&](const std::string& cache, const std::string& surface) {
    return drawn(cache, {"--volume", "off", "--surface", surface});
  };
  const Image floor = alone("blanked.splats", "blanks");
  EXPECT_GT(compareImages(floor, alone("cut.splats", "kmin")).psnr_db, 60);
  EXPECT_LT(compareImages(floor, alone("cut.splats", "kmax")).psnr_db, 40);
  // Both painters draw them with the volume, with any memory.
  const Words with_volume{"--surface", "blanks", "--surface", "imin", "--surface-by", "s0"};
  const Image cpu = drawn("blanked.splats", Words{"--backend", "cpu"} + with_volume);
  EXPECT_GT(compareImages(cpu, drawn("blanked.splats", Words{"--backend", "osmesa"} + with_volume)).psnr_db,
            50);
  EXPECT_EQ(
      drawn("blanked.splats", Words{"--backend", "cpu", "--threads", "1", "--memory", "160M"} + with_volume)
          .rgba,
      cpu.rgba);
  EXPECT_LT(compareImages(cpu, drawn("blanked.splats", {"--backend", "cpu"})).psnr_db, 40);
  run({"convert", file("wake.xyz"), file("wake.fun"), "-o", file("whole.splats"), "--surface",
       "blanks,k=20"});
  expectRefused(render({"--surface", "blanks"}, "whole.splats"), 1,
                {"has no faces of blanked cells; convert its grid again with --surface blanks"});
  expectRefused(render({"--surface", "imin,blanks"}, "blanked.splats"), 1,
                {"give blanks a --surface of its own"});
  expectRefused(render({"--surface", "blanks", "--surface-by", "s0", "--surface-opacity", "function"},
                       "blanked.splats"),
                2, {"blanks has no values for a function"});
}

/// The window cannot leave a colour out of the command that it copies: other surfaces may have some.
TEST_F(GridSurfaceOptions, BlanksShowTheImageOfTheEarthWhateverTheColours) {
  ConvertOptions options;
  options.output = file("sea.splats");
  options.scalars = {0};
  options.blank_faces = true;
  Progress progress;
  convert(overWaves(8, 0), options, progress);
  Image blue({4, 2});
  for (size_t n = 0; n < blue.size.pixels(); ++n) blue.rgba[4 * n + 2] = blue.rgba[4 * n + 3] = 1;
  writeImage(blue, file("blue.png"));
  const auto drawn = [&](const Words& more) {
    run(render(Words{"--view-angle", "30", "--volume", "off", "--surface", "blanks"} + more, "sea.splats"));
    return readImage(file("a.pfm"));
  };
  const Words earth{"--map", file("blue.png"), "--globe", "0.001", "--map-height", "0"};
  const Image seen = drawn(earth);
  EXPECT_NE(seen.rgba, drawn({"--surface-colour", "#ff0000"}).rgba);
  EXPECT_EQ(seen.rgba, drawn(earth + Words{"--surface-colour", "#ff0000"}).rgba);
}

TEST_F(GridSurfaceOptions, VerifyFindsDamagedFaces) {
  const std::filesystem::path damaged = file("damaged.splats");
  std::filesystem::copy(file("wake.splats"), damaged, std::filesystem::copy_options::recursive);
  run({"info", damaged.string(), "--verify"});
  const auto flip = [&](uint64_t at) {
    std::fstream faces(damaged / "faces.bin", std::ios::in | std::ios::out | std::ios::binary);
    faces.seekg(static_cast<std::streamoff>(at));
    const int byte = faces.get();
    faces.seekp(static_cast<std::streamoff>(at));
    faces.put(static_cast<char>(byte ^ 1));
  };
  flip(sizeof(FacesHeader) + 100);  // in the stream of a patch
  const ProgramResult of_stream = runProgram({"info", damaged.string(), "--verify"});
  EXPECT_EQ(of_stream.status, 1);
  const std::string said = of_stream.out + of_stream.err;
  expectSays(said, "of the faces: has a wrong checksum");
  flip(sizeof(FacesHeader) + 100);
  flip(std::filesystem::file_size(damaged / "faces.bin") - 200);  // in the table
  const ProgramResult of_table = runProgram({"info", damaged.string(), "--verify"});
  EXPECT_EQ(of_table.status, 1);
  expectSays((of_table.out + of_table.err), "faces.bin: has a wrong checksum");
}

/// A grid of 9 x 7 x 5 nodes whose velocity is zero at k = 0 from i = `first` on, and nowhere else.
void writeFlow(const std::string& file, int first) {
  std::ofstream out(file);
  out << "# vtk DataFile Version 3.0\nflow\nASCII\nDATASET STRUCTURED_GRID\nDIMENSIONS 9 7 5\nPOINTS 315 "
         "float\n";
  const auto forEachNode = [](const auto& write) {
    for (int k = 0; k < 5; ++k)
      for (int j = 0; j < 7; ++j)
        for (int i = 0; i < 9; ++i) write(i, j, k);
  };
  forEachNode([&](int i, int j, int k) { out << i << ' ' << j << ' ' << k << '\n'; });
  out << "POINT_DATA 315\n";
  for (const char* name : {"u", "v", "w"}) {
    out << "SCALARS " << name << " float\nLOOKUP_TABLE default\n";
    // The third component is zero everywhere, as in a flow along a plane.
    forEachNode([&](int i, int j, int k) {
      out << (*name == 'u' && (k > 0 || i < first) ? 1 + 0.1 * k
              : *name == 'v' && k > 0              ? 0.5 * j
                                                   : 0)
          << '\n';
    });
  }
}

/// Walls are where the flow rests, if the grid has no boundary conditions.
TEST_F(GridSurfaceOptions, WallsAreWhereTheVelocityIsZero) {
  for (const auto& [first, same] : {std::pair(0, "kmin"), {4, "kmin:i=4-8"}}) {
    const std::string stem = fmt::format("flow{}", first);
    writeFlow(file(stem + ".vtk"), first);
    run({"convert", file(stem + ".vtk"), "-o", file(stem + ".splats"), "--refine", "1"});
    const auto picture = [&](const std::string& faces) {
      run(render({"--surface", faces, "--volume", "off"}, stem + ".splats"));
      return readImage(file("a.pfm"));
    };
    const Image walls = picture("walls");
    EXPECT_EQ(walls.rgba, picture(same).rgba) << same;
    EXPECT_NE(walls.rgba, picture("kmax").rgba);
    expectSays(run({"info", file(stem + ".splats")}).out, "walls");
  }
  // One component does not tell.
  run({"convert", file("flow0.vtk"), "-o", file("u.splats"), "--scalar", "u"});
  expectRefused(render({"--surface", "walls"}, "u.splats"), 1, {"names no face of the cache"});
}

TEST_F(GridSurfaceOptions, UnknownFacesGetTheListOfThem) {
  const struct {
    Words options;
    std::string cache;
    int status;
    std::string words;
  } refused[] = {
      {{"--surface", "walls"},
       "wake.splats",
       1,
       "--surface walls names no face of the cache and no file; it has the faces jmin, "},
      {{"--surface", "walls"}, "wake.splats", 1, "block 1:k=20, and no boundary conditions"},
      {{"--surface", "k=7"}, "wake.splats", 1, "convert --surface \"k=7\" keeps an index plane"},
      {{"--surface", "block 2:kmin"}, "wake.splats", 1, "block 2:kmin names no face"},
      {{"--surface", "block 9:k=0"},
       "wake.splats",
       1,
       "block 9:k=0 names no face of the cache and no file (the grid has one block, block 1)"},
      {{"--surface", "k=9999"},
       "wake.splats",
       1,
       "k=9999 names no face of the cache and no file (k goes from 0 to 31 in block 1)"},
      {{"--surface", "kmin:i=63-200"}, "wake.splats", 1, "(i goes from 0 to 63 in block 1)"},
      {{"--surface", "kmin,wing"}, "wake.splats", 1, "--surface wing names no face"},
      {{"--surface", "a.stl", "--surface-opacity", "function", "--surface-by", "f", "--surface", "kmin"},
       "wake.splats",
       2,
       "--surface-opacity: a.stl is a file and has no scalar for a function"},
      {{"--surface", "kmin", "--surface-opacity", "function"},
       "wake.splats",
       2,
       "--surface-opacity function: needs the scalar of the function; add --surface-by NAME"},
      {{"--surface", "kmin"},
       "bare.splats",
       1,
       "the cache has no surfaces: it was converted with --no-surfaces"},
      {{"--surface", "kmin", "--surface-by", "nothing"}, "wake.splats", 1, "--surface-by: "},
      {{"--surface-by", "f"}, "wake.splats", 2, "--surface-by f needs faces of the grid"}};
  for (const auto& [options, cache, status, words] : refused)
    expectRefused(render(options, cache), status, {words});
  // No conversion keeps a plane that the grid does not have.
  for (const char* face : {"block 9:k=0", "k=32"}) {
    const ProgramResult result = runProgram(render({"--surface", face}));
    EXPECT_EQ(result.err.find("convert --surface"), std::string::npos) << result.err;
  }
  const ProgramResult plane = runProgram(
      {"convert", file("wake.xyz"), file("wake.fun"), "-o", file("no.splats"), "--surface", "k=200"});
  EXPECT_EQ(plane.status, 1);
  expectSays(plane.err, "no block has k=200; expected 0 to 31");
}

TEST_F(GridSurfaceOptions, AColourThatTheScalarsColoursCoverIsNamed) {
  const Words covered{"--surface", "kmin", "--surface-by", "f", "--surface-colour", "#ff0000"};
  expectSays(run(render(covered)).err,
             "warning: --surface-colour #ff0000: has no effect, since --surface-by f colours the faces");
  // A surface's file has it.
  std::ofstream(file("plate.stl")) << "solid s\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\n"
                                      "vertex 0 1 0\nendloop\nendfacet\nendsolid s\n";
  EXPECT_EQ(run(render(covered + Words{"--surface", file("plate.stl")})).err.find("--surface-colour"),
            std::string::npos);
}

}  // namespace
}  // namespace curvisplat
