// Scalars that no file holds (flow_quantities.h): computed from density, momentum and energy (or velocity
// and pressure), or from the grid alone. Both classes decorate a source; derived scalars follow its own. Any
// number of threads may read.
#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "preprocess/formats/derived/flow_window.h"
#include "preprocess/grid/box_source.h"
#include "preprocess/mesh/forwarding_mesh.h"

namespace curvisplat {

/// Derived scalars of a structured grid.
///
///    source ──box + halo, in pieces──> flow at each sample ──gradients by the grid's Jacobian──> quantity
///
/// Differences are central, and one-sided at the ends of a block and next to blanked samples. Needs memory
/// for one piece of about 48,000 nodes for each reading thread, whatever the size of the request.
class DerivedSource final : public ForwardingGrid {
 public:
  /// Throws UsageError if gamma or the gas constant is out of range.
  DerivedSource(std::unique_ptr<GridSource> source, const DerivedOptions& options);

  void read(uint32_t block, const NodeBox& box, std::span<const uint32_t> scalars,
            NodeArrays& out) const override;

 private:
  std::vector<uint32_t> sourceScalars(std::span<const uint32_t> scalars) const override;
  void describe();
  bool offers(const QuantityInfo& quantity) const;

  PerfectGas gas_;
  std::optional<float> blank_value_;
  FlowInputs inputs_;
  std::vector<double> freestream_mach_;   // [block]; 0: unknown
  std::vector<QuantityInfo> quantities_;  // of the derived scalars, in order
};

/// Derived scalars of an unstructured grid: those that a sample's own density, velocity and pressure give.
/// Scalars of gradients need the neighbours of a cell: preprocess/gradients/gradient_mesh.h. The Jacobian
/// and the volume of structured grids are not offered. A mesh without any scalar gets one that is 1 in all cells,
/// and a warning; but not a mesh of SU2, whose scalars are in another file.
class DerivedMeshSource final : public ForwardingMesh {
 public:
  /// Throws UsageError if gamma or the gas constant is out of range.
  DerivedMeshSource(std::unique_ptr<MeshSource> source, const DerivedOptions& options);

  void readPoints(uint32_t piece, uint64_t first, uint64_t count, std::span<const uint32_t> scalars,
                  MeshPoints& out) const override;
  void readCells(uint32_t piece, uint64_t first, uint64_t count, std::span<const uint32_t> scalars,
                 MeshCells& out) const override;

 private:
  /// Each once.
  std::vector<uint32_t> sourceScalars(std::span<const uint32_t> scalars) const override;
  /// The values of `scalars` from those of the source's scalars `read`, which they replace.
  void derive(std::span<const uint32_t> scalars, const std::vector<uint32_t>& read,
              std::vector<std::vector<float>>& values) const;

  PerfectGas gas_;
  std::optional<float> blank_value_;
  FlowInputs inputs_;
  std::vector<QuantityInfo> quantities_;  // of the derived scalars, in order
  bool constant_ = false;                 // the only scalar is 1 in all cells
};

}  // namespace curvisplat
