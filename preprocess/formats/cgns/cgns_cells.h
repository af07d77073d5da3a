// The cells of an unstructured CGNS zone: the solid elements of its sections, in the order of their numbers.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "preprocess/formats/cgns/cgns_elements.h"
#include "preprocess/formats/cgns/cgns_tree.h"
#include "preprocess/formats/common/cells_of_faces.h"

namespace curvisplat {

/// Any number of threads may read.
class CgnsCells {
 public:
  /// Reads the types of all elements of MIXED sections. `file` must outlive it. Throws Error if the zone is
  /// damaged.
  CgnsCells(const CgnsFile& file, const CgnsZone& zone, const ListSpools& spools);

  uint64_t cells() const { return cells_; }
  /// Numbers of cells, and of those above order 1; `others`: elements of MIXED sections that are not solid.
  struct Counts {
    uint64_t solid = 0, curved = 0, others = 0;
  };
  const Counts& counts() const { return counts_; }

  /// Cells [first, first + count). `out` is cleared.
  void read(uint64_t first, uint64_t count, MeshCells& out) const;

 private:
  /// The cells of a section; or, without a section, those that only the faces name (ParentElements).
  struct Run {
    const CgnsSection* section = nullptr;
    uint64_t first = 0, cells = 0;  // in the zone
  };

  std::string label() const;
  void countCells(const CgnsSection& section);
  void findCellsOfFaces(const ListSpools& spools);
  uint64_t faceOf(int64_t element) const;
  void readFaceBegins(uint64_t first, std::span<uint64_t> to) const;
  void readFacePoints(uint64_t first, std::span<uint64_t> to) const;
  FaceLists faceLists() const;
  void readFixed(const CgnsSection& section, uint64_t first, uint64_t count, MeshCells& out) const;
  void readMixed(const CgnsSection& section, uint64_t first, uint64_t count, MeshCells& out) const;
  void readNface(const CgnsSection& section, uint64_t first, uint64_t count, MeshCells& out) const;
  void readBySides(uint64_t first, uint64_t count, MeshCells& out) const;

  std::string file_, zone_;
  std::vector<CgnsSection> sections_;
  std::vector<Run> runs_;
  std::vector<const CgnsSection*> faces_;           // NGON_n
  std::vector<uint64_t> first_face_, first_point_;  // of each of faces_, and behind the last
  std::optional<CellFaces> by_sides_;               // without NFACE_n
  uint64_t cells_ = 0;
  Counts counts_;
};

}  // namespace curvisplat
