// The cost of the codec's rounding in the picture: the same splats of the half-annulus, drawn as they were
// computed and as a cache gives them back, against the reference march. Painter, order and levels are the
// same for both.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

#include "preprocess/scenes/scenes.h"
#include "preprocess/splats/node_splats.h"
#include "render/backend/backend.h"
#include "render/image/image.h"
#include "render/project/depth_sort.h"
#include "render/project/projection.h"
#include "stream/codec/brick_codec.h"
#include "tests/reference/known_pictures.h"
#include "tests/reference/splat_compositor.h"

namespace curvisplat {
namespace {

constexpr ImageSize kSize{256, 256};
constexpr SceneGridSize kSceneNodes{96, 48, 48};

struct Splats {
  SplatGeometry geometry;
  SplatVariable variable;
};

/// A brick of double-precision splats as the arrays that are projected.
Splats inArrays(const RootCube& root, const BrickSplats& brick) {
  Splats out;
  SplatGeometry& geometry = out.geometry;
  SplatVariable& variable = out.variable;
  geometry.resize(brick.size());
  variable.resize(brick.size());
  for (size_t n = 0; n < brick.size(); ++n) {
    const glm::dvec3 position = root.toWorld(brick.positions[n]) - root.cellMin(brick.cell);
    setSplat({geometry, variable}, n, position, brick.splats[n], brick.variables[0][n],
             {brick.border_codes[n], brick.growth_codes[n]});
  }
  return out;
}

/// The half-annulus' splats, in bricks of planes of nodes; every brick's cell is the root.
std::vector<BrickSplats> halfAnnulusBricks(RootCube& root) {
  const SceneGridSource source(makeScene("half-annulus"), kSceneNodes);
  const NodeBox all{0, kSceneNodes.nj, 0, kSceneNodes.nk};
  NodeArrays nodes;
  const uint32_t scalar = 0;
  source.read(0, all, std::span(&scalar, 1), nodes);
  const auto range = [](const std::vector<double>& values) {
    return std::minmax_element(values.begin(), values.end());
  };
  const auto [x0, x1] = range(nodes.x);
  const auto [y0, y1] = range(nodes.y);
  const auto [z0, z1] = range(nodes.z);
  root = RootCube::around({*x0, *y0, *z0}, {*x1, *y1, *z1});

  std::vector<BrickSplats> bricks;
  const BlockWindow window{source.description().blocks[0], 0, all, &nodes};
  const uint64_t planes = kMaxBrickSplats / (kSceneNodes.ni * kSceneNodes.nj);
  NodeScratch scratch;
  NodeSplats splats;
  for (uint64_t k = 0; k < kSceneNodes.nk; k += planes) {
    computeNodeSplats(window, {0, kSceneNodes.nj, k, std::min(k + planes, kSceneNodes.nk)}, scratch, splats);
    BrickSplats& brick = bricks.emplace_back();
    brick.variables.resize(1);
    brick.variables[0] = splats.values;
    for (const NodeSplat& node : splats.splats) {
      brick.positions.push_back(root.fromWorld(node.splat.position));
      brick.splats.push_back(node.splat);
      brick.border_codes.push_back(node.border_code);
      brick.growth_codes.push_back(node.growth_code);
    }
    for (uint64_t row = 0; row < splats.splats.size() / kSceneNodes.ni; ++row)
      brick.runs.push_back({0, 0, row % kSceneNodes.nj, k + row / kSceneNodes.nj, kSceneNodes.ni});
  }
  return bricks;
}

class Quantisation : public testing::Test {
 protected:
  static TransferFunction function(const std::string& name) {
    return TransferFunction::fromFile(fmt::format("{}/half_annulus_{}.json", CURVISPLAT_TEST_DATA, name),
                                      nullptr, 0, 0.01);
  }

  /// All splats at once.
  Image paint(const RootCube& root, const std::vector<BrickSplats>& bricks,
              const ClassificationTable& table) {
    const ProjectionSettings settings{ScreenView::of(halfAnnulusCamera(), kSize, glm::dvec3(1), 1.5, 1e-4)};
    BrickProjector projector;
    const DepthKeys keys(settings.view, root);
    std::vector<ScreenSplat> splats;
    std::vector<uint32_t> first;
    for (const BrickSplats& brick : bricks) {
      const Splats arrays = inArrays(root, brick);
      const glm::dvec3 corner = root.cellMin(brick.cell);
      projector.project(settings, table, corner, arrays.geometry, arrays.variable);
      std::vector<uint32_t> of_brick(projector.splats().size());
      keys.setKeys(projector.mutableSplats(), projector.depths(), corner, {0, ~uint32_t{0}}, of_brick);
      splats.insert(splats.end(), projector.splats().begin(), projector.splats().end());
      first.insert(first.end(), of_brick.begin(), of_brick.end());
    }
    std::vector<ScreenSplat> sorted;
    DepthSorter sorter;
    for (const DepthItem& item : sorter.sort(first)) sorted.push_back(splats[item.splat]);

    Image image;
    makeBackend(Backend::kCpu)->run([&](Painter& painter) {
      painter.begin(kSize, {1, 1, 1, 1}, table, {});
      painter.draw(sorted);
      image = painter.end();
    });
    return image;
  }

  void expectCheap(const std::string& name) {
    RootCube root;
    std::vector<BrickSplats> bricks = halfAnnulusBricks(root);
    const ClassificationTable table = ClassificationTable::of(function(name), 0, 1);
    const Image& reference = knownReference(name, kSize);

    const double computed_db = compareImages(paint(root, bricks, table), reference).psnr_db;
    uint64_t bytes = 0;
    for (BrickSplats& brick : bricks) {
      const EncodedBrick encoded = encodeBrick(root, brick);
      bytes += encoded.geometry.size() + encoded.values[0].size();
    }
    const double decoded_db = compareImages(paint(root, bricks, table), reference).psnr_db;
    fmt::print(
        "{}: {:.2f} dB as computed, {:.2f} dB through the codec, {:.2f} bytes a splat\n", name, computed_db,
        decoded_db,
        static_cast<double>(bytes) / static_cast<double>(kSceneNodes.ni * kSceneNodes.nj * kSceneNodes.nk));
    EXPECT_GT(computed_db, 50);
    EXPECT_LT(computed_db - decoded_db, 1);
  }
};

TEST_F(Quantisation, OfASmoothFunctionCostsLessThanADecibel) {
  expectCheap("smooth");
}
TEST_F(Quantisation, OfANarrowBandCostsLessThanADecibel) {
  expectCheap("band");
}
TEST_F(Quantisation, OfAStepCostsLessThanADecibel) {
  expectCheap("step");
}

}  // namespace
}  // namespace curvisplat
