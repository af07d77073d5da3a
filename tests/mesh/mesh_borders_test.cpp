// A uniform medium in an unstructured grid: it is even inside, and ends at the outer faces.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <vector>

#include "preprocess/convert/convert.h"
#include "preprocess/scenes/scenes.h"
#include "render/image/image.h"
#include "tests/reference/array_mesh.h"
#include "tests/reference/known_pictures.h"
#include "tests/support/temporary_folder.h"

namespace curvisplat {
namespace {

constexpr ImageSize kSize{192, 192};
constexpr int kEdge = 3;  // pixels from the outline that are neither inside nor outside

/// Optical depths of a picture over white of a medium of one colour.
std::vector<double> depthsOf(const Image& image, const glm::dvec3& colour) {
  int channel = 0;
  for (int n = 1; n < 3; ++n)
    if (colour[n] < colour[channel]) channel = n;
  std::vector<double> depths(image.rgba.size() / 4);
  for (size_t n = 0; n < depths.size(); ++n) {
    const double shown = image.rgba[4 * n + static_cast<size_t>(channel)] + (1 - image.rgba[4 * n + 3]);
    depths[n] = -std::log(std::clamp((shown - colour[channel]) / (1 - colour[channel]), 1e-6, 1.0));
  }
  return depths;
}

struct Evenness {
  double db = 0;
  double spread = 0;   // p98 / p2 of the depth against the true one, inside
  double mean = 0;     // of the same
  double outside = 0;  // share of the depth
};

class MeshBorders : public testing::Test {
 protected:
  MeshBorders() {
    OpticalFunction exact = function_.exact;
    colour_ = exact(0.5).colour;
  }

  Evenness measure(const DataSource& source, uint32_t scalar, const Camera& camera) {
    ConvertOptions options;
    options.output = folder_ / "mesh.splats";
    options.scalars = {scalar};
    options.overwrite = true;
    Progress progress;
    convert(source, options, progress);
    const Image picture = drawCache(options.output, function_.table, camera, knownFrame(kSize));
    const Image reference = toImage(referenceMarch(*scene_, function_.exact, camera, kSize));
    const std::vector<double> drawn = depthsOf(picture, colour_), truth = depthsOf(reference, colour_);

    Evenness found;
    found.db = compareImages(picture, reference).psnr_db;
    std::vector<double> ratios;
    double all = 0, outside = 0, shown = 0, true_depth = 0;
    for (int y = kEdge; y + kEdge < kSize.height; ++y)
      for (int x = kEdge; x + kEdge < kSize.width; ++x) {
        bool any = false, every = true;
        for (int dy = -kEdge; dy <= kEdge; ++dy)
          for (int dx = -kEdge; dx <= kEdge; ++dx) {
            const bool there = truth[at(x + dx, y + dy)] > 0;
            any |= there;
            every &= there;
          }
        all += drawn[at(x, y)];
        if (!any) outside += drawn[at(x, y)];
        if (!every) continue;
        ratios.push_back(drawn[at(x, y)] / truth[at(x, y)]);
        shown += drawn[at(x, y)];
        true_depth += truth[at(x, y)];
      }
    std::sort(ratios.begin(), ratios.end());
    found.spread = ratios[ratios.size() * 98 / 100] / ratios[ratios.size() * 2 / 100];
    found.mean = shown / true_depth;
    found.outside = outside / all;
    return found;
  }

  void expectEven(const char* what, const ArrayPiece& piece, uint32_t scalar, double oblique_db,
                  double edge_on_db) {
    const ArrayMesh mesh({piece});
    const struct {
      const char* name;
      Camera camera;
      double db;
    } views[] = {{"obliquely", halfAnnulusCamera(), oblique_db}, {"edge-on", edgeOnCamera(), edge_on_db}};
    for (const auto& [view, camera, db] : views) {
      const Evenness found = measure(mesh, scalar, camera);
      fmt::print("{}, {}: {:.1f} dB, p98/p2 {:.3f}, density {:.4f}, outside {:.4f} %\n", what, view, found.db,
                 found.spread, found.mean, 100 * found.outside);
      EXPECT_GE(found.db, db) << what << ", " << view;
      EXPECT_LE(found.outside, 1e-4) << what << ", " << view;
      EXPECT_NEAR(found.mean, 1, 0.01) << what << ", " << view;
    }
  }

  static size_t at(int x, int y) { return static_cast<size_t>(y) * kSize.width + static_cast<size_t>(x); }

  const std::shared_ptr<const Scene> scene_ = makeScene("half-annulus-constant");
  const KnownFunction function_ = KnownFunction::of("smooth");
  glm::dvec3 colour_{0.0};
  const TemporaryFolder folder_;
};

TEST_F(MeshBorders, OfPoints) {
  expectEven("points of hexahedra", hexahedraOf(*scene_, 31, 15, 15), 0, 50, 37);
  expectEven("points of tetrahedra", tetrahedraOf(*scene_, 24, 12, 12), 0, 46.5, 35.5);
}

TEST_F(MeshBorders, OfCells) {
  expectEven("hexahedra", hexahedraOf(*scene_, 31, 15, 15), 1, 47.5, 36);
  expectEven("tetrahedra", tetrahedraOf(*scene_, 24, 12, 12), 1, 43.5, 33);
}

}  // namespace
}  // namespace curvisplat
