// Blocks of a few nodes, whose splats are merged along their faces.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <glm/geometric.hpp>
#include <map>
#include <span>
#include <vector>

#include "preprocess/seams/seams.h"
#include "tests/reference/mapped_block.h"
#include "tests/support/temporary_folder.h"

namespace curvisplat {

struct Piece {
  NodeSplat node;
  SplatScalar value;
};

/// One at a time, as a thread with little to do adds them.
inline void addEach(SeamMerger& seams, const std::vector<Piece>& faces) {
  for (const Piece& face : faces) {
    NodeSplats one;
    one.splats = {face.node};
    one.values = {face.value};
    std::vector<double> records;
    seams.pack(one, records);
    seams.add(records);
  }
}

class MergedSeams : public testing::Test {
 protected:
  std::vector<Piece> merge(const std::vector<Piece>& faces, uint64_t memory_bytes = 64 << 20,
                           int coordinate_bytes = 8, UnlikeHalves unlike = UnlikeHalves::kApart) {
    SeamMerger seams(1, memory_bytes, folder_.path(), unlike);
    addEach(seams, faces);
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
      std::vector<double> records;
      seams.pack(splats, records);
      seams.add(records);
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

inline double field(const glm::dvec3& p) {
  return 1 + p.x - 2 * p.y + 0.5 * p.z;
}

/// The splats of block faces, out of all.
inline std::vector<Piece> facesOf(const MappedBlock& block) {
  const NodeSplats splats = block.splats();
  std::vector<Piece> faces;
  for (size_t n = 0; n < splats.splats.size(); ++n)
    if (splats.splats[n].on_block_face) faces.push_back({splats.splats[n], splats.values[n]});
  return faces;
}

/// Nodes of a block whose cells are `size` wide along each axis, from `first` on.
inline MappedBlock boxBlock(const glm::dvec3& first, const glm::dvec3& size, uint64_t first_node) {
  MappedBlock block(4, 4, 4,
                    [&](double i, double j, double k) { return first + size * glm::dvec3(i, j, k); });
  block.addScalar(field);
  block.first_node = first_node;
  return block;
}

/// The pieces at a point, of blocks merged along their faces.
inline std::vector<Piece> piecesAt(const std::vector<Piece>& pieces, const glm::dvec3& point) {
  std::vector<Piece> there;
  for (const Piece& piece : pieces)
    if (glm::distance(piece.node.node_position, point) < 1e-9) there.push_back(piece);
  return there;
}

}  // namespace curvisplat
