// SU2 as a MeshSource: its native mesh (su2_mesh.h), with values from restart files. The mesh, and restart
// files that are text, are spooled when they are opened; binary restart files are read by position. Any
// number of threads may read.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "preprocess/formats/common/byte_source.h"
#include "preprocess/formats/common/open_grid_options.h"
#include "preprocess/formats/common/spool_file.h"
#include "preprocess/formats/su2/su2_mesh.h"
#include "preprocess/mesh/mesh_source.h"
#include "stream/base/file.h"

namespace curvisplat {

/// A restart or solution file: values at the points of a mesh, in their order. Any number of threads may
/// read.
///
///    ASCII     "PointID","x","y","z","Density",...       one line a point; commas (.csv) or tabs (.dat)
///    binary    int32: 535532, variables, points, ., .    names of 33 bytes; doubles, point by point
class Su2Restart {
 public:
  /// An ASCII file goes to a spool file. Throws Error if it is damaged, or does not have `points` points.
  Su2Restart(std::shared_ptr<const PooledFile> file, uint64_t points,
             const std::shared_ptr<SpoolFile>& spool);

  /// The names of the file's variables, without the point's number and position.
  const std::vector<std::string>& names() const { return names_; }
  bool binary() const { return binary_; }
  /// Values of points [first, first + to.size()).
  void read(size_t variable, uint64_t first, std::span<float> to) const;

 private:
  void openBinary(uint64_t points);
  void readText(uint64_t points, const std::shared_ptr<SpoolFile>& spool);
  void keepNames(const std::vector<std::string>& all);

  std::shared_ptr<const PooledFile> file_;
  bool binary_ = false, swap_ = false;
  uint64_t data_ = 0;  // offset of the doubles of a binary file
  size_t stride_ = 0;  // doubles a point
  std::vector<std::string> names_;
  std::vector<size_t> columns_;  // [names_]
  SpooledNumbers text_;
};

/// Whether the text begins with one of SU2's keys.
bool isSu2(const InputFile& file);
/// The number of zones of such a file, as its first key says: 1 without NZONE.
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
