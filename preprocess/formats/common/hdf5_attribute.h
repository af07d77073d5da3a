// The type, size and extent of an HDF5 attribute, so that it can be checked before it is read into a buffer:
// by this program, or by a library that trusts the file. Every call holds dataLibraryMutex().
#pragma once

#include <hdf5.h>

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>

#include "preprocess/formats/common/hdf5_handle.h"

namespace curvisplat {

struct Hdf5AttributeShape {
  H5T_class_t kind = H5T_NO_CLASS;
  H5T_class_t element_kind = H5T_NO_CLASS;  // of H5T_VLEN and H5T_ARRAY: the class of their elements
  size_t value_bytes = 0;
  int rank = 0;
  uint64_t values = 0;           // 0: a null or empty extent
  bool variable_string = false;  // values are pointers to strings

  /// "11 strings of 3 bytes", for error messages.
  std::string describe() const;
};

/// "integers", "strings", ...: the values of a type, for error messages.
const char* describe(H5T_class_t kind);

/// The innermost entry of HDF5's error stack after a failed call.
std::string hdf5Reason();

/// nullopt if HDF5 cannot read it; hdf5Reason() tells why.
std::optional<Hdf5AttributeShape> shapeOf(const Hdf5Attribute& attribute);

}  // namespace curvisplat
