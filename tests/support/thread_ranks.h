// Ranks that are threads of one process: what runs on several ranks, without a library for message passing.
#pragma once

#include <functional>

#include "stream/base/ranks.h"

namespace curvisplat {

/// Runs `job` on each of `count` ranks, a thread each, and waits for them. Throws what the first rank that failed
/// threw; the others' next calls fail then.
void runRanks(unsigned count, const std::function<void(Ranks& ranks)>& job);

}  // namespace curvisplat
