// Sources that change what another source reads pass on what they do not change.
#include <gtest/gtest.h>

#include <algorithm>
#include <memory>
#include <span>
#include <vector>

#include "preprocess/addition/drawn_samples.h"
#include "preprocess/formats/common/described_source.h"
#include "preprocess/formats/derived/derived_source.h"
#include "preprocess/grid/box_source.h"
#include "tests/reference/function_grid.h"

namespace curvisplat {
namespace {

/// A mesh of nothing, one of whose two scalars has to be prepared.
class PreparedMesh final : public MeshSource {
 public:
  PreparedMesh() {
    for (const char* name : {"stored", "prepared"}) {
      GridScalar scalar;
      scalar.name = name;
      description_.scalars.push_back(scalar);
    }
    description_.pieces.push_back({"piece 1", "memory", 0, 0});
  }
  const GridDescription& description() const override { return description_; }
  void readPoints(uint32_t, uint64_t, uint64_t, std::span<const uint32_t>, MeshPoints&) const override {}
  void readCells(uint32_t, uint64_t, uint64_t, std::span<const uint32_t>, MeshCells&) const override {}
  bool hasCurvedCells() const override { return true; }
  void prepare(std::span<const uint32_t> scalars, uint64_t, const Progress&) const override {
    prepared = {scalars.begin(), scalars.end()};
  }
  Preparation preparationFor(std::span<const uint32_t> scalars) const override {
    return {0, static_cast<size_t>(std::count(scalars.begin(), scalars.end(), 1u)), Centring::kNode};
  }
  uint64_t preparedBytes() const override { return 77; }

  mutable std::vector<uint32_t> prepared;

 private:
  GridDescription description_;
};

void expectPreparation(const MeshSource& mesh, const PreparedMesh& source) {
  const std::vector<uint32_t> scalars{0, 1};
  EXPECT_EQ(mesh.preparationFor(scalars).values, 1u);
  EXPECT_EQ(mesh.preparedBytes(), 77u);
  EXPECT_TRUE(mesh.hasCurvedCells());
  mesh.prepare(scalars, 1000, Progress());
  EXPECT_EQ(source.prepared, scalars);
}

TEST(ForwardingMesh, PassesOnThePreparationOfScalars) {
  auto owned = std::make_unique<PreparedMesh>();
  const PreparedMesh& source = *owned;
  expectPreparation(DrawnMesh(source), source);
  const auto derived = std::make_unique<DerivedMeshSource>(std::move(owned), DerivedOptions{});
  expectPreparation(*derived, source);
  auto another = std::make_unique<PreparedMesh>();
  const PreparedMesh& described_source = *another;
  const std::unique_ptr<DataSource> mesh =
      described(std::unique_ptr<DataSource>(std::move(another)), described_source.description());
  expectPreparation(dynamic_cast<const MeshSource&>(*mesh), described_source);
}

/// A grid that reads whole rows and has fringe nodes.
class FringedRows final : public FunctionGridSource {
 public:
  FringedRows()
      : FunctionGridSource({gridBlock(6, 3, 2)}, 1, [](const GridNode& node) {
          const auto number = static_cast<double>(node.i + 10 * node.j + 100 * node.k);
          return NodeValues{{number, 1, 2}, {static_cast<float>(number)}, false};
        }) {}
  bool readFringe(uint32_t, const NodeBox& box, std::vector<uint8_t>& out) const override {
    out.assign(6 * (box.j1 - box.j0) * (box.k1 - box.k0), 1);
    return true;
  }
};

TEST(ForwardingGrid, PassesOnRowsAndTheFringe) {
  class Unchanged final : public ForwardingGrid {
   public:
    explicit Unchanged(const GridSource& source) : ForwardingGrid(source) {}
  };
  const FringedRows source;
  const Unchanged grid(source);
  EXPECT_EQ(grid.description().blocks.size(), 1u);
  EXPECT_EQ(grid.rowsInMemory({}), 1u) << "the source holds a row";
  std::vector<uint8_t> fringe;
  EXPECT_TRUE(grid.readFringe(0, {0, 2, 0, 1}, fringe));
  EXPECT_EQ(fringe.size(), 12u);
  const NodeBox part{1, 3, 0, 2, 2, 5};
  const std::vector<uint32_t> scalar{0};
  NodeArrays by_read, by_part;
  grid.read(0, part, scalar, by_read);
  source.readPartOfRows(0, part, scalar, by_part);
  EXPECT_EQ(by_read.x, by_part.x);
  EXPECT_EQ(by_read.scalars, by_part.scalars);
  EXPECT_EQ(by_read.x.size(), 12u);
  EXPECT_EQ(by_read.x.front(), 12);
}

}  // namespace
}  // namespace curvisplat
