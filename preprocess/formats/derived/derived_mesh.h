// Scalars that no file holds, for unstructured grids: those of flow_quantities.h that a sample's own density, velocity
// and pressure give. Those of gradients: preprocess/gather/gradient_mesh.h. The Jacobian and
// the volume of structured grids are not offered.
#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "preprocess/formats/derived/flow_inputs.h"
#include "preprocess/mesh/mesh_source.h"

namespace curvisplat {

class DerivedMeshSource final : public MeshSource {
 public:
  /// Throws UsageError if gamma or the gas constant is out of range.
  DerivedMeshSource(std::unique_ptr<MeshSource> source, const DerivedOptions& options);

  const GridDescription& description() const override { return description_; }
  void readPoints(uint32_t piece, uint64_t first, uint64_t count, std::span<const uint32_t> scalars,
                  MeshPoints& out) const override;
  void readCells(uint32_t piece, uint64_t first, uint64_t count, std::span<const uint32_t> scalars,
                 MeshCells& out) const override;
  void prepare(std::span<const uint32_t> scalars, uint64_t memory_bytes,
               const Progress& progress) const override {
    source_->prepare(neededFor(scalars), memory_bytes, progress);
  }

 private:
  /// The source's scalars that these are made of, each once.
  std::vector<uint32_t> neededFor(std::span<const uint32_t> scalars) const;
  /// The values of `scalars` from those of the source's scalars `read`, which they replace.
  void derive(std::span<const uint32_t> scalars, const std::vector<uint32_t>& read,
              std::vector<std::vector<float>>& values) const;

  std::unique_ptr<MeshSource> source_;
  GridDescription description_;
  PerfectGas gas_;
  std::optional<float> blank_value_;
  FlowInputs inputs_;
  std::vector<QuantityInfo> quantities_;  // of the derived scalars, in order
};

}  // namespace curvisplat
