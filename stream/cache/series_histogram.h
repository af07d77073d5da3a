// The histogram of a variable at a step, and over all steps of a series.
#pragma once

#include <cstddef>
#include <optional>

#include "stream/cache/cache_reader.h"
#include "stream/cache/value_histogram.h"

namespace curvisplat {

/// How the values of manifest().variables[variable] are spread at the reader's step. Nothing between two steps, and in files
/// of earlier versions. Throws Error if it is damaged.
std::optional<ValueHistogram> stepHistogram(const CacheReader& cache, size_t variable);

/// The sum of the steps' histograms over the range of the series, each with its volume: it is divided evenly among the bins
/// that a step's bin overlaps. `volume`: the mean of the steps'. Nothing if a step has no histogram. Opens one file of each step
/// and reads 2 KiB of it. Throws Error if one is damaged.
std::optional<ValueHistogram> seriesHistogram(const CacheReader& cache, size_t variable);

}  // namespace curvisplat
