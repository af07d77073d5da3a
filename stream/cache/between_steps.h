// Values between two time steps of one geometry, for a reader of a time that no step has.
//
// A splat's mean f and slope h are linear in the samples: their blend is what a splat of the blended samples has.
// The square root of its variance is blended too. That is exact where the deviations of the two steps go together,
// and an upper bound otherwise: of samples that move against each other the variance would be smaller.
// Pure; any thread.
#pragma once

#include "stream/model/brick.h"
#include "stream/model/splats.h"

namespace curvisplat {

/// Replaces `values`, those of the earlier step, by those at `part` of the way to `later`, 0 to 1.
void blendValues(const VariableArrays<float>& values, const VariableArrays<const float>& later, double part);

/// Bounds of the blended values of a brick, from its records at both steps. The stream is the earlier one's.
BrickVariable blendedRecord(const BrickVariable& earlier, const BrickVariable& later, double part);

}  // namespace curvisplat
