// Prediction of one array of a brick from its values before, along the rows of the grid. What is coded is
// what the prediction misses.
//
// A leaf's splats come in grid order: rows along i, then j, then k. A row's splats have neighbours in the row
// above (j - 1, or k - 1 where that is not in the brick), so smooth data is predicted along i, across rows,
// or both. An inner brick is one row with none above.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "stream/model/splats.h"

namespace curvisplat {

inline constexpr uint32_t kNoRow = 0xffffffff;

/// Splats [first, first + count); above: the splat that is the first one's neighbour in the row before
/// (above < first; the others' follow it), or kNoRow.
struct Row {
  uint32_t first = 0, count = 0, above = kNoRow;
  bool operator==(const Row&) const = default;
};

enum class Predictor : uint8_t {
  kNone,         // 0
  kPrevious,     // the value before
  kLinear,       // 2 v[n-1] - v[n-2]
  kAbove,        // v[n-1] + up[n] - up[n-1]
  kAboveLinear,  // up[n] + 2 d[n-1] - d[n-2], d = v - up
};
inline constexpr int kPredictors = 5;

/// The rows of a leaf of `count` splats: its runs, cut where the row above begins or ends. Runs that are not
/// in grid order give rows without neighbours above. No runs: one row.
std::vector<Row> rowsOf(std::span<const NodeRun> runs, size_t count);

/// Calls `step(n, predicted)` for all n in order; step returns values[n], which it may have just set. Numbers
/// wrap around.
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

/// Rows to try predictors on: enough of `rows` to tell them apart.
std::vector<Row> sampleOf(std::span<const Row> rows);

/// The predictor with the fewest bits for `values`, judged on `sample`.
Predictor bestPredictor(std::span<const Row> sample, std::span<const uint32_t> values);

/// Small for small differences of either sign: 0, -1, 1, -2, 2 ... give 0, 1, 2, 3, 4 ...
inline uint32_t zigzag(uint32_t difference) {
  return difference << 1 ^ (0u - (difference >> 31));
}
inline uint32_t unzigzag(uint32_t code) {
  return code >> 1 ^ (0u - (code & 1));
}

}  // namespace curvisplat
