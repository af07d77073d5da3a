// Finds how options state a function that is given by its points, as the page edits it: a colour map, a range, and the opacities.
// Pure; any thread.
#pragma once

#include <optional>

#include "render/colour/function_parts.h"
#include "render/colour/transfer_function.h"

namespace curvisplat {

/// The parts of a function whose colours are those of a built-in map, with the map and the scale of `like`, or the map by the
/// function's own name on a linear scale. nullopt for other colours. `opacity_unit`: where the points state none.
std::optional<FunctionParts> partsOfPoints(const TransferFunctionDefinition& points,
                                           const std::optional<FunctionParts>& like, double opacity_unit);

}  // namespace curvisplat
