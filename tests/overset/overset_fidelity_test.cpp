// Pictures of overset grids against the field itself.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "preprocess/convert/convert.h"
#include "preprocess/scenes/scenes.h"
#include "render/image/image.h"
#include "render/image/image_file.h"
#include "tests/reference/function_grid.h"
#include "tests/reference/known_pictures.h"
#include "tests/support/fault_sweep.h"
#include "tests/support/temporary_folder.h"

namespace curvisplat {
namespace {

constexpr ImageSize kSize{256, 256};

/// Usually one: Corrections.* have others.
std::vector<std::string> functions() {
  if (!faults::isWholeSweep()) return {"smooth"};
  return {"smooth", "band", "step"};
}

class OversetFidelity : public testing::Test {
 protected:
  ConvertReport convertTo(const std::string& name, const GridSource& source, Overlap overlap) {
    ConvertOptions options;
    options.output = folder_ / name;
    options.scalars = {0};
    options.overlap = overlap;
    options.surfaces = false;
    Progress progress;
    return convert(source, options, progress);
  }
  Image draw(const std::string& name, const std::string& function) {
    const Image image =
        drawCache(folder_ / name, KnownFunction::of(function).table, halfAnnulusCamera(), knownFrame(kSize));
    if (const char* pictures = std::getenv("CURVISPLAT_PICTURES"))
      writeImage(image, std::filesystem::path(pictures) / fmt::format("{}_{}.png", name, function));
    return image;
  }

  const std::shared_ptr<const Scene> scene_ = makeScene("half-annulus");
  const TemporaryFolder folder_;
};

TEST_F(OversetFidelity, TwoThreeAndSixBlocksLookLikeOne) {
  const GridBlock block = gridBlock(128, 64, 64);
  convertTo("one.splats", oversetGrid(scene_, block, {}), Overlap::kOwner);
  const std::map<std::string, double> lost_db{
      {"smooth", 3.0}, {"band", 1.7}, {"step", 0.5}};  // of two and three
  std::map<std::string, double> one_db;
  for (const std::string& function : functions()) {
    one_db[function] = compareImages(draw("one.splats", function), knownReference(function, kSize)).psnr_db;
  }
  for (const uint64_t nodes : {24u})
    for (const size_t boxes : {1u, 2u, 5u}) {
      if (boxes == 2 && !faults::isWholeSweep()) continue;
      const FunctionGridSource source = oversetGrid(scene_, block, boxesInHalfAnnulus(boxes, nodes));
      const std::string name = fmt::format("{}_of_{}.splats", boxes + 1, nodes);
      const ConvertReport report = convertTo(name, source, Overlap::kOwner);
      EXPECT_EQ(report.notes.size(), 1u);
      fmt::print("{} blocks, {} nodes: volume {:.5f} of {:.5f}\n", boxes + 1, nodes, report.volume,
                 scene_->volume());
      EXPECT_NEAR(report.volume, scene_->volume(), 0.01 * scene_->volume());
      for (const std::string& function : functions()) {
        const double one = one_db[function];
        const double owned = compareImages(draw(name, function), knownReference(function, kSize)).psnr_db;
        fmt::print("  {}: one block {:.1f} dB, owners {:.1f} dB\n", function, one, owned);
        EXPECT_GE(owned, one - lost_db.at(function) * (boxes > 2 ? 2.5 : 1)) << function;
      }
    }
}

/// Two boxes of 13 x 13 x 13 nodes in a row along x, which overlap by `overlap` cells; the scalar is 0.5.
FunctionGridSource boxesInARow(double overlap) {
  return FunctionGridSource({gridBlock(13, 13, 13), gridBlock(13, 13, 13)}, 1, [overlap](const GridNode& n) {
    NodeValues node;
    node.position = {static_cast<double>(n.i) + n.block * (12 - overlap), n.j, n.k};
    node.scalars = {0.5f};
    return node;
  });
}

/// The ripple of the optical depth over its mean, for a picture of the joint, seen along it.
double rippleAtJoint(const Image& image) {
  double sum = 0, squares = 0;
  for (size_t n = 0; n < image.rgba.size(); n += 4) {
    const double depth = -std::log(image.rgba[n + 2]);
    sum += depth;
    squares += depth * depth;
  }
  const double pixels = static_cast<double>(image.rgba.size() / 4), mean = sum / pixels;
  return std::sqrt(squares / pixels - mean * mean) / mean;
}

TEST_F(OversetFidelity, JointsOfOwnersAreFaintInAUniformMedium) {
  // A part of half cells at the end of a block (the first four), or of whole ones, is left, and is cut where
  // it ends. Without a cut of half cells: 7.4 to 8.6 %.
  const std::map<double, double> most{{0.1, 0.025}, {0.2, 0.055}, {0.3, 0.055}, {0.4, 0.08},
                                      {0.7, 0.03},  {1.0, 0.015}, {1.3, 0.055}};
  for (const auto& [overlap, ripple] : most) {
    const std::string name = fmt::format("row_{}.splats", overlap);
    convertTo(name, boxesInARow(overlap), Overlap::kOwner);
    Camera camera;
    camera.focal_point = {12 - 0.5 * overlap, 6, 6};
    camera.position = camera.focal_point + glm::dvec3(0, 0, 50);
    camera.view_up = {0, 1, 0};
    camera.projection = Projection::kOrthographic;
    camera.parallel_scale = 4;
    const double found = rippleAtJoint(drawCache(folder_ / name, KnownFunction::of("smooth", 0, 1, 12).table,
                                                 camera, knownFrame({128, 128})));
    fmt::print("overlap by {} cells: ripple {:.2f} %\n", overlap, 100 * found);
    EXPECT_LT(found, ripple) << overlap;
  }
}

}  // namespace
}  // namespace curvisplat
