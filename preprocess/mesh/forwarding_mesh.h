// ForwardingMesh, the base of meshes that change what another source reads.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <utility>
#include <vector>

#include "preprocess/mesh/mesh_source.h"

namespace curvisplat {

/// A mesh that is read from another one. It passes everything on: a subclass overrides what it changes, and
/// nothing that it does not mention (the preparation of scalars) is lost.
class ForwardingMesh : public MeshSource {
 public:
  const GridDescription& description() const override { return description_; }
  void readPoints(uint32_t piece, uint64_t first, uint64_t count, std::span<const uint32_t> scalars,
                  MeshPoints& out) const override {
    source_->readPoints(piece, first, count, scalars, out);
  }
  void readCells(uint32_t piece, uint64_t first, uint64_t count, std::span<const uint32_t> scalars,
                 MeshCells& out) const override {
    source_->readCells(piece, first, count, scalars, out);
  }
  bool hasCurvedCells() const override { return source_->hasCurvedCells(); }
  void prepare(std::span<const uint32_t> scalars, uint64_t memory_bytes,
               const Progress& progress) const override {
    source_->prepare(sourceScalars(scalars), memory_bytes, progress);
  }
  Preparation preparationFor(std::span<const uint32_t> scalars) const override {
    return source_->preparationFor(sourceScalars(scalars));
  }
  uint64_t preparedBytes() const override { return source_->preparedBytes(); }

 protected:
  explicit ForwardingMesh(std::shared_ptr<const MeshSource> source)
      : description_(source->description()), source_(std::move(source)) {}
  /// `source` must outlive it.
  explicit ForwardingMesh(const MeshSource& source)
      : ForwardingMesh(std::shared_ptr<const MeshSource>(std::shared_ptr<const void>(), &source)) {}

  /// The scalars of the source that these are read or computed from.
  virtual std::vector<uint32_t> sourceScalars(std::span<const uint32_t> scalars) const {
    return {scalars.begin(), scalars.end()};
  }
  const MeshSource& source() const { return *source_; }

  GridDescription description_;  // the source's, unless the subclass changes it

 private:
  std::shared_ptr<const MeshSource> source_;
};

}  // namespace curvisplat
