// A node of a CGNS file, the shape of its data, and a box of an array: the types that the HDF5 and the ADF
// reader share.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "preprocess/formats/common/block_source.h"

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

/// A box of a three-dimensional array, which is not empty.
using CgnsBox = ArrayBox;

}  // namespace curvisplat
