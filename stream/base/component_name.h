// Tells by their names which scalars are components of one vector or tensor: "U:x" and "U:mag" of U, "tau:3" of
// tau, "VelocityX" of Velocity. Pure: any thread.
#pragma once

#include <string_view>

namespace curvisplat {

/// The name of the vector or tensor that a scalar of this name would be a component, or the magnitude, of; empty if none.
std::string_view vectorOf(std::string_view name);

}  // namespace curvisplat
