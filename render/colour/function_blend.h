// A transfer function between two others, as a film needs them. Pure; any thread.
#pragma once

#include "render/colour/transfer_function.h"

namespace curvisplat {

/// The function `part` (0 to 1) of the way from one to another, whose points lie at scalars. Both scales are
/// logarithmic, or neither.
///
/// Where both have as many colours, in one space, or as many opacities, each point moves to its counterpart, along a range that
/// moves linearly; colours change in their space. Otherwise both curves are blended at all points of either; for colours at
/// 256 even places besides, in RGB. The opacity unit changes by equal factors.
TransferFunctionDefinition blended(const TransferFunctionDefinition& from,
                                   const TransferFunctionDefinition& to, double part);

}  // namespace curvisplat
