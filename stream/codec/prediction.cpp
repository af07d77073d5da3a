#include "stream/codec/prediction.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <tuple>

#include "stream/base/vector_clones.h"

namespace curvisplat {
namespace {

constexpr size_t kSampleSplats = 4096;
constexpr uint32_t kSampleRow = 256;  // splats per piece of a row in a sample

auto rowKey(const NodeRun& run) {
  return std::tuple(run.block, run.k, run.j);
}

bool inGridOrder(std::span<const NodeRun> runs) {
  for (size_t n = 1; n < runs.size(); ++n) {
    const NodeRun &a = runs[n - 1], &b = runs[n];
    if (rowKey(b) < rowKey(a) || (rowKey(a) == rowKey(b) && b.i < a.i + a.count)) return false;
  }
  return true;
}

/// A row and the row above it, null if there is none. `before`: the value before the row's first.
struct KnownRow {
  const uint32_t* values;
  const uint32_t* above;
  uint32_t before, count;
};

/// out: [count]
[[gnu::always_inline]] inline void residualsOfRow(Predictor predictor, const KnownRow& row,
                                                  uint32_t* __restrict out) {
  const uint32_t *const v = row.values, *const up = row.above, count = row.count;
  const auto put = [v, out](uint32_t n, uint32_t predicted) { out[n] = zigzag(v[n] - predicted); };
  if (predictor == Predictor::kNone) {
    for (uint32_t n = 0; n < count; ++n) put(n, 0);
    return;
  }
  put(0, up ? up[0] : row.before);
  if (predictor == Predictor::kPrevious) {
    for (uint32_t n = 1; n < count; ++n) put(n, v[n - 1]);
  } else if (predictor == Predictor::kLinear || !up) {
    if (count > 1) put(1, v[0]);
    for (uint32_t n = 2; n < count; ++n) put(n, 2 * v[n - 1] - v[n - 2]);
  } else if (predictor == Predictor::kAbove) {
    for (uint32_t n = 1; n < count; ++n) put(n, up[n] + (v[n - 1] - up[n - 1]));
  } else {
    if (count > 1) put(1, up[1] + (v[0] - up[0]));
    for (uint32_t n = 2; n < count; ++n) put(n, up[n] + 2 * (v[n - 1] - up[n - 1]) - (v[n - 2] - up[n - 2]));
  }
}

/// The sum of std::bit_width(). From the exponents of floats, as which numbers of 31 bits are converted in vectors: without the
/// bit below the highest none is rounded up to the next power of two.
CURVISPLAT_VECTOR_CLONES uint64_t bitsOf(const uint32_t* numbers, size_t count) {
  constexpr size_t kAtOnce = 1u << 20;  // whose sum has 32 bits
  uint64_t bits = 0;
  for (size_t begin = 0; begin < count; begin += kAtOnce) {
    uint32_t sum = 0;
    const size_t end = std::min(count, begin + kAtOnce);
    for (size_t n = begin; n < end; ++n) {
      const auto highest = static_cast<int32_t>(numbers[n] & ~(numbers[n] >> 1));
      const auto exponent = static_cast<int32_t>(std::bit_cast<uint32_t>(static_cast<float>(highest)) >> 23);
      const int32_t width = highest < 0 ? 32 : std::max(exponent - 126, 0);
      sum += static_cast<uint32_t>(width);
    }
    bits += sum;
  }
  return bits;
}

/// Cuts runs into rows. `starts[r]` is the first splat of run r.
class RowCutter {
 public:
  RowCutter(std::span<const NodeRun> runs, std::vector<Row>& rows) : runs_(runs), rows_(rows) {
    starts_.reserve(runs.size());
    uint32_t start = 0;
    for (const NodeRun& run : runs) {
      starts_.push_back(start);
      start += static_cast<uint32_t>(run.count);
    }
  }

  void cut(size_t r) {
    const NodeRun& run = runs_[r];
    const bool along_j = run.j > 0 && cutBelow(r, {run.block, run.k, run.j - 1});
    const bool along_k = !along_j && run.k > 0 && cutBelow(r, {run.block, run.k - 1, run.j});
    if (!along_j && !along_k) rows_.push_back({starts_[r], static_cast<uint32_t>(run.count), kNoRow});
  }

 private:
  using Key = std::tuple<uint32_t, uint64_t, uint64_t>;

  /// Cuts run r at the ends of the runs of the row `above`. Returns false and adds nothing if none of them
  /// overlaps it in i.
  bool cutBelow(size_t r, const Key& above) {
    const NodeRun& run = runs_[r];
    const uint64_t end = run.i + run.count;
    auto it = std::lower_bound(runs_.begin(), runs_.begin() + static_cast<ptrdiff_t>(r),
                               std::pair(above, run.i), [](const NodeRun& a, const auto& key_and_i) {
                                 return std::pair(Key(rowKey(a)), a.i + a.count) <=
                                        std::pair(key_and_i.first, key_and_i.second);
                               });
    uint64_t at = run.i;
    const auto push = [&](uint64_t until, uint32_t up) {
      if (until > at)
        rows_.push_back(
            {starts_[r] + static_cast<uint32_t>(at - run.i), static_cast<uint32_t>(until - at), up});
      at = until;
    };
    for (; it != runs_.end() && Key(rowKey(*it)) == above && it->i < end; ++it) {
      if (at < it->i) push(it->i, kNoRow);
      const size_t up_run = static_cast<size_t>(it - runs_.begin());
      push(std::min(end, it->i + it->count), starts_[up_run] + static_cast<uint32_t>(at - it->i));
    }
    if (at == run.i) return false;
    push(end, kNoRow);
    return true;
  }

  std::span<const NodeRun> runs_;
  std::vector<Row>& rows_;
  std::vector<uint32_t> starts_;
};

}  // namespace

std::vector<Row> rowsOf(std::span<const NodeRun> runs, size_t count) {
  std::vector<Row> rows;
  if (runs.empty()) {
    rows.push_back({0, static_cast<uint32_t>(count), kNoRow});
    return rows;
  }
  RowCutter cutter(runs, rows);
  if (inGridOrder(runs)) {
    for (size_t r = 0; r < runs.size(); ++r) cutter.cut(r);
  } else {
    uint32_t start = 0;
    for (const NodeRun& run : runs) {
      rows.push_back({start, static_cast<uint32_t>(run.count), kNoRow});
      start += static_cast<uint32_t>(run.count);
    }
  }
  return rows;
}

std::vector<Row> sampleOf(std::span<const Row> rows) {
  size_t pieces = 0;
  for (const Row& row : rows) pieces += (row.count + kSampleRow - 1) / kSampleRow;
  const size_t total = rows.empty() ? 0 : rows.back().first + rows.back().count;
  const size_t stride = std::max<size_t>(1, total / kSampleSplats);
  std::vector<Row> sample;
  sample.reserve(pieces / stride + 1);
  size_t piece = 0;
  for (const Row& row : rows) {
    for (uint32_t from = 0; from < row.count; from += kSampleRow) {
      if (piece++ % stride != 0) continue;
      sample.push_back({row.first + from, std::min(kSampleRow, row.count - from),
                        row.above == kNoRow ? kNoRow : row.above + from});
    }
  }
  return sample;
}

CURVISPLAT_VECTOR_CLONES void residualsOf(Predictor predictor, std::span<const Row> rows,
                                          const uint32_t* values, uint32_t* out) {
  uint32_t before = 0;
  for (const Row& row : rows) {
    if (row.count == 0) continue;
    const uint32_t* const own = values + row.first;
    residualsOfRow(predictor, {own, row.above == kNoRow ? nullptr : values + row.above, before, row.count},
                   out);
    before = own[row.count - 1];
    out += row.count;
  }
}

PredictorChoice bestPredictor(std::span<const Row> sample, std::span<const uint32_t> values) {
  PredictorChoice best{Predictor::kNone, std::numeric_limits<uint64_t>::max()};
  size_t count = 0;
  for (const Row& row : sample) count += row.count;
  std::vector<uint32_t> residuals(count);
  for (int p = 0; p < kPredictors; ++p) {
    const auto predictor = static_cast<Predictor>(p);
    residualsOf(predictor, sample, values.data(), residuals.data());
    const uint64_t bits = bitsOf(residuals.data(), count);
    if (bits < best.bits) best = {predictor, bits};
  }
  return best;
}

}  // namespace curvisplat
