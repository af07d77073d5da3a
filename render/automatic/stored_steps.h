// Warnings where a picture asks for finer differences of a scalar than its cache stores. From the index and the percentiles alone, without
// reading bricks: some 20 ns for each brick. Any thread.
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "render/colour/scalar_axis.h"
#include "stream/cache/cache_reader.h"

namespace curvisplat {

/// A scalar that is shown over an axis.
struct ShownAxis {
  size_t variable = 0;
  ScalarAxis axis;

  bool operator==(const ShownAxis& other) const;
};

/// Isosurfaces of a scalar.
struct AskedIsovalues {
  size_t variable = 0;
  std::vector<double> values;

  bool operator==(const AskedIsovalues&) const = default;
};

/// The differences that a picture asks for.
struct AskedDifferences {
  std::vector<ShownAxis> axes;
  std::vector<AskedIsovalues> isosurfaces = {};

  bool operator==(const AskedDifferences&) const = default;
};

/// Returns a warning if an axis has fewer than 100 steps of the stored values, or fewer than 20 within the width around the centre of an
/// asinh, or in the first decade of a logarithm; empty otherwise.
std::string axisFinerThanStored(const CacheReader& cache, const ShownAxis& shown);

/// Returns what axisFinerThanStored() says of the axes, for each scalar once, and a warning for each isovalue from which more than 2 % of
/// the volume lies no further than a step, where its surface follows the values' rounding, or where steps are wider than 5 % of its own
/// scale (ValueSpread).
std::vector<std::string> finerThanStored(const CacheReader& cache, const AskedDifferences& asked);

}  // namespace curvisplat
