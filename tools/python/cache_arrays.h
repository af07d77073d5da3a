// A cache's data as numpy arrays: means on a regular lattice, and the splats of a level.
#pragma once

#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>

#include <array>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "stream/cache/cache_reader.h"

namespace curvisplat::python {

/// The data that are asked for. Without a level of the octree, a lattice takes the level that suits it, points take the finest.
struct DataChoice {
  std::string scalar;
  std::array<double, 3> lower{}, upper{};
  std::optional<uint32_t> level;
  uint64_t step = 0;
};

/// (value, density), float32 of shape (nz, ny, nx): means over the boxes that the choice's box is divided into. Throws UsageError for
/// an empty box or size, and as FieldSampler does.
pybind11::tuple sampledArrays(const CacheReader& cache, const DataChoice& choice,
                              const std::array<uint32_t, 3>& size, const pybind11::object& progress);

/// (positions (n, 3), float64; values (n), volumes (n), shapes (n, 3, 3), float32) of the splats with their centres in the box.
pybind11::tuple pointArrays(const CacheReader& cache, const DataChoice& choice,
                            const pybind11::object& progress);

/// Probes points. Returns, as joinedValues() does, each scalar's value at the points and at the samples next to them, and the block, the
/// indices and the places of these samples; outside of the data NaN, and block 0. `sets`: the cache, and those of its scalars with
/// blanks of their own. `source`: the grid's files; empty: those that the cache names; nullopt: the cache alone is read.
pybind11::tuple probedArrays(const std::vector<std::shared_ptr<const CacheReader>>& sets,
                             const std::vector<std::array<double, 3>>& points,
                             const std::optional<std::vector<std::filesystem::path>>& source);

}  // namespace curvisplat::python
