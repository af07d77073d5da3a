// Properties of pictures whatever the grid: convergence, and independence of how a grid is told, of how
// it is cut into blocks and of how finely it samples; cameras inside of the data and wide ones.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <glm/geometric.hpp>
#include <glm/trigonometric.hpp>
#include <memory>
#include <numeric>
#include <string>
#include <utility>
#include <vector>

#include "preprocess/scenes/scenes.h"
#include "render/image/image.h"
#include "render/image/image_file.h"
#include "tests/reference/direct_picture.h"
#include "tests/reference/function_grid.h"
#include "tests/reference/known_pictures.h"
#include "tests/reference/reference_march.h"
#include "tests/support/fault_sweep.h"
#include "tests/support/temporary_folder.h"

namespace curvisplat {
namespace {

class FidelityProperties : public testing::Test {
 protected:
  /// Draws through a cache, as the program does it.
  Image draw(const GridSource& source, const Camera& camera, const std::string& function, ImageSize size,
             double low_pass_px2 = kLowPass) {
    const std::filesystem::path cache = folder_ / "grid.splats";
    convertGrid(source, cache);
    FrameOptions options = knownFrame(size);
    options.low_pass_px2 = low_pass_px2;
    return drawCache(cache, KnownFunction::of(function).table, camera, options);
  }

  static SceneGridSource halfAnnulus(SceneGridSize size) {
    return SceneGridSource(makeScene("half-annulus"), size, 4);
  }

  /// Returns the cache of a grid with this number of nodes around, and half of it along the other axes. The first test that asks for
  /// it converts the grid.
  static std::filesystem::path halfAnnulusCache(uint64_t nodes = 128) {
    static const TemporaryFolder folder;
    const std::filesystem::path cache = folder / std::to_string(nodes);
    if (!std::filesystem::exists(cache)) convertGrid(halfAnnulus({nodes, nodes / 2, nodes / 2}), cache);
    return cache;
  }

  TemporaryFolder folder_;
};

Image marchedScene(const Scene& scene, const std::string& function, const Camera& camera, ImageSize size,
                   double near = 0) {
  const SceneField field(scene);
  MarchSteps steps = stepsFor(field);
  steps.near = near;
  return toImage(referenceMarch(field, KnownFunction::of(function).exact, camera, size, steps));
}

TEST_F(FidelityProperties, PicturesConvergeWithTheGrid) {
  constexpr ImageSize kSize{256, 256};
  const Image& reference = knownReference("smooth", kSize);
  constexpr double kMinGain[] = {7, 5, 2.5};
  double coarser_db = 0;
  for (int step = 0; step < (faults::isWholeSweep() ? 4 : 3); ++step) {
    const uint64_t nodes = uint64_t{16} << step;
    const Image picture = draw(halfAnnulus({nodes, nodes, nodes}), halfAnnulusCamera(), "smooth", kSize, 0.1);
    const double db = compareImages(picture, reference).psnr_db;
    fmt::print("{}³ nodes: {:.2f} dB\n", nodes, db);
    if (step > 0) {
      EXPECT_GE(db - coarser_db, kMinGain[step - 1]) << nodes;
    }
    coarser_db = db;
  }
}

TEST_F(FidelityProperties, OrderAndDirectionOfTheAxesDoNotMatter) {
  constexpr ImageSize kSize{128, 128};
  const SceneGridSource source = halfAnnulus({64, 32, 32});
  const Image plain = draw(source, halfAnnulusCamera(), "band", kSize);
  const Rearrangement others[] = {{{1, 0, 2}, {}},
                                  {{2, 1, 0}, {}},
                                  {{1, 2, 0}, {}},
                                  {{0, 1, 2}, {true, false, false}},
                                  {{0, 1, 2}, {false, true, true}},
                                  {{2, 0, 1}, {true, true, true}}};
  for (size_t n = 0; n < std::size(others); ++n) {
    const Rearrangement& how = others[n];
    if (n != 2 && n != 4 && !faults::isWholeSweep()) continue;
    const Image other = draw(RearrangedGridSource(source, how), halfAnnulusCamera(), "band", kSize);
    EXPECT_GE(compareImages(plain, other).psnr_db, 60) << how.axes[0] << how.axes[1] << how.axes[2];
  }
}

TEST_F(FidelityProperties, BlocksThatAbutLookLikeOne) {
  constexpr ImageSize kSize{256, 256};
  const SceneGridSource source = halfAnnulus({128, 64, 64});
  std::vector<std::string> functions{"step"};
  if (faults::isWholeSweep()) functions.insert(functions.end(), {"smooth", "band"});
  const auto drawn = [&](const std::filesystem::path& cache, const std::string& function) {
    return drawCache(cache, KnownFunction::of(function).table, halfAnnulusCamera(), knownFrame(kSize));
  };
  const auto directly = [&](const GridSource& grid) {
    return drawDirectly(grid, 0, {}, KnownFunction::of("step").table, halfAnnulusCamera(), kSize);
  };
  std::vector<Image> uncut;
  for (const std::string& function : functions) uncut.push_back(drawn(halfAnnulusCache(), function));
  const Image uncut_step = directly(source);
  for (const auto& cuts : std::vector<std::array<uint64_t, 3>>{{1, 2, 1}, {2, 2, 2}, {4, 2, 4}}) {
    if (cuts[0] != cuts[1] && !faults::isWholeSweep()) continue;
    Rearrangement how;
    how.cuts = cuts;
    const RearrangedGridSource blocks(source, how);
    convertGrid(blocks, folder_ / "grid.splats");
    for (size_t n = 0; n < functions.size(); ++n) {
      const ImageDifference difference =
          compareImages(uncut[n], drawn(folder_ / "grid.splats", functions[n]));
      fmt::print("{} blocks, {}: {:.1f} dB, {:.2f}/255\n", cuts[0] * cuts[1] * cuts[2], functions[n],
                 difference.psnr_db, 255 * difference.largest);
      EXPECT_GE(difference.psnr_db, 75) << functions[n];
      EXPECT_LE(difference.largest, 2.0 / 255) << functions[n];
    }
    const ImageDifference difference = compareImages(uncut_step, directly(blocks));
    fmt::print("{} blocks, step, without the codec: {:.1f} dB, {:.2f}/255\n", cuts[0] * cuts[1] * cuts[2],
               difference.psnr_db, 255 * difference.largest);
    EXPECT_GE(difference.psnr_db, 95);  // growth is estimated from the nodes of a block
    EXPECT_LE(difference.largest, 0.5 / 255);
  }
}

/// Sampling goes from four pixels a node to a node a pixel, with tools/test.sh --whole two.
TEST_F(FidelityProperties, OpacityDoesNotDependOnSampling) {
  constexpr ImageSize kSize{64, 64};
  // f = 0.5 has no blue, so that the blue over white is the transmittance.
  const auto meanOpacity = [](const Image& image) {
    double sum = 0;
    for (size_t n = 0; n < image.rgba.size(); n += 4) sum += 1 - image.rgba[n + 2];
    return sum / static_cast<double>(image.rgba.size() / 4);
  };
  const auto scene = std::shared_ptr<const Scene>(makeScene("half-annulus-constant"));
  const double exact = meanOpacity(marchedScene(*scene, "smooth", halfAnnulusCamera(), kSize));
  for (const uint64_t nodes : {16, 32, 64, 128}) {
    if (nodes != 16 && nodes != 64 && !faults::isWholeSweep()) continue;
    const double opacity = meanOpacity(
        draw(SceneGridSource(scene, {nodes, nodes, nodes}, 4), halfAnnulusCamera(), "smooth", kSize));
    fmt::print("{}³ nodes: mean opacity {:.5f}, exactly {:.5f}\n", nodes, opacity, exact);
    EXPECT_NEAR(opacity / exact, 1, 0.01) << nodes;
  }
}

/// The part of `whole`'s picture around (u, v) in [-1, 1]², 1 / `parts` of it in width, as an orthographic
/// camera sees it along the perspective one's ray through its middle.
Camera alongTheRay(const Camera& whole, double u, double v, int parts) {
  const glm::dvec3 ahead = glm::normalize(whole.focal_point - whole.position);
  const glm::dvec3 right = glm::normalize(glm::cross(ahead, whole.view_up));
  const double distance = glm::distance(whole.focal_point, whole.position);
  const double half = distance * std::tan(glm::radians(0.5 * whole.view_angle_deg));
  Camera camera;
  camera.focal_point = whole.focal_point + half * (u * right + v * glm::cross(right, ahead));
  camera.position = camera.focal_point - 4.0 * glm::normalize(camera.focal_point - whole.position);
  camera.view_up = whole.view_up;
  camera.projection = Projection::kOrthographic;
  camera.parallel_scale = half / parts;
  return camera;
}

/// Squared differences of the pixels, appended to `out`.
void appendErrors(const Image& picture, const Image& reference, std::vector<double>& out) {
  for (size_t n = 0; n < picture.rgba.size(); n += 4) {
    double sum = 0;
    for (size_t c = 0; c < 3; ++c) sum += std::pow(double{picture.rgba[n + c]} - reference.rgba[n + c], 2);
    out.push_back(sum / 3);
  }
}

/// PSNR without the worst `left_out` of the pixels.
double trimmedPsnr(std::vector<double> errors, double left_out) {
  std::sort(errors.begin(), errors.end());
  errors.resize(errors.size() - static_cast<size_t>(left_out * static_cast<double>(errors.size())));
  return -10 *
         std::log10(std::accumulate(errors.begin(), errors.end(), 0.0) / static_cast<double>(errors.size()));
}

// The directions in which one camera looks decide which of the data's borders are seen edge-on, where the
// error is. So perspective is compared with orthographic cameras that look along its own rays. On a
// silhouette a reference's ray hits or misses, and a few such pixels decide about a whole picture's figure:
// they are printed and left out.
TEST_F(FidelityProperties, PerspectiveIsAsGoodAsOrthographic) {
  constexpr int kParts = 3, kPart = 54;
  constexpr ImageSize kSize{kParts * kPart, kParts * kPart}, kPartSize{kPart, kPart};
  constexpr double kSilhouettes = 0.02;
  const auto scene = makeScene("half-annulus");
  for (const auto& [function, angle] : std::vector<std::pair<std::string, double>>{
           {"smooth", 30}, {"band", 30}, {"step", 30}, {"band", 90}}) {
    if (angle == 30 && !faults::isWholeSweep()) continue;
    const auto draw = [&, &function = function](const Camera& camera, ImageSize size,
                                                std::vector<double>& errors) {
      appendErrors(drawCache(halfAnnulusCache(faults::isWholeSweep() ? 128 : 96),
                             KnownFunction::of(function).table, camera, knownFrame(size)),
                   marchedScene(*scene, function, camera, size), errors);
    };
    const Camera whole = perspectiveCamera(angle);
    std::vector<double> orthographic, perspective;
    for (int y = 0; y < kParts; ++y)
      for (int x = 0; x < kParts; ++x)
        draw(alongTheRay(whole, (2.0 * x + 1) / kParts - 1, (2.0 * y + 1) / kParts - 1, kParts), kPartSize,
             orthographic);
    draw(whole, kSize, perspective);
    fmt::print(
        "{}, {} degrees: orthographic {:.1f} dB, perspective {:.1f} dB; without silhouettes {:.1f}, {:.1f}\n",
        function, angle, trimmedPsnr(orthographic, 0), trimmedPsnr(perspective, 0),
        trimmedPsnr(orthographic, kSilhouettes), trimmedPsnr(perspective, kSilhouettes));
    EXPECT_GE(trimmedPsnr(perspective, kSilhouettes), trimmedPsnr(orthographic, kSilhouettes) - 1)
        << function << ", " << angle;
  }
}

TEST_F(FidelityProperties, ACameraInsideSeesWhatIsThere) {
  constexpr ImageSize kSize{96, 96};
  const auto scene = makeScene("half-annulus");
  Camera camera;
  camera.projection = Projection::kPerspective;
  camera.position = {-0.55, 0.1, 0.6};
  camera.focal_point = {-0.3, -0.7, 0.35};
  camera.view_up = {0, 0, 1};
  for (const double angle : {40.0, 100.0}) {
    camera.view_angle_deg = angle;
    for (const std::string function : {angle > 90 ? "smooth" : "band"}) {
      const Image picture =
          drawCache(halfAnnulusCache(), KnownFunction::of(function).table, camera, knownFrame(kSize));
      const Image reference = marchedScene(*scene, function, camera, kSize, 2.6e-4);
      const double db = compareImages(picture, reference).psnr_db;
      fmt::print("inside, {} degrees, {}: {:.1f} dB\n", angle, function, db);
      EXPECT_GE(db, 40);
      if (db < 40) {
        writeImage(picture, fmt::format("{}/inside_picture.png", testing::TempDir()));
        writeImage(reference, fmt::format("{}/inside_reference.png", testing::TempDir()));
      }
    }
  }
}

}  // namespace
}  // namespace curvisplat
