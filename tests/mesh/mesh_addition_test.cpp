// Further scalars and time steps of unstructured grids: what conversion of all at once writes.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <glm/geometric.hpp>
#include <limits>
#include <memory>

#include "preprocess/addition/add_scalar.h"
#include "preprocess/addition/convert_series.h"
#include "preprocess/convert/convert.h"
#include "preprocess/gather/halved_mesh.h"
#include "preprocess/scenes/scenes.h"
#include "stream/base/error.h"
#include "stream/cache/cache_reader.h"
#include "tests/reference/array_mesh.h"
#include "tests/support/expect_error.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/thread_ranks.h"

namespace curvisplat {
namespace {

/// A mesh with the scalars "f" and "g" at points, and "c" and "d" in cells. g and d are f's and c's squares.
class TwoOfEach final : public MeshSource {
 public:
  explicit TwoOfEach(std::vector<ArrayPiece> pieces, double time = 0)
      : mesh_(std::move(pieces)), description_(mesh_.description()) {
    for (const auto& [name, centring] : {std::pair("g", Centring::kNode), std::pair("d", Centring::kCell)}) {
      GridScalar scalar = description_.scalars[0];
      scalar.name = name;
      scalar.centring = centring;
      description_.scalars.push_back(scalar);
    }
    description_.times = {time};
  }
  const GridDescription& description() const override { return description_; }
  void readPoints(uint32_t piece, uint64_t first, uint64_t count, std::span<const uint32_t> scalars,
                  MeshPoints& out) const override {
    mesh_.readPoints(piece, first, count, std::vector<uint32_t>(scalars.size(), 0), out);
    squareSecond(scalars, out.scalars);
  }
  void readCells(uint32_t piece, uint64_t first, uint64_t count, std::span<const uint32_t> scalars,
                 MeshCells& out) const override {
    mesh_.readCells(piece, first, count, std::vector<uint32_t>(scalars.size(), 1), out);
    squareSecond(scalars, out.scalars);
  }

 private:
  static void squareSecond(std::span<const uint32_t> scalars, std::vector<std::vector<float>>& values) {
    for (size_t n = 0; n < scalars.size(); ++n)
      if (scalars[n] >= 2)
        for (float& value : values[n]) value = std::isfinite(value) ? value * value : 7;
  }

  const ArrayMesh mesh_;
  GridDescription description_;
};

class MeshAddition : public testing::Test {
 protected:
  std::filesystem::path convertAt(const DataSource& source, const std::string& name,
                                  std::vector<uint32_t> scalars) {
    ConvertOptions options;
    options.output = folder_ / name;
    options.scalars = std::move(scalars);
    Progress progress;
    convert(source, options, progress);
    return options.output;
  }

  /// Splats of all bricks, in their order: node by node the same values.
  static void expectSameValues(const CacheReader& a, uint32_t variable_of_a, const CacheReader& b,
                               uint32_t variable_of_b) {
    ASSERT_EQ(a.bricks().size(), b.bricks().size());
    for (uint32_t brick = 0; brick < a.bricks().size(); ++brick) {
      SplatVariable values_a, values_b;
      a.readVariable(brick, variable_of_a, values_a);
      b.readVariable(brick, variable_of_b, values_b);
      ASSERT_EQ(values_a.mean, values_b.mean) << "brick " << brick;
      ASSERT_EQ(values_a.slope0, values_b.slope0) << "brick " << brick;
      ASSERT_EQ(values_a.slope1, values_b.slope1) << "brick " << brick;
      ASSERT_EQ(values_a.slope2, values_b.slope2) << "brick " << brick;
      ASSERT_EQ(values_a.variance, values_b.variance) << "brick " << brick;
    }
  }

  void expectAddition(std::vector<ArrayPiece> pieces, bool cells) {
    expectAddition(TwoOfEach(std::move(pieces)), cells);
  }
  void expectAddition(const MeshSource& source, bool cells) {
    const uint32_t first = cells ? 1 : 0, second = cells ? 3 : 2;
    const auto both = convertAt(source, fmt::format("both{}", ++number_), {first, second});
    const auto added = convertAt(source, fmt::format("added{}", number_), {first});
    AddScalarOptions options;
    options.cache = added;
    options.scalars = {second};
    Progress progress;
    addScalars(source, options, progress);
    const CacheReader with_both(both), with_added(added);
    ASSERT_EQ(with_added.manifest().variables.size(), 2u);
    expectSameValues(with_added, 0, with_both, 0);
    expectSameValues(with_added, 1, with_both, 1);

    options.cache = convertAt(source, fmt::format("ranks{}", number_), {first});
    runRanks(3, [&](Ranks& ranks) {
      AddScalarOptions of_rank = options;
      of_rank.ranks = &ranks;
      Progress of_pass;
      addScalars(source, of_rank, of_pass);
    });
    Files one = filesOf(added), shared = filesOf(options.cache);
    one.erase("manifest.json");  // their titles differ
    shared.erase("manifest.json");
    EXPECT_TRUE(one == shared);
  }

  SeriesReport convertSteps(const std::vector<const DataSource*>& steps, uint32_t scalar) {
    // convertSeries() wants sources of its own.
    struct Borrowed final : MeshSource {
      explicit Borrowed(const MeshSource& of) : source(of) {}
      const GridDescription& description() const override { return source.description(); }
      void readPoints(uint32_t piece, uint64_t first, uint64_t count, std::span<const uint32_t> scalars,
                      MeshPoints& out) const override {
        source.readPoints(piece, first, count, scalars, out);
      }
      void readCells(uint32_t piece, uint64_t first, uint64_t count, std::span<const uint32_t> scalars,
                     MeshCells& out) const override {
        source.readCells(piece, first, count, scalars, out);
      }
      const MeshSource& source;
    };
    SeriesInput input;
    input.count = steps.size();
    input.name = [](uint64_t step) { return fmt::format("step {}", step); };
    input.open = [&](uint64_t step) {
      return std::make_unique<Borrowed>(dynamic_cast<const MeshSource&>(*steps[step]));
    };
    input.scalars = [&](const GridDescription&) { return std::vector<uint32_t>{scalar}; };
    SeriesOptions options;
    options.convert.output = folder_ / "series";
    options.convert.overwrite = true;
    Progress progress;
    return convertSeries(input, options, progress, [](const SeriesEvent&) {});
  }

  /// A cube of n x n x n cells, from `x` to x + 1 along x.
  ArrayPiece unitBox(double x, uint64_t n) const {
    ArrayPiece box = hexahedraOf(*scene_, n, n, n);
    for (uint64_t point = 0; point < box.points.size(); ++point)
      box.points[point] = glm::dvec3(x, 0, 0) +
                          glm::dvec3(point % (n + 1), point / (n + 1) % (n + 1), point / (n + 1) / (n + 1)) /
                              static_cast<double>(n);
    setValues(box, [](const glm::dvec3& at) { return at.x * at.y + at.z; });
    return box;
  }

  const std::shared_ptr<const Scene> scene_ = makeScene("half-annulus");
  const ArrayPiece tetrahedra_ = tetrahedraOf(*scene_, 16, 8, 8), hexahedra_ = hexahedraOf(*scene_, 16, 8, 8);
  const TemporaryFolder folder_;
  int number_ = 0;
};

TEST_F(MeshAddition, AScalarAddedLaterIsTheOneConvertedAtOnce) {
  for (const bool cells : {false, true}) {
    expectAddition({shuffled(tetrahedra_, 5)}, cells);
    expectAddition(split(hexahedra_, 3, [](size_t cell) { return cell / 50 % 3; }), cells);
  }
}

TEST_F(MeshAddition, HalvesOfCellsAreTheSameAgain) {
  for (const bool cells : {false, true})
    for (const std::vector<ArrayPiece>& pieces : {std::vector{shuffled(tetrahedraOf(*scene_, 5, 3, 2), 5)},
                                                  std::vector{unitBox(0, 2), unitBox(1, 4)}})
      expectAddition(*halved(std::make_unique<TwoOfEach>(pieces)), cells);
  EXPECT_EQ(CacheReader(folder_ / "added1").manifest().refinement, Refinement(2));
}

TEST_F(MeshAddition, CellsOfOneLayerAreTwoSplatsEachAgain) {
  const ArrayPiece layer = hexahedraOf(*scene_, 40, 20, 1);
  expectAddition({shuffled(layer, 5)}, true);
  EXPECT_EQ(CacheReader(folder_ / "added1").manifest().splats, 1600u);
  const TwoOfEach steps[] = {TwoOfEach({layer}, 0), TwoOfEach({layer}, 1)};
  EXPECT_EQ(convertSteps({&steps[0], &steps[1]}, 1).new_geometries, 0u);
  const CacheReader series(folder_ / "series");
  expectSameValues(series.atStep(1), 0, series, 0);
  AddScalarOptions options;
  options.cache = folder_ / "added1";
  options.scalars = {3};
  Progress progress;
  expectSays(curvisplat::errorOf(
                 [&] { addScalars(TwoOfEach({hexahedraOf(*scene_, 30, 20, 1)}), options, progress); }),
             "was made from a grid of 800 cells; this grid has 600");
}

TEST_F(MeshAddition, OnlyWhatTheCacheDrawsNeedsTheScalar) {
  ArrayPiece holes = hexahedra_;
  for (size_t n = 0; n < holes.points.size(); n += 97)
    holes.point_values[n] = std::numeric_limits<float>::quiet_NaN();
  for (size_t n = 0; n < holes.cells.size(); n += 31)
    holes.cell_values[n] = std::numeric_limits<float>::quiet_NaN();
  for (const bool cells : {false, true}) {
    expectAddition({holes}, cells);
    expectAddition(split(holes, 2, [](size_t cell) { return cell < 500 ? 0 : 1; }), cells);
  }
}

TEST_F(MeshAddition, HangingNodesAreFittedAsTheCacheIs) {
  const std::vector<ArrayPiece> joint{unitBox(0, 4), unitBox(1, 8)};
  const TwoOfEach source(joint), even({hexahedra_});
  for (const uint32_t scalar : {0u, 1u}) {
    expectAddition(joint, scalar == 1);
    const auto cache = convertAt(source, fmt::format("fitted{}", scalar), {scalar});
    EXPECT_EQ(CacheReader(cache).manifest().stretch, kHangingNodes);
    EXPECT_EQ(CacheReader(convertAt(even, fmt::format("none{}", scalar), {scalar})).manifest().stretch, "");
    // A cache of an earlier program is expected to have splats as they come from the cells, which lie elsewhere.
    Manifest manifest = CacheReader(cache).manifest();
    manifest.stretch = "";
    std::ofstream(cache / "manifest.json", std::ios::binary) << manifest.toJson();
    AddScalarOptions options;
    options.cache = cache;
    options.scalars = {scalar + 2};
    Progress progress;
    expectSays(curvisplat::errorOf([&] { addScalars(source, options, progress); }), "another position");
  }
}

TEST_F(MeshAddition, AnotherMeshIsRefused) {
  const auto cache = convertAt(TwoOfEach({hexahedra_}), "cache", {0});
  AddScalarOptions options;
  options.cache = cache;
  options.scalars = {2};
  Progress progress;
  const auto errorOf = [&](const DataSource& source) -> std::string {
    return curvisplat::errorOf([&] { addScalars(source, options, progress); });
  };
  expectSays(errorOf(TwoOfEach({tetrahedra_})), "was made from a grid of 1377 points; this grid has");
  ArrayPiece moved = hexahedra_;
  for (glm::dvec3& point : moved.points) point *= 2.0;
  expectSays(errorOf(TwoOfEach({moved})), "is not the one the cache was made from");
}

TEST_F(MeshAddition, StepsOfASeriesShareTheirGeometry) {
  ArrayPiece later = tetrahedra_, moved = tetrahedra_;
  setValues(later, [](const glm::dvec3& x) { return 1 + x.x * x.y; });
  for (glm::dvec3& point : moved.points) point.x += 0.25;
  const TwoOfEach steps[] = {TwoOfEach({tetrahedra_}, 0), TwoOfEach({later}, 1), TwoOfEach({moved}, 2),
                             TwoOfEach({later}, 3)};
  for (const uint32_t scalar : {0u, 1u}) {
    const SeriesReport report = convertSteps({&steps[0], &steps[1], &steps[2], &steps[3]}, scalar);
    EXPECT_EQ(report.converted, 4u);
    EXPECT_EQ(report.new_geometries, 1u);
    const CacheReader series(folder_ / "series");
    for (uint64_t step = 0; step < 4; ++step) {
      const auto alone = convertAt(steps[step], fmt::format("alone{}-{}", scalar, step), {scalar});
      expectSameValues(series.atStep(step), 0, CacheReader(alone), 0);
    }
  }
}

}  // namespace
}  // namespace curvisplat
