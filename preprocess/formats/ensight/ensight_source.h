// EnSight Gold cases: unstructured parts as the pieces of a mesh, structured parts as the blocks of a grid.
#pragma once

#include <memory>
#include <vector>

#include "preprocess/formats/common/open_grid_options.h"
#include "preprocess/formats/ensight/ensight_case.h"
#include "preprocess/formats/ensight/ensight_parts.h"
#include "preprocess/mesh/mesh_source.h"

namespace curvisplat {

/// The files of a case, and its parts of one kind. Any number of threads may read.
class EnsightData {
 public:
  explicit EnsightData(const OpenGridOptions& options);

  bool structured() const { return structured_; }
  const std::vector<EnsightPart>& parts() const { return geometry_.parts; }
  bool hasCurvedCells() const { return has_curved_cells_; }
  /// Blocks or pieces, and scalars: variable NAME; vectors NAME:mag, NAME:x, NAME:y, NAME:z.
  const GridDescription& description() const { return description_; }
  /// Values [first, first + to.size()) of a scalar in list `list` of a part, which has `count` values of each
  /// component. NaN where there are none.
  void readValues(uint32_t scalar, size_t part, size_t list, uint64_t first, uint64_t count,
                  std::span<float> to) const;

 private:
  void chooseParts();
  void describeParts();
  void addScalars(const std::vector<EnsightVariable>& variables);
  void describeUndefined(const std::string& name, const std::vector<EnsightValues>& parts);

  struct Scalar {
    size_t variable = 0;
    int component = 0;  // -1: the magnitude
  };
  EnsightGeometry geometry_;
  bool structured_ = false, has_curved_cells_ = false;
  std::vector<std::vector<EnsightValues>> values_;  // [variable][part]
  std::vector<Scalar> scalars_;
  GridDescription description_;
};

class EnsightMeshSource final : public MeshSource {
 public:
  explicit EnsightMeshSource(EnsightData data) : data_(std::move(data)) {}
  const GridDescription& description() const override { return data_.description(); }
  bool hasCurvedCells() const override { return data_.hasCurvedCells(); }
  void readPoints(uint32_t piece, uint64_t first, uint64_t count, std::span<const uint32_t> scalars,
                  MeshPoints& out) const override;
  void readCells(uint32_t piece, uint64_t first, uint64_t count, std::span<const uint32_t> scalars,
                 MeshCells& out) const override;

 private:
  EnsightData data_;
};

class EnsightGridSource final : public GridSource {
 public:
  explicit EnsightGridSource(EnsightData data) : data_(std::move(data)) {}
  const GridDescription& description() const override { return data_.description(); }
  void read(uint32_t block, const NodeBox& box, std::span<const uint32_t> scalars,
            NodeArrays& out) const override;
  void readPartOfRows(uint32_t block, const NodeBox& box, std::span<const uint32_t> scalars,
                      NodeArrays& out) const override {
    read(block, box, scalars, out);
  }
  uint64_t rowsInMemory(std::span<const uint32_t> /*scalars*/) const override { return 0; }

 private:
  EnsightData data_;
};

/// Structured parts where there are any, or unstructured ones. Throws Error.
std::unique_ptr<DataSource> openEnsight(const OpenGridOptions& options);

}  // namespace curvisplat
