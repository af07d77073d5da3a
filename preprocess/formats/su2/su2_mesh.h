// SU2's native mesh (.su2), a text:
//
//    NDIME= 3
//    NELEM= 1
//    10 0 1 2 3 0          VTK's type of the cell, its points from 0, and often its number
//    NPOIN= 4
//    0.0 0.0 0.0 0         x, y, z, and often its number
//    NMARK= 1              boundaries: MARKER_TAG=, MARKER_ELEMS=, their faces
//
// Several zones (NZONE=, IZONE=) follow one another. `%` begins a comment. Numbers in text have no fixed
// position, so that each zone is spooled when the file is opened: 24 bytes a point, and for each cell 16
// bytes and 8 for each of its corners. Then any number of threads may read it.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "preprocess/formats/common/block_source.h"
#include "preprocess/formats/common/byte_source.h"
#include "preprocess/formats/common/spool_file.h"
#include "preprocess/mesh/mesh_source.h"

namespace curvisplat {

/// A mesh in spool files. Any number of threads may read.
struct SpooledMesh {
  SpooledNumbers positions;  // x, y, z of each point
  SpooledNumbers begins;     // where each cell begins among the words, and the end of the last
  /// Each cell's CellKind and its corners, or its faces as appendPolyhedron() takes them.
  SpooledNumbers words;

  uint64_t points() const { return positions.count / 3; }
  uint64_t cells() const { return begins.count > 0 ? begins.count - 1 : 0; }
  void readPoints(uint64_t first, uint64_t count, const Places& to) const;
  /// Cells without scalars. A polyhedron whose faces do not add up becomes kNone.
  void appendCells(uint64_t first, uint64_t count, MeshCells& out) const;
};

/// The spool files that the meshes of all zones share.
struct MeshSpools {
  explicit MeshSpools(const std::filesystem::path& folder)
      : positions(std::make_shared<SpoolFile>(folder)),
        begins(std::make_shared<SpoolFile>(folder)),
        words(std::make_shared<SpoolFile>(folder)) {}

  std::shared_ptr<SpoolFile> positions, begins, words;
};

/// Writes a SpooledMesh point by point and cell by cell. For one thread; one mesh is written at a time.
class SpooledMeshWriter {
 public:
  explicit SpooledMeshWriter(const MeshSpools& spools)
      : positions_(spools.positions), begins_(spools.begins), words_(spools.words) {}

  void addPoint(double x, double y, double z);
  void addCell(CellKind kind, std::span<const uint64_t> corners);
  /// `stream` has for each face the number of its points and the points.
  void addPolyhedron(uint64_t faces, std::span<const uint64_t> stream);
  uint64_t points() const { return positions_.size() / 3; }
  uint64_t cells() const { return begins_.size(); }
  SpooledMesh finish();

 private:
  NumberSpool<double> positions_;
  NumberSpool<uint64_t> begins_, words_;
};

/// A zone of the file.
struct Su2Zone {
  SpooledMesh mesh;
  std::vector<std::string> markers;  // of its boundaries
};

/// Reads all zones in one pass through the file. Throws Error with the line if it is damaged, or if the mesh
/// does not have three dimensions.
std::vector<Su2Zone> readSu2Mesh(const std::shared_ptr<const PooledFile>& file,
                                 const std::filesystem::path& folder);

}  // namespace curvisplat
