// Tells by their names which scalars are components of one vector or tensor ("U:x" and "U:mag" of U, "tau:3" of tau,
// "VelocityX" of Velocity), and which were not computed. Pure: any thread.
#pragma once

#include <string_view>

namespace curvisplat {

/// The name of the vector or tensor that a scalar of this name would be a component, or the magnitude, of; empty if none.
std::string_view vectorOf(std::string_view name);

/// Kinds of scalars, the best to look at first: computed fields, numbers of materials, places, and numbers of points and cells.
enum class ScalarKind { kField, kMaterial, kPlace, kNumbering };

/// The kind that the words of the name tell: "mat_id", "MaterialIds" and "gmsh:physical" are materials, "Coordinate:mag",
/// "lon_rho" and "Depth" places, "GlobalNodeId" and "node_groups" numberings.
ScalarKind kindOf(std::string_view name);

}  // namespace curvisplat
