#include "preprocess/splats/seams.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <cerrno>
#include <cmath>
#include <glm/geometric.hpp>
#include <map>
#include <random>
#include <string>

#include "preprocess/splats/shape.h"
#include "stream/base/error.h"
#include "stream/base/file.h"
#include "stream/model/border_code.h"
#include "stream/model/layers_code.h"
#include "tests/reference/mapped_block.h"

namespace curvisplat {
namespace {

struct Piece {
  NodeSplat node;
  SplatScalar value;
};

/// A folder of the test's own, removed with it.
class TemporaryFolder {
 public:
  TemporaryFolder() {
    std::string name = (std::filesystem::temp_directory_path() / "seams_test_XXXXXX").string();
    if (!mkdtemp(name.data())) throw Error("{}: cannot be made", name);
    path_ = name;
  }
  ~TemporaryFolder() { std::filesystem::remove_all(path_); }
  const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
};

class Seams : public testing::Test {
 protected:
  std::vector<Piece> merge(const std::vector<Piece>& faces, uint64_t memory_bytes = 64 << 20,
                           int coordinate_bytes = 8, UnlikeHalves unlike = UnlikeHalves::kApart) {
    SeamMerger seams(1, memory_bytes, folder_.path(), unlike);
    for (const Piece& face : faces) seams.add(face.node, {&face.value, 1});
    return finish(seams, faces.size(), coordinate_bytes);
  }

  std::vector<Piece> finish(SeamMerger& seams, size_t faces, int coordinate_bytes) {
    std::vector<Piece> out;
    merged_ = seams.finish(coordinate_bytes, [&](const NodeSplat& node, std::span<const SplatScalar> values) {
      out.push_back({node, values[0]});
    });
    EXPECT_EQ(out.size() + merged_, faces);
    return out;
  }

  /// All splats of the blocks, merged along their faces, by position in 1/1024.
  using Places = std::map<std::array<long, 3>, Piece>;
  Places mergeBlocks(const std::vector<MappedBlock>& blocks) {
    std::vector<Piece> all;
    size_t faces = 0;
    SeamMerger seams(1, memory_bytes_, folder_.path());
    for (const MappedBlock& block : blocks) {
      const NodeSplats splats = block.splats();
      seams.add(splats, 1);
      for (size_t n = 0; n < splats.splats.size(); ++n)
        if (splats.splats[n].isForSeams())
          ++faces;
        else
          all.push_back({splats.splats[n], splats.values[n]});
    }
    const std::vector<Piece> joined = finish(seams, faces, 8);
    all.insert(all.end(), joined.begin(), joined.end());
    Places places;
    for (const Piece& piece : all) {
      const glm::dvec3 p = piece.node.splat.position * 1024.0;
      EXPECT_TRUE(
          places.emplace(std::array{std::lround(p.x), std::lround(p.y), std::lround(p.z)}, piece).second);
    }
    return places;
  }

  static Piece nearest(const Places& places, const glm::dvec3& point) {
    const auto distance = [&](const auto& place) {
      return glm::distance(place.second.node.splat.position, point);
    };
    return std::min_element(places.begin(), places.end(),
                            [&](const auto& a, const auto& b) { return distance(a) < distance(b); })
        ->second;
  }

  TemporaryFolder folder_;
  uint64_t merged_ = 0;
  uint64_t memory_bytes_ = 64 << 20;  // of mergeBlocks()
};

double field(const glm::dvec3& p) {
  return 1 + p.x - 2 * p.y + 0.5 * p.z;
}

/// Nodes [i0, i0+ni) x ... of an affine grid.
MappedBlock affineBlock(std::array<uint64_t, 3> first, std::array<uint64_t, 3> count, uint64_t first_node) {
  MappedBlock block(count[0], count[1], count[2], [&](double i, double j, double k) {
    const glm::dvec3 c(i + static_cast<double>(first[0]), j + static_cast<double>(first[1]),
                       k + static_cast<double>(first[2]));
    return glm::dvec3(c.x + 0.25 * c.y, c.y - 0.5 * c.z, 0.5 * c.z);
  });
  block.addScalar(field);
  block.first_node = first_node;
  return block;
}

void expectSame(const std::map<std::array<long, 3>, Piece>& found,
                const std::map<std::array<long, 3>, Piece>& expected) {
  ASSERT_EQ(found.size(), expected.size());
  for (const auto& [place, whole] : expected) {
    const auto at = found.find(place);
    ASSERT_NE(at, found.end());
    const Piece& piece = at->second;
    EXPECT_NEAR(piece.node.splat.weight, whole.node.splat.weight, 1e-9);
    for (int n = 0; n < 3; ++n) {
      EXPECT_NEAR(piece.node.splat.axis[n], whole.node.splat.axis[n], 1e-9);
      EXPECT_NEAR(piece.node.splat.shear[n], whole.node.splat.shear[n], 1e-9);
    }
    EXPECT_NEAR(piece.value.mean, whole.value.mean, 1e-9);
    EXPECT_LT(glm::distance(piece.value.slope, whole.value.slope), 1e-9);
    EXPECT_NEAR(piece.value.variance, 0, 1e-9);
    const InwardAxes open = inwardAxes(piece.node.border_code), border = inwardAxes(whole.node.border_code);
    ASSERT_EQ(open.behind, border.behind);
    ASSERT_EQ(open.count, border.count);
    EXPECT_EQ(open.faces, border.faces);
    const uint32_t layers = layersOf(piece.node.border_code),
                   expected_layers = layersOf(whole.node.border_code);
    ASSERT_EQ(std::popcount(layers), std::popcount(expected_layers));
    for (int n = 0; n < 3; ++n) {
      const bool is_end = n < border.count;
      if (!is_end && (expected_layers >> n & 1) == 0) continue;
      double closest = -1;
      for (int m = 0; m < 3; ++m)
        if (is_end ? m < open.count : (layers >> m & 1) != 0)
          closest = std::max<double>(closest, glm::dot(open.axis[m], border.axis[n]));
      EXPECT_GT(closest, 0.999);
    }
  }
}

TEST_F(Seams, OfTwoBlocksVanish) {
  const Places whole = mergeBlocks({affineBlock({0, 0, 0}, {9, 5, 6}, 0)});
  EXPECT_EQ(merged_, 0u);
  const Places cut =
      mergeBlocks({affineBlock({0, 0, 0}, {4, 5, 6}, 0), affineBlock({3, 0, 0}, {6, 5, 6}, 4 * 5 * 6)});
  EXPECT_EQ(merged_, 30u);
  expectSame(cut, whole);
  memory_bytes_ = 10000;  // some fifty splats: in runs on disk, and those that wait for probes as well
  expectSame(
      mergeBlocks({affineBlock({3, 0, 0}, {6, 5, 6}, 4 * 5 * 6), affineBlock({0, 0, 0}, {4, 5, 6}, 0)}),
      whole);
}

/// The splats of block faces, out of all.
std::vector<Piece> facesOf(const MappedBlock& block) {
  const NodeSplats splats = block.splats();
  std::vector<Piece> faces;
  for (size_t n = 0; n < splats.splats.size(); ++n)
    if (splats.splats[n].on_block_face) faces.push_back({splats.splats[n], splats.values[n]});
  return faces;
}

/// Nodes of a block whose cells are `size` wide along each axis, from `first` on.
MappedBlock boxBlock(const glm::dvec3& first, const glm::dvec3& size, uint64_t first_node) {
  MappedBlock block(4, 4, 4,
                    [&](double i, double j, double k) { return first + size * glm::dvec3(i, j, k); });
  block.addScalar(field);
  block.first_node = first_node;
  return block;
}

/// The pieces at a point, of blocks merged along their faces.
std::vector<Piece> piecesAt(const std::vector<Piece>& pieces, const glm::dvec3& point) {
  std::vector<Piece> there;
  for (const Piece& piece : pieces)
    if (glm::distance(piece.node.node_position, point) < 1e-9) there.push_back(piece);
  return there;
}

/// Cells that grow along i, by `growth` from one to the next.
MappedBlock growingBlock(uint64_t first, uint64_t count, double growth, uint64_t first_node) {
  MappedBlock block(count, 5, 6, [&](double i, double j, double k) {
    return glm::dvec3((std::pow(growth, i + static_cast<double>(first)) - 1) / (growth - 1), j, k);
  });
  block.addScalar(field);
  block.first_node = first_node;
  return block;
}

TEST_F(Seams, OfGrowingCellsAreSkewedAsTheCellsBesideThem) {
  for (const double growth : {1.2, 0.85}) {
    const MappedBlock uncut = growingBlock(0, 13, growth, 0);
    std::vector<Piece> faces = facesOf(growingBlock(0, 7, growth, 0));
    const std::vector<Piece> others = facesOf(growingBlock(6, 7, growth, 210));
    faces.insert(faces.end(), others.begin(), others.end());
    const std::vector<Piece> joined = merge(faces);
    const NodeSplats whole = uncut.splats();
    const auto expected = std::find_if(whole.splats.begin(), whole.splats.end(),
                                       [&](const NodeSplat& n) { return n.node == uncut.at(6, 2, 2); });
    ASSERT_NE(expected, whole.splats.end());
    const std::vector<Piece> there = piecesAt(joined, expected->node_position);
    ASSERT_EQ(there.size(), 1u);
    const Splat &found = there[0].node.splat, &exact = expected->splat;
    // The drift is 0.03 and 0.02 of a cell.
    EXPECT_LT(glm::distance(found.position, exact.position), 0.002 * exact.axis[0]) << growth;
    const float skew = cellGrowth(there[0].node.growth_code).growth[0];
    EXPECT_NEAR(skew, cellGrowth(expected->growth_code).growth[0], 0.032) << growth;
    EXPECT_NEAR(skew, std::log(growth), 0.03) << growth;
    const double mean = whole.values[static_cast<size_t>(expected - whole.splats.begin())].mean;
    EXPECT_NEAR(there[0].value.mean, mean, 0.002 * exact.axis[0]) << growth;
  }
}

TEST_F(Seams, OfEvenBlocksOfOtherSizesGrowByHalfOfTheJump) {
  std::vector<Piece> faces = facesOf(boxBlock({0, 0, 0}, {1, 1, 1}, 0));
  const std::vector<Piece> others = facesOf(boxBlock({3, 0, 0}, {1.25, 1, 1}, 64));
  faces.insert(faces.end(), others.begin(), others.end());
  const std::vector<Piece> there = piecesAt(merge(faces), {3, 1, 1});
  ASSERT_EQ(there.size(), 1u);
  EXPECT_NEAR(cellGrowth(there[0].node.growth_code).growth[0], 0.5 * std::log(1.25), 0.02);
}

/// Nodes [i0, i0+ni) x ... of a grid whose cells are of unlike sizes along all three axes, and sheared.
MappedBlock unevenBlock(std::array<uint64_t, 3> first, std::array<uint64_t, 3> count, uint64_t first_node,
                        double (*scalar)(const glm::dvec3&) = field) {
  static constexpr std::array<double, 6> kSizes{1, 1.6, 1, 1.5, 2.4, 1.5};  // elements of three cells
  const auto along = [](double n) {
    double at = 0;
    for (int cell = 0; cell < static_cast<int>(n); ++cell) at += kSizes[static_cast<size_t>(cell) % 6];
    return at;
  };
  MappedBlock block(count[0], count[1], count[2], [=](double i, double j, double k) {
    const glm::dvec3 c(along(i + static_cast<double>(first[0])), along(j + static_cast<double>(first[1])),
                       along(k + static_cast<double>(first[2])));
    return glm::dvec3(c.x + 0.25 * c.y, c.y - 0.5 * c.z, 0.5 * c.z);
  });
  block.addScalar(scalar);
  block.first_node = first_node;
  return block;
}

// Eight blocks whose cells are 1.5 times as large on one side of a joint as on the other, and the same nodes as one block.
TEST_F(Seams, LeaveCellsOfUnlikeSizesAsIfTheyHadNeverBeenCut) {
  std::vector<MappedBlock> blocks;
  for (int octant = 0; octant < 8; ++octant) {
    std::array<uint64_t, 3> first{};
    for (int axis = 0; axis < 3; ++axis) first[axis] = octant >> axis & 1 ? 6 : 0;
    blocks.push_back(unevenBlock(first, {7, 7, 7}, blocks.empty() ? 0 : blocks.back().first_node + 1000));
  }
  const Places cut = mergeBlocks(blocks);
  EXPECT_EQ(merged_, 8u * 7 * 7 * 7 - 13 * 13 * 13);
  const Places whole = mergeBlocks({unevenBlock({0, 0, 0}, {13, 13, 13}, 0)});
  const MappedBlock grid = unevenBlock({0, 0, 0}, {13, 13, 13}, 0);
  double worst_scalar = 0;
  for (const auto& [place, piece] : cut)
    worst_scalar = std::max(worst_scalar, std::abs(piece.value.mean - field(piece.node.splat.position)));
  EXPECT_LT(worst_scalar, 1e-5);  // values are floats
  for (const std::array<uint64_t, 3> at :
       {std::array<uint64_t, 3>{6, 6, 6}, {5, 6, 6}, {6, 7, 4}, {5, 7, 6}, {5, 5, 7}, {4, 6, 8}}) {
    const size_t n = grid.at(at[0], at[1], at[2]);
    const glm::dvec3 node(grid.nodes.x[n], grid.nodes.y[n], grid.nodes.z[n]);
    const Piece found = nearest(cut, node), expected = nearest(whole, node);
    const Splat &a = found.node.splat, &b = expected.node.splat;
    SCOPED_TRACE(testing::Message() << at[0] << ' ' << at[1] << ' ' << at[2]);
    EXPECT_LT(glm::length(inFrameOf(b, a.position - b.position)), 0.01);
    EXPECT_NEAR(a.weight, b.weight, 1e-9);
    const glm::dmat3 s = a.factor() * glm::transpose(a.factor()), t = b.factor() * glm::transpose(b.factor());
    for (int c = 0; c < 3; ++c)
      for (int r = 0; r < 3; ++r)
        EXPECT_NEAR(s[c][r], t[c][r], 0.03 * std::sqrt(t[c][c] * t[r][r])) << c << r;
    const glm::dvec3 gradient = gradientOf(a, found.value.slope);
    EXPECT_LT(glm::distance(gradient, glm::dvec3(1, -2, 0.5)), 1e-6);
    EXPECT_EQ(found.node.border_code, kNoBorder);
    // The third cumulants, as a vector of sums: of codes to a thirtieth.
    const auto skew = [](const NodeSplat& of) {
      const CellGrowth growth = cellGrowth(of.growth_code);
      glm::dvec3 sum(0.0);
      for (size_t axis = 0; axis < 3; ++axis)
        sum += static_cast<double>(growth.growth[axis]) *
               glm::normalize(of.splat.factor() * glm::dvec3(growth.axis[axis]));
      return sum;
    };
    EXPECT_LT(glm::distance(skew(found.node), skew(expected.node)), 0.1);
  }
}

TEST_F(Seams, LeaveBentScalarsAsIfTheyHadNeverBeenCut) {
  const auto bent = [](const glm::dvec3& p) { return 0.1 * p.x * p.x; };
  const auto block = [&](uint64_t first, uint64_t count, uint64_t node) {
    return unevenBlock({first, 0, 0}, {count, 7, 7}, node, bent);
  };
  const Places cut = mergeBlocks({block(0, 7, 0), block(6, 7, 1000)}), whole = mergeBlocks({block(0, 13, 0)});
  ASSERT_EQ(cut.size(), whole.size());
  for (const auto& [place, expected] : whole) {
    const Piece found = nearest(cut, expected.node.splat.position);
    // The means are up to 0.046 above the scalar at the middle: what the kernel makes of it.
    EXPECT_NEAR(found.value.mean, expected.value.mean, 0.01);
    EXPECT_NEAR(found.value.slope.x, expected.value.slope.x, 0.012 * std::abs(expected.value.slope.x) + 0.01);
    EXPECT_EQ(found.value.variance, 0);
  }
}

TEST_F(Seams, LeaveNoFaceToTheLayerBehindThem) {
  const Places cut =
      mergeBlocks({affineBlock({0, 0, 0}, {6, 6, 6}, 0), affineBlock({5, 0, 0}, {6, 6, 6}, 6 * 6 * 6)});
  const auto bitsAt = [&](int i, int j, int k) {
    const glm::dvec3 p = glm::dvec3(i + 0.25 * j, j - 0.5 * k, 0.5 * k) * 1024.0;
    return cut.at({std::lround(p.x), std::lround(p.y), std::lround(p.z)}).node.border_code;
  };
  const auto codeAt = [&](int i, int j, int k) { return inwardAxes(bitsAt(i, j, k)); };
  EXPECT_EQ(codeAt(4, 2, 2).count, 0);
  EXPECT_EQ(codeAt(6, 2, 2).count, 0);
  EXPECT_TRUE(codeAt(1, 2, 2).behind);
  EXPECT_TRUE(codeAt(9, 3, 2).behind);
  EXPECT_TRUE(codeAt(3, 2, 4).behind);
  // On the seam.
  EXPECT_EQ(codeAt(5, 2, 2).count, 0);
  EXPECT_EQ(layersOf(bitsAt(5, 2, 2)), 0u);
  EXPECT_TRUE(codeAt(5, 2, 1).behind);
  EXPECT_EQ(layersOf(bitsAt(5, 1, 1)), 3u);
  // Behind the seam and two faces.
  EXPECT_EQ(codeAt(4, 1, 1).count, 0);
  EXPECT_EQ(layersOf(bitsAt(4, 1, 1)), 3u);
  EXPECT_EQ(layersOf(bitsAt(1, 1, 1)), 7u);
}

TEST_F(Seams, OfEightBlocksVanishAtTheirCommonCornerToo) {
  std::vector<MappedBlock> blocks;
  for (int octant = 0; octant < 8; ++octant) {
    std::array<uint64_t, 3> first{}, count{};
    for (int axis = 0; axis < 3; ++axis) {
      const bool upper = octant >> axis & 1;
      first[axis] = upper ? 3 : 0;
      count[axis] = upper ? 5 : 4;
    }
    blocks.push_back(affineBlock(first, count, blocks.empty() ? 0 : blocks.back().first_node + 1000));
  }
  const Places cut = mergeBlocks(blocks);
  EXPECT_EQ(merged_, 9u * 9 * 9 - 8 * 8 * 8);
  expectSame(cut, mergeBlocks({affineBlock({0, 0, 0}, {8, 8, 8}, 0)}));
  // The corner's node is the lowest of the eight.
  const glm::dvec3 corner = affineBlock({3, 3, 3}, {1, 1, 1}, 0).splats().splats[0].node_position * 1024.0;
  const Piece& piece = cut.at({std::lround(corner.x), std::lround(corner.y), std::lround(corner.z)});
  EXPECT_EQ(piece.node.node, blocks[0].at(3, 3, 3));
  EXPECT_FALSE(piece.node.regular);
}

TEST_F(Seams, HalvesOfUnlikeThicknessStayApartAndEndAtTheFace) {
  for (const double ratio : {1.2, 2.8, 4.0}) {
    std::vector<Piece> faces = facesOf(boxBlock({0, 0, 0}, {1, 1, 1}, 0));
    const std::vector<Piece> others = facesOf(boxBlock({3, 0, 0}, {ratio, 1, 1}, 64));
    faces.insert(faces.end(), others.begin(), others.end());
    const glm::dvec3 on_joint(3, 1, 1);

    const std::vector<Piece> merged = merge(faces, 64 << 20, 8, UnlikeHalves::kMerged);
    EXPECT_EQ(piecesAt(merged, on_joint).size(), 1u);
    const std::vector<Piece> there = piecesAt(merge(faces), on_joint);
    if (ratio < kMaxJointRatio) {
      EXPECT_EQ(there.size(), 1u);
      continue;
    }
    EXPECT_EQ(merged_, 0u);
    ASSERT_EQ(there.size(), 2u);
    for (const Piece& piece : there) {
      const InwardAxes open = inwardAxes(piece.node.border_code);
      ASSERT_EQ(open.count, 1);
      EXPECT_TRUE(open.hasFace(0));
      EXPECT_NEAR(open.axis[0].x, piece.node.node < 64 ? -1 : 1, 0.01);
      EXPECT_NEAR(piece.node.splat.weight, piece.node.node < 64 ? 0.5 : 0.5 * ratio, 1e-12);
    }
  }
}

TEST_F(Seams, AcrossAWallLayerAreAlikeIfTheirCellsAre) {
  // Cells 500 times as long, across the joint, as they are high; at an angle, so that codes of directions are rounded.
  const auto sheet = [](double first, uint64_t first_node) {
    MappedBlock block(4, 4, 4, [&](double i, double j, double k) {
      const double x = first + i, y = 0.002 * j;
      return glm::dvec3(0.8 * x - 0.6 * y, 0.6 * x + 0.8 * y, k);
    });
    block.addScalar(field);
    block.first_node = first_node;
    return block;
  };
  std::vector<Piece> faces = facesOf(sheet(0, 0));
  for (const Piece& face : facesOf(sheet(3, 64))) faces.push_back(face);
  merge(faces);
  EXPECT_EQ(merged_, 16u);
}

TEST_F(Seams, OfFourBlocksUnlikeAlongOneAxisMergeAlongTheOther) {
  std::vector<Piece> faces;
  for (int n = 0; n < 4; ++n) {
    const bool right = n % 2 != 0, upper = n / 2 != 0;
    const glm::dvec3 first(right ? 3 : 0, upper ? 3 : 0, 0), size(right ? 4 : 1, 1, 1);
    for (const Piece& face : facesOf(boxBlock(first, size, 64 * static_cast<uint64_t>(n))))
      faces.push_back(face);
  }
  std::shuffle(faces.begin(), faces.end(), std::mt19937(3));
  const std::vector<Piece> there = piecesAt(merge(faces), {3, 3, 1});
  ASSERT_EQ(there.size(), 2u);
  for (const Piece& piece : there) {
    const bool left = piece.node.node < 64;
    EXPECT_NEAR(piece.node.splat.weight, left ? 0.5 : 2, 1e-12);
    const InwardAxes open = inwardAxes(piece.node.border_code);
    ASSERT_EQ(open.count, 1);
    EXPECT_NEAR(open.axis[0].x, left ? -1 : 1, 0.01);
    EXPECT_TRUE(open.hasFace(0));
  }
}

/// A pipe whose wall layer begins at radius 1 with `spacing`, closed along i after 128 steps. In float
/// arithmetic, as a grid generator would.
MappedBlock pipe(float spacing) {
  MappedBlock block(129, 7, 5, [&](double i, double j, double k) {
    const float theta = static_cast<float>(i) * (6.2831853f / 128.0f);
    const float r = 1.0f + spacing * static_cast<float>(j);
    return glm::dvec3(r * std::cos(theta), r * std::sin(theta), static_cast<float>(k));
  });
  block.addScalar([](const glm::dvec3& p) { return p.z; });
  return block;
}

TEST_F(Seams, OfAPeriodicAxisCloseThoughRoundedDifferently) {
  const MappedBlock block = pipe(0.1f);
  ASSERT_NE(block.nodes.y[block.at(0, 2, 2)], block.nodes.y[block.at(128, 2, 2)]);
  const std::vector<Piece> out = merge(facesOf(block), 64 << 20, 4);
  EXPECT_EQ(merged_, 7u * 5u);

  // A node of the seam comes out as its neighbours around the pipe, up to the angle's square.
  const NodeSplats splats = block.splats();
  const NodeSplat& beside = splats.splats[block.at(1, 3, 2)];
  const auto seam = std::find_if(out.begin(), out.end(),
                                 [&](const Piece& piece) { return piece.node.node == block.at(0, 3, 2); });
  ASSERT_NE(seam, out.end());
  EXPECT_NEAR(seam->node.splat.weight / beside.splat.weight, 1, 1e-3);
  const auto found = singularValues(seam->node.splat.factor()),
             expected = singularValues(beside.splat.factor());
  for (int n = 0; n < 3; ++n) EXPECT_NEAR(found[n] / expected[n], 1, 2e-3);
}

TEST_F(Seams, DoNotJoinTheNodesOfAWallLayer) {
  // Eight units in the last place apart: still the seam's 35 pairs and no others.
  merge(facesOf(pipe(1e-6f)), 64 << 20, 4);
  EXPECT_EQ(merged_, 7u * 5u);
  // In double precision, far below any float's rounding.
  MappedBlock thin(5, 9, 5, [](double i, double j, double k) { return glm::dvec3(100 + i, 1e-10 * j, k); });
  thin.addScalar(field);
  merge(facesOf(thin), 64 << 20, 4);
  EXPECT_EQ(merged_, 0u);
}

TEST_F(Seams, LeaveSinglesAsTheyAre) {
  const std::vector<Piece> faces = facesOf(affineBlock({0, 0, 0}, {3, 3, 3}, 10));
  std::vector<Piece> out = merge(faces);
  EXPECT_EQ(merged_, 0u);
  std::sort(out.begin(), out.end(), [](const Piece& a, const Piece& b) { return a.node.node < b.node.node; });
  for (size_t n = 0; n < faces.size(); ++n) {
    EXPECT_EQ(out[n].node.node, faces[n].node.node);
    EXPECT_EQ(out[n].node.splat.position, faces[n].node.splat.position);
    EXPECT_EQ(out[n].node.splat.axis, faces[n].node.splat.axis);
    EXPECT_TRUE(out[n].node.regular);
  }
}

TEST_F(Seams, JoinAPolarAxisIntoOneSplatANode) {
  MappedBlock block(25, 4, 6, [](double i, double j, double k) {
    return glm::dvec3(5 + 0.1 * j * std::cos(i * M_PI / 12), 0.1 * j * std::sin(i * M_PI / 12), 0.2 * k);
  });
  block.addScalar(field);
  const std::vector<Piece> out = merge(facesOf(block));
  EXPECT_EQ(merged_, 24u * 6u + 3 * 6u);
  size_t on_axis = 0;
  for (const Piece& piece : out) {
    if (piece.node.node_position.x != 5 || piece.node.node_position.y != 0) continue;
    ++on_axis;
    EXPECT_EQ(piece.node.splat.weight, 0);
    EXPECT_NEAR(piece.node.splat.position.x, 5, 2e-3);
    const auto sigma = singularValues(piece.node.splat.factor());
    EXPECT_LE(sigma[0], 0.2001);
    EXPECT_GE(sigma[2], 0.05);
    EXPECT_TRUE(std::isfinite(glm::length(piece.value.slope)));
  }
  EXPECT_EQ(on_axis, 6u);
}

std::vector<Piece> randomFaces(size_t count, uint64_t seed) {
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> unit(0, 1);
  std::vector<Piece> faces(count);
  for (size_t n = 0; n < count; ++n) {
    NodeSplat& node = faces[n].node;
    node.node = n;
    node.on_block_face = true;
    node.regular = n % 3 == 0;
    node.spacing = 0.01;
    // Places on a lattice, each taken a few times: some exactly, others off by less than the tolerance.
    const double off = n % 2 == 0 ? 0.0 : 1e-6;
    const auto place = [&] { return 0.01 * std::floor(10 * unit(random)) + off * unit(random); };
    node.node_position = {place(), place(), place()};
    node.splat.position = node.node_position + glm::dvec3(1e-3 * unit(random));
    node.splat.weight = unit(random);
    faces[n].value = {unit(random), {unit(random), unit(random), unit(random)}, unit(random)};
  }
  return faces;
}

void expectIdentical(const std::vector<Piece>& a, const std::vector<Piece>& b) {
  ASSERT_EQ(a.size(), b.size());
  for (size_t n = 0; n < a.size(); ++n) {
    EXPECT_EQ(a[n].node.node, b[n].node.node);
    EXPECT_EQ(a[n].node.regular, b[n].node.regular);
    EXPECT_EQ(a[n].node.on_block_face, b[n].node.on_block_face);
    EXPECT_EQ(a[n].node.node_position, b[n].node.node_position);
    EXPECT_EQ(a[n].node.spacing, b[n].node.spacing);
    EXPECT_EQ(a[n].node.splat.position, b[n].node.splat.position);
    EXPECT_EQ(a[n].node.splat.axis, b[n].node.splat.axis);
    EXPECT_EQ(a[n].node.splat.shear, b[n].node.splat.shear);
    EXPECT_EQ(a[n].node.splat.weight, b[n].node.splat.weight);
    EXPECT_EQ(a[n].value.mean, b[n].value.mean);
    EXPECT_EQ(a[n].value.slope, b[n].value.slope);
    EXPECT_EQ(a[n].value.variance, b[n].value.variance);
  }
}

TEST_F(Seams, DependNeitherOnTheOrderNorOnTheMemory) {
  std::vector<Piece> faces = randomFaces(3000, 1);
  const std::vector<Piece> expected = merge(faces);
  EXPECT_GT(expected.size(), 900u);
  EXPECT_LE(expected.size(), 1000u);
  std::mt19937_64 random(2);
  for (const uint64_t memory_bytes : {uint64_t{1}, uint64_t{1000}, uint64_t{100000}, uint64_t{64} << 20}) {
    std::shuffle(faces.begin(), faces.end(), random);
    expectIdentical(merge(faces, memory_bytes), expected);
    EXPECT_TRUE(std::filesystem::is_empty(folder_.path()));
  }
}

TEST_F(Seams, JoinACrowdInOnePoint) {
  std::vector<Piece> faces = randomFaces(100000, 3);
  double weight = 0;
  for (Piece& face : faces) {
    face.node.node_position = {0.1, 0.2, 0.3};
    weight += face.node.splat.weight;
  }
  const std::vector<Piece> out = merge(faces, 1 << 20);
  ASSERT_EQ(out.size(), 1u);
  EXPECT_NEAR(out[0].node.splat.weight / weight, 1, 1e-9);
  EXPECT_EQ(out[0].node.node, 0u);

  // A collapsed block knows no spacing: exact coincidence counts.
  for (Piece& face : faces) face.node.spacing = 0;
  faces[77].node.node_position.x = std::nextafter(0.1, 1.0);
  EXPECT_EQ(merge(faces).size(), 2u);
}

TEST_F(Seams, OfNothingAreNothing) {
  EXPECT_TRUE(merge({}).empty());
}

TEST_F(Seams, SayWhenTheDiskIsFull) {
  struct FullDisk : SystemCalls {
    ssize_t pwrite(int, const void*, size_t, int64_t) override {
      errno = ENOSPC;
      return -1;
    }
  } full;
  const std::vector<Piece> faces = randomFaces(100, 4);
  const ScopedSystemCalls scope(full);
  SeamMerger seams(1, 1000, folder_.path());
  try {
    for (const Piece& face : faces) seams.add(face.node, {&face.value, 1});
    FAIL() << "a full disk went unnoticed";
  } catch (const Error& error) {
    EXPECT_NE(std::string(error.what()).find(folder_.path().string()), std::string::npos) << error.what();
  }
  EXPECT_TRUE(std::filesystem::is_empty(folder_.path()));
}

}  // namespace
}  // namespace curvisplat
