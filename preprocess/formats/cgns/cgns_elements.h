// The element sections (Elements_t) of an unstructured CGNS zone: their lists of integers, read in ranges.
//
//    fixed kinds      connectivity: the nodes of each element
//    MIXED            connectivity: of each element its type and its nodes
//    NGON_n           connectivity: the nodes of each face; ParentElements: the cells on its two sides
//    NFACE_n          connectivity: the faces of each cell, negative where they are turned round
//
// ElementStartOffset says where each element of the last three begins. Files of CGNS before 3.4 lack it, and the
// elements of NGON_n and NFACE_n begin with their length: such sections are passed through a spool file once.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "preprocess/formats/cgns/cgns_file.h"
#include "preprocess/formats/common/spool_file.h"
#include "preprocess/mesh/mesh_source.h"

namespace curvisplat {

/// A list of integers in the file, or in a spool file. Integers that a double does not hold become -2^63.
struct CgnsIntegers {
  std::function<void(uint64_t first, std::span<int64_t> to)> read;
  uint64_t count = 0;
};

/// ElementType_t of cgnslib.h.
enum CgnsElementType : int { kCgnsMixed = 20, kCgnsNgon = 22, kCgnsNface = 23 };

struct CgnsElementKind {
  CellKind cell = CellKind::kNone;  // kNone: nodes, lines and faces
  uint32_t nodes = 0;               // 0: of any number, or an unknown type
};
/// `version`: of the library that wrote the file. Version 3.0 counted PYRA_13 between PYRA_5 and PYRA_14, 3.1 moved it behind MIXED;
/// up to 3.1 a polygon among MIXED elements had the type NGON_n and the number of its nodes in one number.
CgnsElementKind cgnsElementKind(int64_t type, double version);

/// A version since which the numbers of types have not changed; of files that do not tell theirs.
inline constexpr double kNewestCgns = 4;

struct CgnsSection {
  std::string path;
  int type = 0;  // as CGNS numbers them since 3.1
  double version = 0;
  CgnsElementKind kind() const { return cgnsElementKind(type, kNewestCgns); }
  CgnsElementKind kindOf(int64_t of_mixed) const { return cgnsElementKind(of_mixed, version); }
  uint64_t first = 0, elements = 0;  // numbers of elements begin at 1 in their zone
  CgnsIntegers connectivity;
  CgnsIntegers begins;  // of MIXED, NGON_n and NFACE_n: [elements + 1]
  CgnsIntegers
      parents;  // of NGON_n: first one side of all faces, then the other; none if there is no such node
};

/// Reads the sections, in the order of their elements. `file` must outlive them; spooled lists go to
/// `spools`. Throws Error if a section is damaged, or of a type that CGNS does not have.
std::vector<CgnsSection> readCgnsSections(const CgnsFile& file, const std::vector<CgnsNode>& nodes,
                                          const ListSpools& spools);

}  // namespace curvisplat
