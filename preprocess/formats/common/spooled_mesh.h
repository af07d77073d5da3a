// A piece of an unstructured grid in spool files, for formats whose numbers have no fixed position: 24 bytes a point, and
// for each cell 16 bytes and 8 for each of its corners.
#pragma once

#include <cstdint>
#include <filesystem>
#include <span>

#include "preprocess/formats/common/spooled_numbers.h"
#include "preprocess/mesh/mesh_source.h"

namespace curvisplat {

/// Any number of threads may read.
struct SpooledMesh {
  SpooledNumbers positions;  // x, y, z of each point
  SpooledNumbers begins;     // where each cell begins among the words, and the end of the last
  SpooledNumbers
      words;  // of each cell its CellKind and its corners, or its faces as appendPolyhedron() takes them

  uint64_t points() const { return positions.count / 3; }
  uint64_t cells() const { return begins.count > 0 ? begins.count - 1 : 0; }
  /// Positions; nothing is hidden.
  void readPoints(uint64_t first, uint64_t count, MeshPoints& out) const;
  /// Cells, and no scalars. Clears `out`. A polyhedron whose faces do not add up becomes kNone.
  void readCells(uint64_t first, uint64_t count, MeshCells& out) const;
};

/// For one thread.
class SpooledMeshWriter {
 public:
  explicit SpooledMeshWriter(const std::filesystem::path& folder)
      : positions_(folder), begins_(folder), words_(folder) {}

  void addPoint(double x, double y, double z);
  void addCell(CellKind kind, std::span<const uint64_t> corners);
  /// `stream`: of each face the number of its points and the points.
  void addPolyhedron(uint64_t faces, std::span<const uint64_t> stream);
  uint64_t points() const { return positions_.size() / 3; }
  uint64_t cells() const { return begins_.size(); }
  SpooledMesh finish();

 private:
  NumberSpool<double> positions_;
  NumberSpool<uint64_t> begins_, words_;
};

}  // namespace curvisplat
