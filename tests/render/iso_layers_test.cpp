// Isosurfaces of splats on a lattice: where a linear field and a sphere have them, and the same bits for any threads
// and ranges of tiles.
#include <gtest/gtest.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <functional>
#include <glm/geometric.hpp>
#include <string>
#include <thread>
#include <vector>

#include "render/project/tile_set.h"
#include "render/surface/iso_layers.h"
#include "stream/base/error.h"
#include "stream/model/border_code.h"
#include "tests/reference/known_pictures.h"
#include "tests/reference/splat_compositor.h"
#include "tests/support/expect_error.h"
#include "tests/support/with_corrections.h"

namespace curvisplat {
namespace {

constexpr ImageSize kIsoPicture{96, 80};
constexpr uint32_t kParts = 7;
constexpr int kCells = 24;  // along an edge of the cube [-1, 1]³

class IsoLayersTest : public testing::Test {
 protected:
  using Field = std::function<double(const glm::dvec3&)>;

  IsoLayersTest() {
    camera_.position = {3, 2, 1.5};
    camera_.parallel_scale = 1.6;
    geometry_.resize(kCells * kCells * kCells);
    variable_.resize(geometry_.size());
  }

  void setField(const Field& f) {
    const double h = 2.0 / kCells;
    for (size_t n = 0; n < geometry_.size(); ++n) {
      const glm::dvec3 at =
          h * (glm::dvec3(n % kCells, n / kCells % kCells, n / kCells / kCells) + 0.5) - 1.0;
      SplatScalar value;
      value.mean = f(at);
      for (int axis = 0; axis < 3; ++axis) {
        glm::dvec3 step(0.0);
        step[axis] = 0.5 * h;
        value.slope[axis] = f(at + step) - f(at - step);
      }
      SplatCodes codes;
      if (ends_ && n % kCells == 0) codes.border = packLayerCode({1, 0, 0}, 0.5);
      setSplat({geometry_, variable_}, n, at, {at, {h, h, h}, {0, 0, 0}, h * h * h}, value, codes);
    }
  }

  IsoLayers drawn(std::vector<double> values, const std::vector<TileRange>& ranges, int threads = 1) {
    const WithCorrections scope({{}, {}, corrections_});
    view_ = ScreenView::of(camera_, kIsoPicture, glm::dvec3(1), kLowPass, 1e-3);
    const ColourTable colours(KnownFunction::of("smooth").table);
    IsoLayers layers(kIsoPicture);
    for (const TileRange& tiles : ranges) {
      IsoSplats splats({view_, values, kHalfCellStyle, planes_, 0, tiles, uint64_t{1} << 30}, kParts);
      addParts(splats, threads);
      splats.sort();
      tbb::task_arena arena(threads);
      arena.execute([&] { layers.draw(splats, {colours, std::nullopt}, bytes_); });
    }
    return layers;
  }
  /// Adds the parts in order by one thread; by more of them each some parts, from the last on.
  void addParts(IsoSplats& splats, int threads) const {
    const auto count = static_cast<uint32_t>(geometry_.size());
    const auto add = [&](uint32_t part) {
      const SplatRange range{count * part / kParts, count * (part + 1) / kParts};
      splats.add(part, glm::dvec3(0.0), arraysOf(geometry_), arraysOf(variable_), nullptr, {&range, 1});
    };
    if (threads == 1) {
      for (uint32_t part = 0; part < kParts; ++part) add(part);
      return;
    }
    std::vector<std::jthread> adding;
    for (int thread = 0; thread < threads; ++thread)
      adding.emplace_back([&, thread] {
        for (int part = int{kParts} - 1; part >= 0; --part)
          if (part % threads == thread) add(static_cast<uint32_t>(part));
      });
  }
  static TileRange all() { return {0, TileSet::tilesOf(kIsoPicture)}; }

  glm::dvec3 placeAt(int x, int y, double depth) const {
    const glm::dvec2 across =
        (glm::dvec2(x + 0.5, y + 0.5) - 0.5 * glm::dvec2(kIsoPicture.width, kIsoPicture.height)) /
        view_.focal_px;
    if (view_.projection == Projection::kPerspective) {
      const glm::dvec3 ray = view_.forward + across.x * view_.right + across.y * view_.down;
      return view_.eye + depth * glm::normalize(ray);
    }
    return view_.eye + across.x * view_.right + across.y * view_.down + depth * view_.forward;
  }

  Camera camera_;
  ScreenView view_;
  std::vector<ClipPlane> planes_;
  IsoCorrections corrections_;
  bool ends_ = false;  // the data, at x = -1
  uint64_t bytes_ = uint64_t{1} << 30;
  SplatGeometry geometry_;
  SplatVariable variable_;
};

TEST_F(IsoLayersTest, ThatOfALinearFieldIsAPlane) {
  const glm::dvec3 n(0.3, -0.5, 0.8);
  setField([&](const glm::dvec3& at) { return glm::dot(n, at); });
  for (const Projection projection : {Projection::kOrthographic, Projection::kPerspective}) {
    camera_.projection = projection;
    const IsoLayers layers = drawn({0.1}, {all()});
    size_t seen = 0;
    for (int y = 0; y < kIsoPicture.height; ++y)
      for (int x = 0; x < kIsoPicture.width; ++x) {
        const auto found = layers.at(x, y);
        // Not at outlines, where rays do not all meet it.
        if (found.size() != 1 || found[0].colour.w < 1) continue;
        ++seen;
        EXPECT_NEAR(glm::dot(n, placeAt(x, y, double{found[0].depth})), 0.1, 2e-3) << x << ' ' << y;
      }
    EXPECT_GT(seen, 300u);
  }
}

TEST_F(IsoLayersTest, ThatOfASphereIsRound) {
  setField([](const glm::dvec3& at) { return glm::length(at); });
  const auto worst = [&] {
    const IsoLayers layers = drawn({0.7}, {all()});
    double most = 0;
    size_t seen = 0;
    for (int y = 0; y < kIsoPicture.height; ++y)
      for (int x = 0; x < kIsoPicture.width; ++x)
        for (const PixelLayer& layer : layers.at(x, y)) {
          if (layer.colour.w < 1) continue;
          EXPECT_EQ(layer.scalar, 0.7f);
          most = std::max(most, std::abs(glm::length(placeAt(x, y, double{layer.depth})) - 0.7));
          ++seen;
        }
    EXPECT_GT(seen, 800u);
    return most;
  };
  // A cell is 0.083 long.
  constexpr double kWorst = 0.0025;
  const double all_of_them = worst();
  EXPECT_LT(all_of_them, kWorst);
  corrections_.common_field = false;
  const double heaviest = worst();
  EXPECT_GT(heaviest, kWorst);
  std::printf("sphere: off by %.5f, by each splat's own field %.5f\n", all_of_them, heaviest);
}

TEST_F(IsoLayersTest, ItEndsWhereTheDataDoes) {
  ends_ = true;
  camera_.position = {-1, 0, 3};
  camera_.focal_point = {-1, 0, 0};
  camera_.view_up = {0, 1, 0};
  camera_.parallel_scale = 0.3;
  setField([](const glm::dvec3& at) { return at.z + 0.2 * at.x; });
  // Pixels before the border that see it, and how far it reaches behind it; the middle rows.
  const auto reach = [&] {
    const IsoLayers layers = drawn({0.1}, {all()});
    double behind = 0;
    size_t before = 0;
    for (int y = 20; y < kIsoPicture.height - 20; ++y)
      for (int x = 0; x < kIsoPicture.width; ++x)
        for (const PixelLayer& layer : layers.at(x, y)) {
          const double at = placeAt(x, y, double{layer.depth}).x;
          before += at > -1 && layer.colour.w >= 1;
          behind = std::max(behind, -1 - at);
        }
    EXPECT_GT(before, 500u);
    return behind;
  };
  const double pixel = 2 * camera_.parallel_scale / kIsoPicture.height;
  EXPECT_LT(reach(), pixel);
  corrections_.ended = false;
  EXPECT_GT(reach(), 3 * pixel);
}

/// Rays that graze it cross it twice within a step. A part of the outline, where cells are 60 pixels long: how much of each row is
/// covered changes evenly.
TEST_F(IsoLayersTest, OutlinesOfLargeCellsAreSmooth) {
  setField([](const glm::dvec3& at) { return glm::length(at); });
  camera_.position = {0.15, 0, 3};
  camera_.focal_point = {0.15, 0, 0};
  camera_.view_up = {0, 1, 0};
  camera_.parallel_scale = 0.055;
  const IsoLayers layers = drawn({0.15}, {all()});
  std::vector<double> covered;
  for (int y = 0; y < kIsoPicture.height; ++y) {
    covered.push_back(0);
    for (int x = 0; x < kIsoPicture.width; ++x) {
      double through = 1;
      for (const PixelLayer& layer : layers.at(x, y)) through *= 1 - double{layer.colour.w};
      covered.back() += 1 - through;
    }
  }
  EXPECT_NEAR(covered[kIsoPicture.height / 2], kIsoPicture.width / 2, 12);
  double most = 0;
  for (size_t y = 1; y + 1 < covered.size(); ++y)
    most = std::max(most, std::abs(covered[y - 1] - 2 * covered[y] + covered[y + 1]));
  std::printf("outline: bends by %.3f pixels from row to row\n", most);
  EXPECT_LT(most, 0.7);
}

/// The edge of what a clip plane leaves, which lies on the edge of two tiles: 0.4 of the pixel beside it is covered.
TEST_F(IsoLayersTest, OutlinesAtTheEdgeOfTilesAreSmooth) {
  setField([](const glm::dvec3& at) { return at.x; });
  camera_.position = {3, 0, 0};
  for (const bool left : {true, false}) {
    // The plane's edge is at a part of a pixel on either side of the first two tiles' edge.
    const double edge_px = left ? kTileSide - 0.4 : kTileSide + 0.4;
    const double at = (edge_px - 0.5 * kIsoPicture.width) * 2 * camera_.parallel_scale / kIsoPicture.height;
    const glm::dvec3 right = ScreenView::of(camera_, kIsoPicture, glm::dvec3(1), kLowPass, 1e-3).right;
    planes_ = {{at * right, left ? right : -right}};
    const int half = left ? kTileSide - 1 : kTileSide, y = kTileSide + 5;
    const auto alpha = [&](const IsoLayers& layers, int x) {
      return layers.at(x, y).empty() ? 0.0f : layers.at(x, y)[0].colour.w;
    };
    corrections_ = {};
    const IsoLayers layers = drawn({0.1}, {all()});
    EXPECT_EQ(alpha(layers, left ? half + 1 : half - 1), 1) << left;
    EXPECT_NEAR(alpha(layers, half), 0.4, 0.05) << left;
    EXPECT_EQ(alpha(layers, left ? half - 1 : half + 1), 0) << left;
    corrections_.smooth = false;
    EXPECT_EQ(alpha(drawn({0.1}, {all()}), half), 0) << left;
  }
}

TEST_F(IsoLayersTest, ClipPlanesOpenIt) {
  setField([](const glm::dvec3& at) { return glm::length(at); });
  planes_ = {{glm::dvec3(0.0), glm::dvec3(-1, 0, 0)}};
  const IsoLayers layers = drawn({0.7}, {all()});
  const auto middle = layers.at(kIsoPicture.width / 2, kIsoPicture.height / 2);
  ASSERT_EQ(middle.size(), 1u);
  const glm::dvec3 at = placeAt(kIsoPicture.width / 2, kIsoPicture.height / 2, double{middle[0].depth});
  EXPECT_NEAR(glm::length(at), 0.7, 0.003);
  EXPECT_LT(at.x, 0);  // its back, seen from within
}

TEST_F(IsoLayersTest, BitsDependNeitherOnThreadsNorOnRangesNorOnMemory) {
  setField([](const glm::dvec3& at) { return glm::length(at) + 0.1 * std::sin(9 * at.x); });
  const std::vector<double> values{0.5, 0.8};
  const IsoLayers whole = drawn(values, {all()});
  const std::vector<TileRange> ranges{{0, 2}, {2, 5}, {5, whole.tiles()}};
  const auto expect_same = [&](const IsoLayers& other) {
    for (int y = 0; y < kIsoPicture.height; ++y)
      for (int x = 0; x < kIsoPicture.width; ++x) {
        const auto a = whole.at(x, y), b = other.at(x, y);
        ASSERT_EQ(a.size(), b.size()) << x << ' ' << y;
        for (size_t n = 0; n < a.size(); ++n)
          EXPECT_TRUE(a[n].depth == b[n].depth && a[n].colour == b[n].colour) << x << ' ' << y;
      }
  };
  expect_same(drawn(values, ranges, 2));
  expect_same(drawn(values, {all()}, 4));
  for (const uint64_t bytes : {uint64_t{2} << 20, uint64_t{4} << 20}) {
    bytes_ = bytes;
    expect_same(drawn(values, ranges, 4));
  }
  bytes_ = 1 << 16;  // not for one tile
  try {
    drawn(values, ranges, 4);
    ADD_FAILURE() << "no limit";
  } catch (const UsageError& error) {
    expectSays(error.what(), "give more --memory");
  }
}

TEST_F(IsoLayersTest, TooManySplatsForTheMemoryAreReported) {
  setField([](const glm::dvec3& at) { return glm::length(at); });
  view_ = ScreenView::of(camera_, kIsoPicture, glm::dvec3(1), kLowPass, 1e-3);
  const std::vector<double> values{0.7};
  IsoSplats splats({view_, values, kHalfCellStyle, {}, 0, all(), 10000}, 1);
  const SplatRange every{0, static_cast<uint32_t>(geometry_.size())};
  splats.add(0, glm::dvec3(0.0), arraysOf(geometry_), arraysOf(variable_), nullptr, {&every, 1});
  EXPECT_TRUE(splats.overflowed());
}

}  // namespace
}  // namespace curvisplat
