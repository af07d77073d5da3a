// Finds where the cells at the end of a block abut on cells of another block, or of the same block's other
// end: there the data continues and the cells have no border. For cell-centred data, which has no seams.
#pragma once

#include <glm/vec3.hpp>

#include <array>
#include <cstdint>
#include <filesystem>
#include <span>
#include <vector>

#include "preprocess/coincidence/coincidence_sweep.h"
#include "preprocess/coincidence/record_sorter.h"
#include "preprocess/grid/grid_source.h"
#include "stream/base/progress.h"

namespace curvisplat {

/// A cell of a block, by its lowest node, and one of its six faces.
struct CellFace {
  size_t block = 0;
  std::array<uint64_t, 3> cell{};  // i, j, k
  int axis = 0;
  bool upper = false;
};

/// Two faces at blocks' ends abut if their centres coincide, by CoincidenceSweep's tolerance; on which side
/// of them the cells lie does not matter. A face that has collapsed to an edge (at an axis) or to a point is
/// no border either. Not found are abutting faces of different sizes, and faces beside a blanked cell in
/// whose place another block has a cell.
class AbuttingFaces {
 public:
  /// Memory and disk space for the faces at the ends of a grid's blocks.
  struct Needs {
    uint64_t memory_bytes = 0;  // as long as it lives
    uint64_t disk_bytes = 0;    // until match() returns, at the most
  };
  static Needs needsOf(std::span<const GridBlock> blocks);

  /// Sorts in `memory_bytes`, beside its Needs. `coordinate_bytes`: of the grid's, as
  /// stored.
  AbuttingFaces(std::span<const GridBlock> blocks, int coordinate_bytes, uint64_t memory_bytes,
                std::filesystem::path temporary_folder);

  /// Whether the face is one at the end of its block. Any thread.
  bool isAtEnd(const CellFace& face) const;

  struct Centre {
    uint64_t face = 0;  // its number
    glm::dvec3 at{0.0};
    double spacing = 0;  // to other faces' centres, at least
    bool collapsed = false;
  };
  /// The centre of a face at its block's end; `corners` of its cell, as Hexahedron takes them. Any thread.
  Centre centreOf(const CellFace& face, const std::array<glm::dvec3, 8>& corners) const;

  /// Has match() note which faces fold(). Call it before match(). Takes its Needs' memory once more.
  void keepFolds() { folded_.resize(abutting_.size()); }

  /// Faces of cells that are not blanked. One thread at a time. Throws Error if the disk fails.
  void add(std::span<const Centre> centres);
  /// Finds the faces that abut, after the last add(). Throws Error if the disk fails, Interrupted if a stop
  /// is asked for.
  void match(const Progress& progress);
  /// Whether a face at its block's end abuts on another, after match(). Any thread.
  bool abuts(const CellFace& face) const { return abutting_[numberOf(face)]; }
  /// Answers for a face by its number.
  bool abuts(uint64_t face) const { return abutting_[face]; }
  /// Whether the side of a block that has the face abuts on itself there: a cut behind a body, or a body
  /// without thickness. After keepFolds() and match(). Any thread.
  bool folds(const CellFace& face) const { return folded_[numberOf(face)]; }

 private:
  uint64_t numberOf(const CellFace& face) const;
  void noteSet(std::span<const uint64_t> faces);

  struct Block {
    std::array<uint64_t, 3> cells;
    std::array<uint64_t, 3> first_face;  // of an axis' lower side; those of its upper side follow
  };
  std::vector<Block> blocks_;
  int coordinate_bytes_;
  RecordSorter centres_;
  LargestReach reach_;                   // of the centres
  std::vector<bool> abutting_, folded_;  // [face at a block's end]
  std::vector<uint64_t> sides_;          // the first face of every side
};

}  // namespace curvisplat
