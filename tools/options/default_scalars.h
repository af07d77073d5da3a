// Chooses the scalars that `convert` takes where none are named. Any thread.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <set>
#include <string>
#include <vector>

#include "preprocess/grid/grid_source.h"

namespace curvisplat {

/// The most scalars that are converted where none are named.
inline constexpr size_t kMaxDefaultScalars = 16;

/// The scalars that the files store and that can share a cache, each name once and kMaxDefaultScalars at most: positions in
/// description.scalars, in their order. They have the centring of the first one, unless the quantities that flow solvers compute,
/// or those of a better kind (ScalarKind), have the other centring only. Beyond that number, components are left out before scalars,
/// those of tensors first. Calls say() with notes that name what is left out, and how to choose it. Does not choose those in `unusable`.
std::vector<uint32_t> defaultScalars(const GridDescription& description,
                                     const std::set<std::string>& unusable,
                                     const std::function<void(const std::string&)>& say);

}  // namespace curvisplat
