// Parts of a structured CGNS zone that its file states as ranges or lists of points: boundary conditions
// (BC_t), and what the zone's overset grid leaves out (OversetHoles_t). Indices in the file count from 1;
// those here count from 0 and lie in the zone. Any number of threads may call cgnsBoundary() and the const
// functions of CgnsHoles.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "preprocess/formats/cgns/cgns_file.h"
#include "preprocess/grid/grid_source.h"
#include "preprocess/grid/slabs.h"

namespace curvisplat {

/// The nodes of a boundary condition. `details` are the children of the BC_t node, `nodes` is the zone's
/// size. nullopt if it is not a part of one of the zone's faces: a list of points, or a range that does not
/// fit. The name and the type are not set. Throws Error if the file cannot be read.
std::optional<GridBoundary> cgnsBoundary(const CgnsFile& file, const std::vector<CgnsNode>& details,
                                         const std::array<uint64_t, 3>& nodes);

/// The parts of a zone that its overset grid leaves out, as boxes of nodes or of cells. A list of points
/// becomes runs along i.
class CgnsHoles {
 public:
  /// Adds those of an OversetHoles_t node of a zone of `nodes`. Throws Error if they do not lie in the zone,
  /// or if a list has more than 1.4 million points.
  void add(const CgnsFile& file, const CgnsNode& holes, const std::array<uint64_t, 3>& nodes);

  bool empty() const { return nodes_.empty() && cells_.empty(); }

  /// Blanks the nodes of `box` in holes of nodes, and those all of whose cells are in holes of cells.
  /// `nodes`: of the zone.
  void blankNodes(const std::array<uint64_t, 3>& nodes, const NodeBox& box,
                  std::vector<uint8_t>& blank) const;
  /// Makes the values of cells in holes of cells NaN. `values`: as NodeArrays has those of cells.
  void blankCells(const std::array<uint64_t, 3>& nodes, const NodeBox& box, std::vector<float>& values) const;

 private:
  struct Hole {
    std::array<uint64_t, 3> first{}, last{};  // i, j, k from 0; the last is included
  };
  using Holes = std::vector<Hole>;

  static void addRange(const std::vector<double>& ends, const std::array<uint64_t, 3>& counts, Holes& to);
  static void addList(const std::vector<double>& points, const std::array<uint64_t, 3>& counts, Holes& to);
  /// Calls `use` with the index of each sample of `box` that is in a hole; some more than once.
  template <typename Use>
  static void forEachIn(const Holes& holes, const WindowStrides& strides, const NodeBox& box, const Use& use);

  Holes nodes_, cells_;
};

}  // namespace curvisplat
