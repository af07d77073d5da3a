// A small PLOT3D cube whose values are what a test says, and how it becomes a cache.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "tests/reference/function_grid.h"

namespace curvisplat {

/// Changes the node (i, j, k), which otherwise lies at (i, j, k), and sets its one scalar.
using CubeNode = std::function<void(const GridNode&, NodeValues&)>;

/// Writes `side`³ nodes to PREFIX.xyz and PREFIX.fun. The scalar is `name`.
void writeCube(const std::filesystem::path& prefix, uint64_t side, const CubeNode& node,
               const std::string& name = "f");

/// `convert PREFIX.xyz PREFIX.fun -o OUTPUT`, by default to PREFIX.splats; the layout is named, since files
/// so small fit several.
std::vector<std::string> cubeArguments(const std::filesystem::path& prefix,
                                       const std::vector<std::string>& more = {},
                                       const std::filesystem::path& output = {});
/// `convert PREFIX.xyz PREFIX.fun --add-scalar SCALAR --to CACHE`.
std::vector<std::string> cubeAdditionWords(const std::filesystem::path& prefix, const std::string& scalar,
                                           const std::filesystem::path& cache);

}  // namespace curvisplat
