// The nodes of some curved cells, with their values, and what Bezier's cells have instead of their control points.
#pragma once

#include <glm/vec3.hpp>

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "preprocess/mesh/mesh_source.h"

namespace curvisplat {

/// Nodes of a cell, in its order.
struct NodesOfCell {
  std::vector<glm::dvec3> places;
  std::vector<double> weights;  // of a rational cell; otherwise empty
  bool hidden = false;          // one of them is
  std::vector<double> values;   // [node][scalar]
};

/// The nodes of those of `cells` that are curved, read from the source in runs.
class CellNodes {
 public:
  /// `scalars`: at nodes. `rational`: the scalar with the weights of Bezier's control points.
  CellNodes(const MeshSource& source, uint32_t piece, const MeshCells& cells,
            std::span<const uint32_t> scalars, std::optional<uint32_t> rational);

  /// The nodes of one of these cells. A Bezier cell has points at the lattice of its parameters in their place.
  NodesOfCell of(CellKind shape, CellCurve curve, std::span<const uint64_t> nodes) const;

 private:
  static constexpr uint64_t kMaxGap = 512, kMaxRun = 65536;

  NodesOfCell asStored(std::span<const uint64_t> nodes) const;

  const size_t scalars_;
  const bool is_rational_;
  std::vector<uint64_t> numbers_;  // sorted
  std::vector<glm::dvec3> places_;
  std::vector<uint8_t> hidden_;
  std::vector<float> values_;  // [node][scalar, and the weight]
};

}  // namespace curvisplat
