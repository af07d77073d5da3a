// The input of bench/peers/vtk_views.py, to draw the same pictures with VTK.
#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>

#include "render/camera/camera.h"
#include "tests/reference/grid_field.h"

namespace curvisplat {

/// The cells of a field, five tetrahedra each, and its scalar at the nodes (NaN-free), as a legacy VTK file
/// of an unstructured grid. Tetrahedra without volume are left out. Throws Error.
void writeTetrahedra(const GridField& field, const std::filesystem::path& path);

nlohmann::json asJson(const Camera& camera);

}  // namespace curvisplat
