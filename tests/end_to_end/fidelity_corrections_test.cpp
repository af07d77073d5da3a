// The worth of each correction of the method: with it a picture is as faithful as it must be, without it it
// is not. So every threshold here is known to be one that a broken correction misses.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <random>
#include <vector>

#include "preprocess/scenes/scenes.h"
#include "render/image/image.h"
#include "tests/reference/direct_picture.h"
#include "tests/reference/function_grid.h"
#include "tests/reference/grid_field.h"
#include "tests/reference/known_pictures.h"

namespace curvisplat {
namespace {

constexpr ImageSize kCoarsePicture{128, 128};

Image marched(const ReferenceField& field, const KnownFunction& function, const Camera& camera,
              ImageSize size = kCoarsePicture, const ReferenceLight* light = nullptr) {
  MarchSteps steps = stepsFor(field);
  steps.cells = 1;
  return toImage(referenceMarch(field, function.exact, camera, size, steps, {light}));
}

/// The mean of `side` x `side` pixels each.
Image averaged(const Image& image, int side) {
  Image out({image.size.width / side, image.size.height / side});
  for (int y = 0; y < out.size.height; ++y)
    for (int x = 0; x < out.size.width; ++x)
      for (int c = 0; c < 4; ++c) {
        double sum = 0;
        for (int n = 0; n < side * side; ++n)
          sum += static_cast<double>(image.pixel(x * side + n % side, y * side + n / side)[c]);
        out.rgba[static_cast<size_t>(4 * (y * out.size.width + x) + c)] =
            static_cast<float>(sum / (side * side));
      }
  return out;
}

/// A picture, and its reference of `rays` x `rays` rays a pixel.
struct KnownPicture {
  const GridSource& source;
  const ReferenceField& field;
  std::string function;
  Camera camera;
  int rays = 1;
};

/// Expects `least_db` of `with` against the reference, and less than that of `without`.
void expectWorth(const std::string& what, const KnownPicture& known, double least_db,
                 const DirectOptions& with, const DirectOptions& without) {
  const KnownFunction function = KnownFunction::of(known.function);
  const ImageSize size{known.rays * kCoarsePicture.width, known.rays * kCoarsePicture.height};
  const Image reference = averaged(marched(known.field, function, known.camera, size), known.rays);
  const auto db = [&](const DirectOptions& options) {
    const Image picture =
        drawDirectly(known.source, 0, options, function.table, known.camera, kCoarsePicture);
    return compareImages(picture, reference).psnr_db;
  };
  const double with_db = db(with), without_db = db(without);
  fmt::print("{}: {:.1f} dB, without {:.1f} dB\n", what, with_db, without_db);
  EXPECT_GE(with_db, least_db) << what;
  EXPECT_LT(without_db, least_db) << what << " is not needed";
}

class Corrections : public testing::Test {
 protected:
  static std::shared_ptr<const Scene> scene(const std::string& name = "half-annulus") {
    return makeScene(name);
  }

  const std::shared_ptr<const Scene> annulus_ = scene();
  const SceneField field_{*annulus_};
  const SceneGridSource source_{annulus_, {64, 32, 32}, 4};
};

TEST_F(Corrections, HalfCells) {
  DirectOptions without;
  without.nodes.border_codes = false;
  expectWorth("half cells", {source_, field_, "smooth", halfAnnulusCamera()}, 56, {}, without);
}

TEST_F(Corrections, PartsAtBorders) {
  DirectOptions without;
  without.border_parts = false;
  expectWorth("parts at borders", {source_, field_, "smooth", halfAnnulusCamera()}, 62, {}, without);
}

TEST_F(Corrections, FacesOfBorders) {
  // A uniform medium, whose outline is all that can be wrong. One ray a pixel does not see how much of it is
  // outside.
  const auto constant = scene("half-annulus-constant");
  const SceneGridSource source(constant, {64, 32, 32}, 4);
  DirectOptions without;
  without.nodes.faces = false;
  expectWorth("faces of borders, seen edge-on", {source, SceneField(*constant), "smooth", edgeOnCamera(), 4},
              37.5, {}, without);
  expectWorth("faces of borders, seen obliquely",
              {source, SceneField(*constant), "smooth", halfAnnulusCamera()}, 57, {}, without);
}

/// The share of what is drawn that lies more than one pixel outside of the middle `side` x `side` pixels.
double shareOutside(const Image& over_white, int side) {
  double outside = 0, all = 0;
  for (int y = 0; y < over_white.size.height; ++y)
    for (int x = 0; x < over_white.size.width; ++x) {
      const auto beyond = [&](int at, int size) { return std::abs(at + 0.5 - 0.5 * size) > 0.5 * side + 1; };
      const double drawn = 1 - static_cast<double>(over_white.pixel(x, y)[0]);
      all += drawn;
      if (beyond(x, over_white.size.width) || beyond(y, over_white.size.height)) outside += drawn;
    }
  return outside / all;
}

TEST_F(Corrections, LayersBehindSeveralFaces) {
  // A uniform cube of few cells, along an axis: nodes on the face towards the viewer, and behind it, are behind others, too.
  const FunctionGridSource cube({gridBlock(6, 6, 6)}, 1, [](const GridNode& n) {
    const glm::dvec3 at(static_cast<double>(n.i), static_cast<double>(n.j), static_cast<double>(n.k));
    return NodeValues{at / 5.0, {0.5f}, false};
  });
  Camera camera;
  camera.position = {0.5, 0.5, 4};
  camera.focal_point = {0.5, 0.5, 0.5};
  camera.parallel_scale = 0.8;
  const KnownFunction thin = KnownFunction::of("smooth", 0, 1, 30);
  const auto outside = [&](bool layers) {
    DirectOptions options;
    options.nodes.layers = layers;
    const double share = shareOutside(drawDirectly(cube, 0, options, thin.table, camera, kCoarsePicture), 80);
    fmt::print("layers behind several faces{}: {:.4f} % outside\n", layers ? "" : ", without", 100 * share);
    return share;
  };
  EXPECT_LT(outside(true), 1e-4);
  EXPECT_GT(outside(false), 1e-3) << "is not needed";
}

/// Clip planes through the middle of the half-annulus: across the view, along it, and both.
const ClipPlane kAcross{{-0.4, 0, 0.5}, {0.6, 0.5, -0.7}};
const ClipPlane kAlong{{-0.5, 0.1, 0.4}, {0.1, -0.9, -0.6}};

TEST_F(Corrections, CutsAtClipPlanes) {
  const struct {
    const char* name;
    std::vector<ClipPlane> planes;
    double finest_db, merged_db;
  } cuts[] = {{"a plane across the view", {kAcross}, 62, 45},
              {"a plane along the view", {kAlong}, 49, 45},
              {"two planes", {kAcross, kAlong}, 50, 47}};
  for (const auto& cut : cuts) {
    const ClippedField clipped(field_, cut.planes);
    DirectOptions with;
    with.clip_planes = cut.planes;
    DirectOptions without = with;
    without.cut_splats = false;
    expectWorth(cut.name, {source_, clipped, "smooth", halfAnnulusCamera()}, cut.finest_db, with, without);
    with.voxel = without.voxel = 4 * 2 * halfAnnulusCamera().parallel_scale / kCoarsePicture.height;
    expectWorth(std::string(cut.name) + ", 4 pixels", {source_, clipped, "smooth", halfAnnulusCamera()},
                cut.merged_db, with, without);
  }
}

TEST_F(Corrections, LightFromEachSplatsGradient) {
  const struct {
    const char* name;
    std::optional<glm::dvec3> towards;
    double finest_db, merged_db;
  } lights[] = {{"a light at the viewer", {}, 50, 40},
                {"a light from a side", glm::dvec3(0.3, -1, 0.8), 50, 40}};
  const KnownFunction function = KnownFunction::of("smooth");
  for (const auto& light : lights) {
    ReferenceLight truth;
    truth.towards = light.towards;
    const Image reference = marched(field_, function, halfAnnulusCamera(), kCoarsePicture, &truth);
    for (const bool merged : {false, true}) {
      DirectOptions options;
      if (merged) options.voxel = 4 * 2 * halfAnnulusCamera().parallel_scale / kCoarsePicture.height;
      const auto db = [&] {
        return compareImages(
                   drawDirectly(source_, 0, options, function.table, halfAnnulusCamera(), kCoarsePicture),
                   reference)
            .psnr_db;
      };
      const double unlit_db = db();
      options.light = Light{};
      options.light->towards = light.towards;
      const double lit_db = db();
      fmt::print("{}{}: {:.1f} dB, unlit {:.1f} dB\n", light.name, merged ? ", 4 pixels" : "", lit_db,
                 unlit_db);
      EXPECT_GE(lit_db, merged ? light.merged_db : light.finest_db) << light.name;
      EXPECT_LT(unlit_db, 35) << light.name;
    }
  }
}

TEST_F(Corrections, BendsOfTheScalar) {
  DirectOptions without;
  without.nodes.bends = false;
  expectWorth("bends of the scalar", {source_, field_, "band", halfAnnulusCamera()}, 58, {}, without);
}

/// A uniform medium in spectral elements: nodes at Gauss-Legendre-Lobatto points, each element's own.
FunctionGridSource spectralElements() {
  return FunctionGridSource({gridBlock(29, 29, 29)}, 1, [](const GridNode& n) {
    constexpr double kPoints[] = {
        0, 0.0641299257, 0.2041499093, 0.3953503910, 0.6046496090, 0.7958500907, 0.9358700743};
    const auto at = [&](uint64_t i) { return 0.25 * (static_cast<double>(i / 7) + kPoints[i % 7]); };
    return NodeValues{{at(n.i), at(n.j), at(n.k)}, {0.5f}, false};
  });
}

Camera insideSpectralElements() {
  Camera camera;
  camera.position = {0.5, 0.5, 4};
  camera.focal_point = {0.5, 0.5, 0.5};
  camera.parallel_scale = 0.4;  // no borders
  return camera;
}

TEST_F(Corrections, MiddlesOfCells) {
  const FunctionGridSource spectral = spectralElements();
  DirectOptions with, without;
  with.nodes.stretch = without.nodes.stretch = false;
  without.nodes.middles = false;
  expectWorth("middles of cells", {spectral, GridField(spectral, 0), "smooth", insideSpectralElements()}, 34,
              with, without);
}

TEST_F(Corrections, StretchOfUnevenCells) {
  const FunctionGridSource spectral = spectralElements();
  DirectOptions without;
  without.nodes.stretch = false;
  expectWorth("stretch of uneven cells",
              {spectral, GridField(spectral, 0), "smooth", insideSpectralElements()}, 40, {}, without);
}

TEST_F(Corrections, SkewOfGrowingCells) {
  // A uniform medium in cells that grow by a quarter from one to the next, along two axes.
  const FunctionGridSource growing({gridBlock(25, 25, 9)}, 1, [](const GridNode& n) {
    const auto at = [](uint64_t i) { return (std::pow(1.25, static_cast<double>(i)) - 1) / 100; };
    return NodeValues{{at(n.i), at(n.j), static_cast<double>(n.k) / 8}, {0.5f}, false};
  });
  DirectOptions without;
  without.nodes.growth = false;
  Camera camera;
  camera.position = {0.5, 0.5, 4};
  camera.focal_point = {0.5, 0.5, 0.5};
  camera.parallel_scale = 0.4;  // no borders
  expectWorth("skew of growing cells", {growing, GridField(growing, 0), "smooth", camera}, 56, {}, without);
}

TEST_F(Corrections, BordersOfGrowingCells) {
  // A uniform medium in cells that grow by 1.3 from one to the next and then shrink again; seen so that no outline is
  // in the picture, but the bands at two borders are, along the rays and across them.
  const FunctionGridSource growing({gridBlock(25, 17, 25)}, 1, [](const GridNode& n) {
    const auto at = [](uint64_t i) {
      const auto from = [](double steps) { return (std::pow(1.3, steps) - 1) / (std::pow(1.3, 12) - 1); };
      const auto m = static_cast<double>(i);
      return m <= 12 ? 0.5 * from(m) : 1 - 0.5 * from(24 - m);
    };
    return NodeValues{{at(n.i), static_cast<double>(n.j) / 16, at(n.k)}, {0.5f}, false};
  });
  DirectOptions without;
  without.nodes.growth = false;
  Camera camera;
  camera.position = {0.5, 0.5, 4};
  camera.focal_point = {0.5, 0.5, 0.5};
  camera.parallel_scale = 0.47;
  expectWorth("borders of growing cells", {growing, GridField(growing, 0), "smooth", camera}, 56, {},
              without);
}

TEST_F(Corrections, Seams) {
  // Seen along the seams of a uniform medium.
  const auto constant = scene("half-annulus-constant");
  Rearrangement how;
  how.cuts = {8, 4, 1};
  DirectOptions without;
  without.merge_seams = false;
  Camera camera = edgeOnCamera();
  camera.focal_point = {-0.55, 0, 0.5};
  camera.parallel_scale = 0.2;  // no borders
  expectWorth("seams",
              {RearrangedGridSource(SceneGridSource(constant, {64, 32, 32}, 4), how), SceneField(*constant),
               "smooth", camera},
              70, {}, without);
}

TEST_F(Corrections, SeamsOfUnlikeBlocks) {
  // Blocks of cells 1 and 3 wide, seen along their joint.
  const FunctionGridSource source({gridBlock(25, 9, 9), gridBlock(9, 9, 9)}, 1, [](const GridNode& node) {
    const double x = node.block == 0 ? static_cast<double>(node.i) - 24 : 3 * static_cast<double>(node.i);
    return NodeValues{{x / 16, static_cast<double>(node.j) / 8, static_cast<double>(node.k) / 8}, {0.5f}};
  });
  DirectOptions without;
  without.unlike = UnlikeHalves::kMerged;
  Camera camera = edgeOnCamera();
  camera.focal_point = {0, 0.5, 0.5};
  camera.position = {0, 0.5, 10};
  camera.view_up = {0, 1, 0};
  camera.parallel_scale = 0.3;  // no borders
  expectWorth("seams of unlike blocks", {source, GridField(source, 0), "smooth", camera}, 56, {}, without);
}

TEST_F(Corrections, JointsOfUnlikeBlocks) {
  // Blocks of cells 1 and 2 wide, seen along their joint.
  const FunctionGridSource source({gridBlock(25, 9, 9), gridBlock(13, 9, 9)}, 1, [](const GridNode& node) {
    const double x = node.block == 0 ? static_cast<double>(node.i) - 24 : 2 * static_cast<double>(node.i);
    return NodeValues{{x / 16, static_cast<double>(node.j) / 8, static_cast<double>(node.k) / 8}, {0.5f}};
  });
  DirectOptions without;
  without.nodes.lines = false;
  Camera camera = edgeOnCamera();
  camera.focal_point = {0, 0.5, 0.5};
  camera.position = {0, 0.5, 10};
  camera.view_up = {0, 1, 0};
  camera.parallel_scale = 0.3;  // no borders
  expectWorth("joints of unlike blocks", {source, GridField(source, 0), "smooth", camera}, 58, {}, without);
}

TEST_F(Corrections, SpreadOfMergedShapes) {
  // Along the voxels of a uniform medium: where they do not add up to one, a lattice shows.
  const auto constant = scene("half-annulus-constant");
  DirectOptions with, without;
  with.voxel = without.voxel = 0.08;
  without.spread = 1 / (0.44655 * 0.44655);  // the kernel's own covariance
  Camera camera = edgeOnCamera();
  camera.focal_point = {-0.55, 0, 0.5};
  camera.parallel_scale = 0.2;  // no borders
  expectWorth("spread of merged shapes",
              {SceneGridSource(constant, {128, 64, 64}, 4), SceneField(*constant), "smooth", camera}, 50,
              with, without);
}

/// Expects this worth of even blur along the rows of a uniform medium in cells 0.02 apart, in voxels of 0.06:
/// two or three cells each.
void expectEvenMergedSplatsWorth(const std::string& what, double parallel_scale, double least_db) {
  const FunctionGridSource source({gridBlock(51, 51, 51)}, 1, [](const GridNode& n) {
    const glm::dvec3 at(static_cast<double>(n.i), static_cast<double>(n.j), static_cast<double>(n.k));
    return NodeValues{at / 50.0, {0.5f}, false};
  });
  Camera camera;
  camera.position = {0.5, 0.5, 4};
  camera.focal_point = {0.5, 0.5, 0.5};
  camera.parallel_scale = parallel_scale;
  DirectOptions with, without;
  with.voxel = without.voxel = 0.053;
  without.even = false;
  expectWorth(what, {source, GridField(source, 0), "smooth", camera}, least_db, with, without);
}

TEST_F(Corrections, EvenBlurOfMergedSplats) {
  expectEvenMergedSplatsWorth("even blur of merged splats", 0.35, 48);  // no borders
}

TEST_F(Corrections, BordersOfMergedSplats) {
  expectEvenMergedSplatsWorth("borders of merged splats", 0.6, 26);
}

TEST_F(Corrections, VarianceOfMergedSplats) {
  // Noise that a voxel cannot resolve: how often each scalar is in it is all that is left of it.
  std::mt19937_64 random(7);
  std::vector<float> noise(48 * 48 * 48);
  for (float& f : noise) f = std::uniform_real_distribution<float>(0, 1)(random);
  const FunctionGridSource source({gridBlock(48, 48, 48)}, 1, [&](const GridNode& n) {
    const glm::dvec3 position(static_cast<double>(n.i), static_cast<double>(n.j), static_cast<double>(n.k));
    return NodeValues{position / 47.0, {noise[(n.k * 48 + n.j) * 48 + n.i]}, false};
  });
  Camera camera;
  camera.position = {1.5, 2, 4};
  camera.focal_point = {0.5, 0.5, 0.5};
  camera.parallel_scale = 0.2;  // no borders
  const KnownFunction function = KnownFunction::of("band");
  const Image all = drawDirectly(source, 0, {}, function.table, camera, kCoarsePicture);
  DirectOptions with, without;
  with.voxel = without.voxel = 6 / 47.0;
  without.variance = false;
  const auto db = [&](const DirectOptions& options) {
    return compareImages(drawDirectly(source, 0, options, function.table, camera, kCoarsePicture), all)
        .psnr_db;
  };
  const double with_db = db(with), without_db = db(without);
  fmt::print("variance of merged splats: {:.1f} dB, without {:.1f} dB\n", with_db, without_db);
  EXPECT_GE(with_db, 34);
  EXPECT_LT(without_db, 34) << "is not needed";
}

TEST_F(Corrections, ClassificationPerPixel) {
  DirectOptions without;
  without.per_pixel = false;
  expectWorth("classification per pixel", {source_, field_, "band", halfAnnulusCamera()}, 50, {}, without);
}

TEST_F(Corrections, SlopeAlongTheRay) {
  DirectOptions without;
  without.hidden_slope = false;
  expectWorth("slope along the ray", {source_, field_, "band", halfAnnulusCamera()}, 58.5, {}, without);
}

TEST_F(Corrections, SlopeOfTheFieldNotOfThePixel) {
  DirectOptions with, without;
  with.low_pass_px2 = without.low_pass_px2 = 1.5;
  without.slope_low_pass_px2 = 1.5;
  expectWorth("slope of the field", {source_, field_, "step", halfAnnulusCamera()}, 45, with, without);
}

TEST_F(Corrections, LowPassNoWiderThanNeeded) {
  DirectOptions without;
  without.low_pass_px2 = 1.5;
  expectWorth("narrow low-pass", {source_, field_, "band", halfAnnulusCamera()}, 58, {}, without);
}

TEST_F(Corrections, DistanceIsNotDepth) {
  DirectOptions without;
  without.secant = false;
  expectWorth("distance in perspective", {source_, field_, "smooth", perspectiveCamera(90)}, 45, {}, without);
}

TEST_F(Corrections, WideSplatsAreCut) {
  Camera camera;
  camera.projection = Projection::kPerspective;
  camera.position = {-0.55, 0.1, 0.6};
  camera.focal_point = {-0.3, -0.7, 0.35};
  camera.view_up = {0, 0, 1};
  camera.view_angle_deg = 90;
  DirectOptions without;
  without.widest = 1e9;
  expectWorth("cutting of wide splats", {source_, field_, "smooth", camera}, 42, {}, without);
}

}  // namespace
}  // namespace curvisplat
