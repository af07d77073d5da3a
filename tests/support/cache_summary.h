// A cache in a few numbers and a small picture: what a later program must still get out of it.
#pragma once

#include <map>
#include <string>

#include "render/image/image.h"
#include "stream/cache/cache_reader.h"

namespace curvisplat {

/// Sums over all decoded splats, in double: of counts, weights, places, shapes and values, level by level and
/// variable by variable.
std::map<std::string, double> summaryOf(const CacheReader& cache);

/// 96 x 72 pixels of the finest level, drawn by the CPU.
Image smallPictureOf(const CacheReader& cache, size_t variable);

}  // namespace curvisplat
