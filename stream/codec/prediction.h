// Predicts the values of an array from earlier values, along and across the rows of the grid. Only the
// prediction errors (residuals) are coded.
//
// A leaf's splats are in grid order: rows along i, then j, then k. The splats of a row have neighbours in the
// row above (j - 1, or k - 1 where that row is not in the brick), so smooth data can be predicted along i,
// across rows, or both. An inner brick is a single row, with none above.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "stream/model/splats.h"

namespace curvisplat {

inline constexpr uint32_t kNoRow = 0xffffffff;

/// Splats [first, first + count). `above`: the neighbour of splat `first` in the row above, or kNoRow. It is
/// less than `first`; the neighbours of the row's other splats follow it.
struct Row {
  uint32_t first = 0, count = 0, above = kNoRow;
  bool operator==(const Row&) const = default;
};

enum class Predictor : uint8_t {
  kNone,         // 0
  kPrevious,     // v[n-1]
  kLinear,       // 2 v[n-1] - v[n-2]
  kAbove,        // v[n-1] + up[n] - up[n-1]
  kAboveLinear,  // up[n] + 2 d[n-1] - d[n-2], d = v - up
};
inline constexpr int kPredictors = 5;

/// The rows of a leaf of `count` splats: its runs, cut where runs of the row above begin or end. If the runs
/// are not in grid order, no row has one above. Without runs there is one row.
std::vector<Row> rowsOf(std::span<const NodeRun> runs, size_t count);

/// Calls `step(n, predicted)` for all n in order. `step` must return values[n]; a decoder sets it in this
/// call. Arithmetic is modulo 2^32. In a row without one above, kAbove and kAboveLinear predict as kLinear
/// does.
template <typename Step>
void predictRows(Predictor predictor, std::span<const Row> rows, const uint32_t* values, Step step) {
  uint32_t before = 0;
  for (const Row& row : rows) {
    const uint32_t end = row.first + row.count;
    if (predictor == Predictor::kNone) {
      for (uint32_t n = row.first; n < end; ++n) step(n, 0u);
      continue;
    }
    const uint32_t* above = row.above == kNoRow ? nullptr : values + row.above;
    before = step(row.first, above ? above[0] : before);
    if (predictor == Predictor::kPrevious) {
      for (uint32_t n = row.first + 1; n < end; ++n) before = step(n, before);
    } else if (predictor == Predictor::kLinear || !above) {
      uint32_t change = 0;
      for (uint32_t n = row.first + 1; n < end; ++n) {
        const uint32_t value = step(n, before + change);
        change = value - before;
        before = value;
      }
    } else if (predictor == Predictor::kAbove) {
      uint32_t difference = before - above[0];
      for (uint32_t n = row.first + 1, m = 1; n < end; ++n, ++m) {
        const uint32_t up = above[m];
        before = step(n, up + difference);
        difference = before - up;
      }
    } else {
      uint32_t difference = before - above[0], change = 0;
      for (uint32_t n = row.first + 1, m = 1; n < end; ++n, ++m) {
        const uint32_t up = above[m];
        before = step(n, up + difference + change);
        change = before - up - difference;
        difference = before - up;
      }
    }
  }
}

/// The residuals zigzag(values[n] - predicted) that predictRows() leaves of known values, for all n of
/// `rows`, one row after the other. The same numbers without waiting for one before the next, by vector
/// instructions. `out` must not overlap `values`.
void residualsOf(Predictor predictor, std::span<const Row> rows, const uint32_t* values, uint32_t* out);

/// A sample of `rows`, large enough to choose a predictor by.
std::vector<Row> sampleOf(std::span<const Row> rows);

struct PredictorChoice {
  Predictor predictor = Predictor::kNone;
  uint64_t bits = 0;  // of its residuals in the sample
};

/// The predictor whose residuals of `values` have the fewest bits, measured on `sample`.
PredictorChoice bestPredictor(std::span<const Row> sample, std::span<const uint32_t> values);

/// Maps differences of small magnitude to small codes: 0, -1, 1, -2, 2, ... become 0, 1, 2, 3, 4, ...
inline uint32_t zigzag(uint32_t difference) {
  return difference << 1 ^ (0u - (difference >> 31));
}
inline uint32_t unzigzag(uint32_t code) {
  return code >> 1 ^ (0u - (code & 1));
}

}  // namespace curvisplat
