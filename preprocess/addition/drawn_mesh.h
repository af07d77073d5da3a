// An unstructured grid restricted to the samples that a cache draws, whichever scalars are read from it now: cells
// without a splat in the cache, and points without one, are hidden. Points that are the same in several pieces
// (preprocess/gather/point_numbers.h) are drawn together.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <vector>

#include "preprocess/addition/drawn_nodes.h"
#include "preprocess/convert/memory_plan.h"
#include "preprocess/gather/point_numbers.h"
#include "preprocess/mesh/mesh_source.h"
#include "stream/base/progress.h"
#include "stream/cache/cache_reader.h"

namespace curvisplat {

class DrawnMesh final : public MeshSource {
 public:
  /// `source` must outlive it.
  explicit DrawnMesh(const MeshSource& source);

  /// Hides what `cache` has no splat of, too. Throws Error if a disk fails. Not while others read.
  void restrictTo(const CacheReader& cache, const MemoryPlan& plan,
                  const std::filesystem::path& temporary_folder, Progress& progress);

  bool restricted() const { return drawn_ != nullptr; }

  const GridDescription& description() const override { return source_->description(); }
  void readPoints(uint32_t piece, uint64_t first, uint64_t count, std::span<const uint32_t> scalars,
                  MeshPoints& out) const override;
  void readCells(uint32_t piece, uint64_t first, uint64_t count, std::span<const uint32_t> scalars,
                 MeshCells& out) const override;
  void prepare(std::span<const uint32_t> scalars, uint64_t memory_bytes,
               const Progress& progress) const override {
    source_->prepare(scalars, memory_bytes, progress);
  }

 private:
  const MeshSource* source_;
  std::vector<uint64_t> first_points_, first_cells_;  // [piece]
  bool of_cells_ = false;
  std::unique_ptr<PointNumbers> numbers_;
  std::unique_ptr<DrawnNodes> drawn_;
};

}  // namespace curvisplat
