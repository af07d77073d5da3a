// Scalars of an unstructured grid that need gradients: the vorticity's magnitude, the Q criterion, swirl and
// the magnitude of the pressure's gradient (flow_quantities.h). Decorates a source; these scalars follow its
// own.
//
//    cells with their corners' velocity and pressure --> sums of dual cells, or neighbours --> gradients
//                                  --> quantity --> a temporary file, by sample --> whoever reads the scalar
//
// A gradient is the one that a splat has (preprocess/moments/mesh_splats.h): of a point by regression over
// its dual cell, of a cell by least squares over its neighbours. It is computed for the whole mesh, once, by
// prepare(), which must come before such a scalar is read. NaN where it is undefined: at blanked samples,
// and at points that no cell has.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "preprocess/formats/derived/flow_window.h"
#include "preprocess/mesh/forwarding_mesh.h"
#include "preprocess/mesh/mesh_source.h"
#include "stream/base/mutex.h"
#include "stream/base/temporary_files.h"

namespace curvisplat {

class GradientMesh final : public ForwardingMesh {
 public:
  /// `folder`: for temporary files, without a name once they are open. Throws UsageError if gamma or the gas
  /// constant is out of range.
  GradientMesh(std::unique_ptr<MeshSource> source, const DerivedOptions& options,
               std::filesystem::path folder);
  ~GradientMesh() override;

  void readPoints(uint32_t piece, uint64_t first, uint64_t count, std::span<const uint32_t> scalars,
                  MeshPoints& out) const override;
  void readCells(uint32_t piece, uint64_t first, uint64_t count, std::span<const uint32_t> scalars,
                 MeshCells& out) const override;
  /// Reads the mesh once for each of these scalars that has gradients and is not known yet.
  void prepare(std::span<const uint32_t> scalars, uint64_t memory_bytes,
               const Progress& progress) const override;
  Preparation preparationFor(std::span<const uint32_t> scalars) const override;
  uint64_t preparedBytes() const override { return scratch_.mostBytes(); }

 private:
  class Values;
  /// The source's scalars among `scalars`.
  std::vector<uint32_t> sourceScalars(std::span<const uint32_t> scalars) const override;
  /// Puts the gradients' quantities where `scalars` has them; `first`: of the samples in the whole mesh.
  void insert(std::span<const uint32_t> scalars, uint64_t first, uint64_t count,
              std::vector<std::vector<float>>& values) const;
  const Values& valuesOf(uint32_t quantity) const;
  std::unique_ptr<Values> compute(const QuantityInfo& quantity, uint64_t memory_bytes,
                                  const Progress& progress) const REQUIRES(mutex_);

  PerfectGas gas_;
  FlowInputs inputs_;
  std::optional<float> blank_value_;
  const ScratchFiles scratch_;
  std::vector<QuantityInfo> quantities_;
  std::vector<uint64_t> first_points_, first_cells_;  // [piece]
  mutable Mutex mutex_;
  mutable std::map<uint32_t, std::unique_ptr<Values>> values_ GUARDED_BY(mutex_);
  mutable std::optional<uint64_t> chunk_bytes_ GUARDED_BY(mutex_);  // of the largest chunk; once computed
};

}  // namespace curvisplat
