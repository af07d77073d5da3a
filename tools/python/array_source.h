// Grids of numpy arrays, and of a Python object that reads boxes, as conversion reads them.
#pragma once

#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>

#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "preprocess/grid/grid_source.h"

namespace curvisplat::python {

/// One block in memory. Arrays have three dimensions (k, j, i), of float32 or float64 with any strides, and are not
/// copied. All have one shape, but those of scalars in cells, which are one shorter along each dimension.
struct BlockArrays {
  std::string name;
  pybind11::array x, y, z;
  std::vector<pybind11::array> scalars;
  pybind11::object blank;  // None, or an array of bool: true where a node is not there
};

/// The name of each scalar, and its unit.
using ScalarNames = std::vector<std::pair<std::string, std::string>>;

/// Throws UsageError for arrays of other types or shapes. Reading needs no lock: the arrays must not change meanwhile.
/// `time`: of this step, if it is one of a series.
std::unique_ptr<GridSource> sourceOfArrays(std::vector<BlockArrays> blocks, const ScalarNames& names,
                                           std::optional<double> time = {});

/// A function that reads a grid in Python, box by box: called with (block, k0, k1, j0, j1, [scalar]), returns
/// (x, y, z, values, blank), arrays of shape (k1 - k0, j1 - j0, ni), `values` a list of them, `blank` None or
/// of bool. `parts_of_rows`: it takes i0 and i1, too, and the arrays have i1 - i0 elements along i.
struct PythonRead {
  pybind11::object function;
  bool parts_of_rows = false;
};

/// `shapes`: (nk, nj, ni) of each block. Takes the interpreter's lock for each call; throws Error if the arrays have other shapes,
/// and what the callable raises.
std::unique_ptr<GridSource> sourceOfCallable(const std::vector<std::array<uint64_t, 3>>& shapes,
                                             const ScalarNames& names, PythonRead read);

}  // namespace curvisplat::python
