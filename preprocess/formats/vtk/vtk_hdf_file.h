// A VTKHDF file, whose arrays are VtkArray (hdf5_contents.h).
#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "preprocess/formats/common/hdf5_arrays.h"
#include "preprocess/formats/common/hdf5_contents.h"
#include "preprocess/formats/vtk/vtk_grid.h"

namespace curvisplat {

class VtkHdfFile : public Hdf5Contents {
 public:
  using Hdf5Contents::Hdf5Contents;

  /// Tuples [first, first + tuples) of a data set, whose first dimension counts them. Throws Error if it does not have them.
  VtkArray tuples(const std::string& place, uint64_t first, uint64_t tuples) const;
};

/// A VtkArray of numbers [first, first + tuples * components) of an array.
VtkArray vtkArrayOf(std::string name, std::shared_ptr<const Hdf5Array> array, uint64_t first, uint64_t tuples,
                    uint32_t components);

}  // namespace curvisplat
