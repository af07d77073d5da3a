// The polyhedra of a zone of Tecplot: sorted by element from its faces. Nothing grows with the zone but what is on disk.
#pragma once

#include <cstdint>
#include <string>

#include "preprocess/formats/common/cells_of_faces.h"
#include "preprocess/formats/common/spool_file.h"
#include "preprocess/formats/tecplot/tecplot_data.h"
#include "preprocess/mesh/mesh_source.h"

namespace curvisplat {

class TecplotPolyhedra {
 public:
  /// `zone` must outlive the object. `where`: for messages. Throws Error.
  TecplotPolyhedra(const TecplotZone& zone, std::string where, const ListSpools& spools);

  /// Appends the elements [first, first + count). Any number of threads. Throws Error.
  void append(uint64_t first, uint64_t count, MeshCells& out) const;

 private:
  SpooledNumbers beginsOf(const ListSpools& spools) const;
  double lastElement() const;

  const TecplotZone& zone_;
  const std::string where_;
  SpooledNumbers begins_;  // of the corners of each face, and the end of the last
  CellFaces cells_;
};

}  // namespace curvisplat
