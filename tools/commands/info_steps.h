// The time steps of a cache, for `info`.
#pragma once

#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <string>

#include "stream/base/progress.h"
#include "stream/cache/cache_reader.h"
#include "stream/cache/cache_verify.h"

namespace curvisplat {

/// Prints the number of steps, and for a series a line for each: its time, its date if the unit has one, its
/// geometry, and the ranges of its scalars. If there are more than 24, the middle ones are left out.
void printSteps(const CacheReader& reader);

/// [step]: time, geometry, and for each scalar its range and bytes.
nlohmann::ordered_json stepsAsJson(const CacheReader& reader);

/// Whether a file of the cache has values of another step, by its name.
bool isOfAnotherStep(const std::string& file, uint64_t step);

/// Bytes of all files of the series, steps.bin and those of further geometries included.
uint64_t seriesBytes(const CacheReader& reader);

/// verifyCache() at all steps. Findings of a series name the step.
CacheVerification verifySteps(const CacheReader& reader, Progress& progress);

}  // namespace curvisplat
