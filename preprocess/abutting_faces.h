// Where the cells of one block's end abut on those of another's, or of the same block's other end: there the
// data goes on, and the cells have no border. For cell-centred data, whose cells are not merged at seams.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <glm/vec3.hpp>
#include <span>
#include <vector>

#include "preprocess/grid_source.h"
#include "preprocess/hexahedron.h"
#include "preprocess/seams.h"

namespace curvisplat {

/// A cell of a block, by its lowest node, and one of its six faces.
struct CellFace {
  size_t block = 0;
  std::array<uint64_t, 3> cell{};  // i, j, k
  int axis = 0;
  bool upper = false;
};

/// Two faces abut if their centres coincide, by SeamMerger's measure of what coincides: that blocks share
/// their nodes is taken for granted. A face that has collapsed to an edge (an axis) or a point abuts on those
/// around it. Memory: a bit a face at the blocks' ends, and the sorter's while they are being added.
class AbuttingFaces {
 public:
  /// As for SeamMerger.
  AbuttingFaces(std::span<const GridBlock> blocks, uint64_t memory_bytes,
                std::filesystem::path temporary_folder);

  /// Whether the face is one at the end of its block.
  bool isAtEnd(const CellFace& face) const;
  /// A face at its block's end, of a cell that is there. One thread at a time. Throws Error if the disk
  /// fails.
  void add(const CellFace& face, const std::array<glm::dvec3, 8>& corners);
  /// After the last add(): finds those that abut. Throws Error if the disk fails.
  void match(int coordinate_bytes);
  /// Of a face at its block's end, after match(). Any thread.
  bool abuts(const CellFace& face) const { return abutting_[numberOf(face)]; }

 private:
  uint64_t numberOf(const CellFace& face) const;

  struct Block {
    std::array<uint64_t, 3> cells;
    uint64_t first_face;
  };
  std::vector<Block> blocks_;
  SeamMerger centres_;
  std::vector<bool> abutting_;  // [face at a block's end]
};

}  // namespace curvisplat
