// The unstructured zones of a CGNS file as a MeshSource: a piece each, with the fields of their vertex and
// cell-centred solutions at one time step as scalars (those of cgns_source.h).
#pragma once

#include <filesystem>
#include <memory>
#include <vector>

#include "preprocess/formats/cgns/cgns_cells.h"
#include "preprocess/formats/cgns/cgns_description.h"
#include "preprocess/formats/cgns/cgns_file.h"
#include "preprocess/mesh/mesh_source.h"

namespace curvisplat {

class CgnsMeshSource final : public MeshSource {
 public:
  /// Throws Error if a zone is damaged or if none has a solid element.
  CgnsMeshSource(std::shared_ptr<const CgnsFile> file, CgnsTree tree, uint32_t time_step,
                 const std::filesystem::path& folder);

  const GridDescription& description() const override { return description_; }
  void readPoints(uint32_t piece, uint64_t first, uint64_t count, std::span<const uint32_t> scalars,
                  MeshPoints& out) const override;
  void readCells(uint32_t piece, uint64_t first, uint64_t count, std::span<const uint32_t> scalars,
                 MeshCells& out) const override;

 private:
  void dropFieldsOfCells(size_t zone);
  void warnOfKinds();
  void readScalars(uint32_t piece, uint64_t first, uint64_t count, std::span<const uint32_t> scalars,
                   std::vector<std::vector<float>>& out) const;

  std::shared_ptr<const CgnsFile> file_;
  CgnsTree tree_;
  std::vector<CgnsCells> cells_;  // [zone]
  GridDescription description_;
  std::vector<std::vector<CgnsArrays>> arrays_;  // [scalar][zone]
};

}  // namespace curvisplat
