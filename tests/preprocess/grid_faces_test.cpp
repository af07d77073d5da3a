// The grid's faces in a cache: which quads are outer faces, what their patches hold at every level of detail, and
// that the bytes depend on the grid alone.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <set>
#include <span>

#include "preprocess/convert/convert.h"
#include "preprocess/faces/face_spool.h"
#include "stream/base/error.h"
#include "stream/base/file.h"
#include "stream/cache/cache_reader.h"
#include "stream/cache/faces_file.h"
#include "tests/reference/function_grid.h"
#include "tests/support/expect_error.h"
#include "tests/support/temporary_folder.h"

namespace curvisplat {
namespace {

NodeValues bentNode(const GridNode& node) {
  const glm::dvec3 at(node.i, node.j, node.k);
  return {{at.x + 0.1 * std::sin(at.y), at.y * 0.5, at.z + 0.02 * at.x * at.y},
          {static_cast<float>(at.x + 100 * at.y), static_cast<float>(at.z)},
          false};
}

/// Two blocks that abut at the i end of the first.
FunctionGridSource blocksInARow(uint64_t ni, uint64_t nj, uint64_t nk) {
  return {{gridBlock(ni, nj, nk), gridBlock(ni, nj, nk)}, 2, [=](const GridNode& node) {
            GridNode moved = node;
            moved.i += node.block * (ni - 1);
            return bentNode(moved);
          }};
}

class GridFacesTest : public testing::Test {
 protected:
  std::shared_ptr<const FacesReader> convertAndOpen(const GridSource& source,
                                                    std::vector<IndexPlane> planes = {}) {
    ConvertOptions options;
    options.output = folder_ / "a.splats";
    options.overwrite = true;
    options.memory_bytes = memory_;
    options.threads = threads_;
    options.planes = std::move(planes);
    options.scalars = {0, 1};
    options.blank_faces = blank_faces_;
    Progress progress;
    convert(source, options, progress);
    manifest_ = CacheReader(options.output).manifest();
    return FacesReader::open(options.output, manifest_);
  }
  std::string bytes() const { return readTextFile(folder_ / "a.splats/faces.bin"); }

  TemporaryFolder folder_;
  Manifest manifest_;
  uint64_t memory_ = 1 << 30;
  unsigned threads_ = 2;
  bool blank_faces_ = true;
};

uint64_t quadsOf(const FacesReader& faces, const GridFace& face) {
  uint64_t quads = 0;
  for (uint32_t n = 0; n < faces.patches().size(); ++n) {
    const FacePatch& patch = faces.patches()[n];
    if (&faces.faces()[patch.face] != &face || patch.child_count > 0) continue;
    for (const uint8_t drawn : faces.read(n).quads) quads += drawn;
  }
  return quads;
}

TEST_F(GridFacesTest, AFaceClosedByAnotherBlockIsNotAnOuterFace) {
  const auto faces = convertAndOpen(blocksInARow(6, 5, 4));
  ASSERT_TRUE(faces);
  std::map<std::pair<uint32_t, std::string>, uint64_t> quads;
  for (const GridFace& face : faces->faces())
    quads[{face.block, std::string(1, "ijk"[face.axis]) + (face.side == FaceSide::kMin ? "min" : "max")}] =
        quadsOf(*faces, face);
  EXPECT_EQ(quads.size(), 10u);
  EXPECT_FALSE(quads.contains({0, "imax"}));
  EXPECT_FALSE(quads.contains({1, "imin"}));
  EXPECT_EQ((quads[{0, "imin"}]), 4u * 3);
  EXPECT_EQ((quads[{1, "jmax"}]), 5u * 3);
  EXPECT_EQ((quads[{1, "kmin"}]), 5u * 4);
}

TEST_F(GridFacesTest, BlankedNodesLeaveHoles) {
  const auto faces = convertAndOpen(FunctionGridSource({gridBlock(6, 5, 4)}, 2, [](const GridNode& node) {
    NodeValues values = bentNode(node);
    values.blank = node.k == 0 && node.i == 2 && node.j == 2;
    return values;
  }));
  for (const GridFace& face : faces->faces())
    if (face.axis == 2 && face.side == FaceSide::kMin) {
      EXPECT_EQ(quadsOf(*faces, face), 5u * 4 - 4);
    }
}

/// Quads by the sums of their corners, which are whole numbers here.
using QuadSums = std::multiset<std::array<int64_t, 3>>;

std::array<int64_t, 3> roundedSum(const std::array<glm::dvec3, 4>& corners) {
  const glm::dvec3 sum = corners[0] + corners[1] + corners[2] + corners[3];
  return {std::llround(sum.x), std::llround(sum.y), std::llround(sum.z)};
}

QuadSums blankQuadsOf(const FacesReader& blanks) {
  QuadSums sums;
  for (uint32_t n = 0; n < blanks.patches().size(); ++n) {
    const PatchNodes nodes = blanks.read(n);
    const size_t columns = blanks.patches()[n].nodes[0];
    for (size_t q = 0; q < nodes.quads.size(); ++q) {
      if (!nodes.quads[q]) continue;
      const size_t at = q / (columns - 1) * columns + q % (columns - 1);
      const auto& p = nodes.positions;
      sums.insert(roundedSum({p[at], p[at + 1], p[at + columns], p[at + columns + 1]}));
    }
  }
  return sums;
}

NodeValues straight(const GridNode& node) {
  NodeValues values = bentNode(node);
  values.position = {node.i, node.j, node.k};
  return values;
}

/// A floor of steps, an island and a hole inside.
bool isBlanked(uint64_t i, uint64_t j, uint64_t k) {
  return k < (i * 7 + j * 3) % 5 || (i < 12 && j > 60) || (i > 80 && i < 85 && j > 20 && j < 30 && k == 8);
}

QuadSums expectedBlankQuads(const std::array<uint64_t, 3>& size) {
  const auto is_there = [&](const std::array<uint64_t, 3>& cell) {
    for (uint64_t n = 0; n < 8; ++n)
      if (isBlanked(cell[0] + (n & 1), cell[1] + (n >> 1 & 1), cell[2] + (n >> 2))) return false;
    return true;
  };
  QuadSums sums;
  for (size_t axis = 0; axis < 3; ++axis)
    for (uint64_t k = 0; k + 1 < size[2]; ++k)
      for (uint64_t j = 0; j + 1 < size[1]; ++j)
        for (uint64_t i = 0; i + 1 < size[0]; ++i) {
          const std::array<uint64_t, 3> above{i, j, k};
          std::array<uint64_t, 3> below = above;
          if (below[axis]-- == 0 || is_there(above) == is_there(below)) continue;
          std::array<glm::dvec3, 4> corners{};
          for (uint64_t n = 0; n < 4; ++n) {
            std::array<uint64_t, 3> at = above;
            at[axis == 0 ? 1 : 0] += n & 1;
            at[axis == 2 ? 1 : 2] += n >> 1;
            GridNode node{};
            node.i = at[0], node.j = at[1], node.k = at[2];
            corners[n] = straight(node).position;
          }
          sums.insert(roundedSum(corners));
        }
  return sums;
}

TEST_F(GridFacesTest, FacesOfBlankedCellsAreThoseBetweenDrawnAndBlankedOnes) {
  const auto blanksOf = [&](uint64_t memory, unsigned threads) {
    memory_ = memory;
    threads_ = threads;
    convertAndOpen(FunctionGridSource({gridBlock(90, 80, 20)}, 2, [](const GridNode& node) {
      NodeValues values = straight(node);
      values.blank = isBlanked(node.i, node.j, node.k);
      return values;
    }));
    return FacesReader::open(folder_ / "a.splats", manifest_, kBlanksFileName);
  };
  const auto blanks = blanksOf(1 << 30, 2);
  ASSERT_TRUE(blanks);
  EXPECT_EQ(blankQuadsOf(*blanks), expectedBlankQuads({90, 80, 20}));
  const std::string bytes = readTextFile(folder_ / "a.splats/faces.blanks.bin");
  EXPECT_LT(bytes.size(), 30 * blankQuadsOf(*blanks).size());
  ASSERT_TRUE(blanksOf(uint64_t{200} << 20, 1));
  EXPECT_EQ(readTextFile(folder_ / "a.splats/faces.blanks.bin"), bytes);
  blank_faces_ = false;
  EXPECT_FALSE(blanksOf(1 << 30, 2));
}

TEST_F(GridFacesTest, FacesOfBlankedCellsAreFoundWhereBlocksMeet) {
  // The grid above in two blocks, the second from its end on. The island's coast lies where they meet, and the floor's steps.
  static constexpr uint64_t kCut = 12, kNodes = 90;
  const auto blanksOf = [&](uint64_t memory, unsigned threads) {
    memory_ = memory;
    threads_ = threads;
    convertAndOpen(FunctionGridSource({gridBlock(kCut + 1, 80, 20), gridBlock(kNodes - kCut, 80, 20)}, 2,
                                      [](const GridNode& node) {
                                        GridNode whole = node;
                                        if (node.block == 1) whole.i = kNodes - 1 - node.i;
                                        NodeValues values = straight(whole);
                                        values.blank = isBlanked(whole.i, whole.j, whole.k);
                                        return values;
                                      }));
    return FacesReader::open(folder_ / "a.splats", manifest_, kBlanksFileName);
  };
  const auto blanks = blanksOf(1 << 30, 2);
  ASSERT_TRUE(blanks);
  const QuadSums expected = expectedBlankQuads({kNodes, 80, 20});
  EXPECT_TRUE(
      std::any_of(expected.begin(), expected.end(), [](const auto& sum) { return sum[0] == 4 * kCut; }));
  EXPECT_EQ(blankQuadsOf(*blanks), expected);
  const std::string bytes = readTextFile(folder_ / "a.splats/faces.blanks.bin");
  ASSERT_TRUE(blanksOf(uint64_t{200} << 20, 1));
  EXPECT_EQ(readTextFile(folder_ / "a.splats/faces.blanks.bin"), bytes);
}

TEST_F(GridFacesTest, AGridWithoutBlankedNodesHasNoFacesOfThem) {
  ASSERT_TRUE(convertAndOpen(blocksInARow(6, 5, 4)));
  EXPECT_FALSE(FacesReader::open(folder_ / "a.splats", manifest_, kBlanksFileName));
}

TEST_F(GridFacesTest, APlaneInsideIsKeptWhenAskedFor) {
  const auto faces = convertAndOpen(blocksInARow(6, 5, 4), {{1, 2, 2}});
  int found = 0;
  for (const GridFace& face : faces->faces())
    if (face.side == FaceSide::kPlane) {
      ++found;
      EXPECT_EQ(face.block, 1u);
      EXPECT_EQ(face.index, 2u);
      EXPECT_EQ(quadsOf(*faces, face), 5u * 4);
    }
  EXPECT_EQ(found, 1);
  EXPECT_THROW(convertAndOpen(blocksInARow(6, 5, 4), {{1, 2, 4}}), Error);
  EXPECT_THROW(convertAndOpen(blocksInARow(6, 5, 4), {{2, 2, 0}}), Error);
}

/// A wing without thickness: the side k = 0 is folded onto itself.
TEST_F(GridFacesTest, ASideThatFoldsIsKeptAsAPlane) {
  const auto faces = convertAndOpen(FunctionGridSource({gridBlock(5, 9, 4)}, 2, [](const GridNode& node) {
    const double angle = 3.14159265358979 * (static_cast<double>(node.j) / 4 - 1);
    const double r = static_cast<double>(node.k);
    const double x = std::cos(angle) * (2 + r), y = r == 0 ? 0 : std::sin(angle) * r;
    return NodeValues{{x, y, static_cast<double>(node.i)}, {1, static_cast<float>(node.j)}, false};
  }));
  std::set<std::string> names;
  for (const GridFace& face : faces->faces())
    if (face.axis == 2)
      names.insert(face.side == FaceSide::kPlane ? "plane" : face.side == FaceSide::kMin ? "min" : "max");
  EXPECT_EQ(names, (std::set<std::string>{"max", "plane"}));
}

/// Positions and values of every patch are those of the grid's nodes; together the finest have every quad once, and
/// so has every coarser level.
TEST_F(GridFacesTest, EveryLevelHasTheGridsNodes) {
  constexpr uint64_t kI = 200, kJ = 90;
  const auto faces = convertAndOpen(FunctionGridSource({gridBlock(kI, kJ, 2)}, 2, bentNode));
  const double tolerance = 1e-6;
  std::map<std::array<uint32_t, 2>, uint64_t> quads;  // by stride, in finest quads
  for (uint32_t n = 0; n < faces->patches().size(); ++n) {
    const FacePatch& patch = faces->patches()[n];
    const GridFace& face = faces->faces()[patch.face];
    if (face.axis != 2 || face.side != FaceSide::kMin) continue;
    const PatchNodes nodes = faces->read(n);
    const bool coarse = patch.stride[0] > 1 || patch.stride[1] > 1;
    EXPECT_EQ(patch.child_count > 0, coarse);
    EXPECT_EQ(patch.error > 0, coarse);
    for (uint64_t v = 0; v < patch.nodes[1]; ++v)
      for (uint64_t u = 0; u < patch.nodes[0]; ++u) {
        const GridNode node{0, latticeIndex(face, patch, 0, u), latticeIndex(face, patch, 1, v), 0};
        const NodeValues truth = bentNode(node);
        const size_t at = v * patch.nodes[0] + u;
        ASSERT_LT(glm::distance(nodes.positions[at], truth.position), 200 * tolerance);
        ASSERT_NEAR(nodes.scalars[0][at], truth.scalars[0], 0.2);
        ASSERT_NEAR(nodes.scalars[1][at], truth.scalars[1], tolerance);
        if (u + 1 < patch.nodes[0] && v + 1 < patch.nodes[1])
          quads[patch.stride] +=
              (latticeIndex(face, patch, 0, u + 1) - node.i) * (latticeIndex(face, patch, 1, v + 1) - node.j);
      }
  }
  ASSERT_GE(quads.size(), 3u);
  for (const auto& [stride, count] : quads)
    EXPECT_EQ(count, (kI - 1) * (kJ - 1)) << stride[0] << ' ' << stride[1];
}

TEST_F(GridFacesTest, BytesDependOnTheGridAlone) {
  const FunctionGridSource source = blocksInARow(80, 70, 10);
  threads_ = 3;
  convertAndOpen(source);
  const std::string once = bytes();
  threads_ = 1;
  memory_ = 200 << 20;
  convertAndOpen(source);
  EXPECT_EQ(bytes(), once);
}

TEST(GridFacesOfBlock, AreFoundByItsNumber) {
  std::vector<GridFace> faces;
  for (const uint32_t block : {0u, 0u, 2u, 3u, 3u, 3u, 7u}) faces.emplace_back().block = block;
  const size_t first[] = {0, 2, 2, 3, 6, 6, 6, 6, 7}, count[] = {2, 0, 1, 3, 0, 0, 0, 1, 0};
  for (uint32_t block = 0; block < 9; ++block) {
    const std::span<const GridFace> found = facesOfBlock(faces, block);
    EXPECT_EQ(found.data() - faces.data(), static_cast<std::ptrdiff_t>(first[block])) << block;
    EXPECT_EQ(found.size(), count[block]) << block;
  }
}

/// A grid with boundary conditions.
class BoundedGrid : public GridSource {
 public:
  BoundedGrid(const GridSource& grid, std::vector<GridBoundary> boundaries)
      : grid_(grid), description_(grid.description()) {
    description_.boundaries = std::move(boundaries);
  }
  const GridDescription& description() const override { return description_; }
  void read(uint32_t block, const NodeBox& box, std::span<const uint32_t> scalars,
            NodeArrays& out) const override {
    grid_.read(block, box, scalars, out);
  }

 private:
  const GridSource& grid_;
  GridDescription description_;
};

// Every second quad of a face that another block closes.
TEST_F(GridFacesTest, QuadsOfVeryManyBoundariesAreDrawn) {
  constexpr uint64_t kSide = 120;
  std::vector<GridBoundary> boundaries;
  for (uint64_t k = 0; k < kSide; ++k)
    for (uint64_t j = k % 2; j < kSide; j += 2)
      boundaries.push_back({std::to_string(boundaries.size()), "BCWall", 1, {0, j, k}, {0, j + 1, k + 1}});
  boundaries.push_back({"whole", "BCWall", 0, {0, 0, 0}, {0, kSide, kSide}});
  boundaries.push_back({"inside", "BCWall", 0, {1, 0, 0}, {1, kSide, kSide}});
  const FunctionGridSource grid = blocksInARow(3, kSide + 1, kSide + 1);
  const auto faces = convertAndOpen(BoundedGrid(grid, boundaries));
  ASSERT_TRUE(faces);
  std::map<std::pair<uint32_t, FaceSide>, uint64_t> quads;
  for (const GridFace& face : faces->faces())
    if (face.axis == 0) quads[{face.block, face.side}] = quadsOf(*faces, face);
  const uint64_t all = kSide * kSide;
  EXPECT_EQ(quads,
            (decltype(quads){
                {{0, FaceSide::kMin}, all}, {{1, FaceSide::kMin}, all / 2}, {{1, FaceSide::kMax}, all}}));
  ASSERT_EQ(faces->regions().size(), all / 2 + 1);
  EXPECT_EQ(faces->regions()[0].name, "whole");
  for (size_t n = 0; n < all / 2; ++n) {
    const FaceRegion& region = faces->regions()[n + 1];
    const GridFace& face = faces->faces()[region.face];
    ASSERT_EQ(region.name, std::to_string(n));
    ASSERT_TRUE(face.block == 1 && face.axis == 0 && face.side == FaceSide::kMin);
    ASSERT_EQ(region.first, (std::array{boundaries[n].first[1], boundaries[n].first[2]}));
  }
}

TEST_F(GridFacesTest, ADamagedFileIsRefused) {
  convertAndOpen(blocksInARow(20, 30, 10));
  const std::string whole = bytes();
  const auto path = folder_ / "a.splats/faces.bin";
  const auto outcome = [&](const std::string& text) {
    writeFileAtomically(path, text);
    try {
      const auto faces = FacesReader::open(folder_ / "a.splats", manifest_);
      for (uint32_t n = 0; n < faces->patches().size(); ++n) faces->read(n);
      return false;
    } catch (const Error& error) {
      expectSays(error.what(), "faces.bin");
      return true;
    }
  };
  EXPECT_FALSE(outcome(whole));
  for (size_t length = 0; length < whole.size(); length += 97) EXPECT_TRUE(outcome(whole.substr(0, length)));
  int missed = 0;
  for (size_t at = 0; at < whole.size(); at += 61) {
    std::string flipped = whole;
    flipped[at] = static_cast<char>(flipped[at] ^ 0x10);
    missed += !outcome(flipped);
  }
  EXPECT_LT(missed, 70);  // zeros between streams are not read
}

}  // namespace
}  // namespace curvisplat
