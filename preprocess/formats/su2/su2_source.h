// SU2: its native mesh, with values from restart files.
#pragma once

#include <memory>
#include <vector>

#include "preprocess/formats/common/open_grid_options.h"
#include "preprocess/formats/su2/su2_mesh.h"
#include "preprocess/formats/su2/su2_restart.h"
#include "preprocess/mesh/mesh_source.h"
#include "stream/base/file.h"

namespace curvisplat {

/// Whether the text begins with one of SU2's keys.
bool isSu2(const InputFile& file);
/// Of such a file, as its first key says: 1 without NZONE.
uint64_t su2Zones(const InputFile& file);

/// Zones are pieces. options.solutions: restart files of the one zone, or one for each zone, in their order.
class Su2Source final : public MeshSource {
 public:
  /// Spools the mesh, and restart files that are text. Throws Error.
  explicit Su2Source(const OpenGridOptions& options);

  const GridDescription& description() const override { return description_; }
  void readPoints(uint32_t piece, uint64_t first, uint64_t count, std::span<const uint32_t> scalars,
                  MeshPoints& out) const override;
  void readCells(uint32_t piece, uint64_t first, uint64_t count, std::span<const uint32_t> scalars,
                 MeshCells& out) const override;

 private:
  /// A variable of each piece's file.
  struct Variable {
    std::vector<std::pair<size_t, size_t>> of_piece;  // restart file, variable
  };

  void openRestarts(const OpenGridOptions& options);

  std::vector<Su2Zone> zones_;
  std::vector<Su2Restart> restarts_;
  std::vector<Variable> variables_;  // [description_.scalars]
  GridDescription description_;
};

}  // namespace curvisplat
