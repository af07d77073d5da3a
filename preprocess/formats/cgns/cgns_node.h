// A node of a CGNS file, the shape of its data, and a box of an array: the types that the HDF5 and the ADF
// reader share.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

namespace curvisplat {

struct CgnsNode {
  std::string path;  // "/Base/Zone 1/GridCoordinates"; the root's is empty
  std::string name, label;
  bool linked = false;  // it or an ancestor is reached through a link, possibly in another file
};

/// The shape of a node's data: the type in CGNS notation ("R4", "I8", "C1"; "MT": no data), and the
/// dimensions, fastest first.
struct CgnsShape {
  std::string type;
  std::vector<uint64_t> dims;
  uint64_t count() const;
  bool real() const { return type == "R4" || type == "R8"; }
  bool number() const { return real() || type == "I4" || type == "I8"; }
};

/// A box of a three-dimensional array, and the layout of its destination in memory.
struct CgnsBox {
  std::array<uint64_t, 3> first{}, count{};  // in the array, from 0; count is not zero
  std::array<uint64_t, 2> memory{};          // elements along i and j of the destination array
};

}  // namespace curvisplat
