#include "stream/cache/value_histogram.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "stream/base/check.h"
#include "stream/base/checksum.h"
#include "stream/base/error.h"

namespace curvisplat {
namespace {

constexpr int kPartBits = 40;
constexpr double kWholesOfRoot = 0x1p40;
/// Cells may overlap, but not so often.
constexpr double kMaxWholes = 0x1p62;

uint64_t checksumOfRecord(const HistogramRecord& record) {
  const auto bytes = std::as_bytes(std::span(&record, 1));
  constexpr size_t kAt = offsetof(HistogramRecord, checksum);
  Checksum checksum;
  checksum.add(bytes.first(kAt));
  checksum.add(bytes.subspan(kAt + sizeof record.checksum));
  return checksum.value();
}

bool isValid(const HistogramRecord& record) {
  bool fine = record.version == 1 && record.bins == kHistogramBins && std::isfinite(record.lower) &&
              std::isfinite(record.upper) && record.lower <= record.upper &&
              std::isfinite(record.upper - record.lower) && std::isfinite(record.volume) &&
              record.volume > 0 && record.checksum == checksumOfRecord(record);
  for (const float share : record.shares) fine &= share >= 0 && share <= 1;
  return fine;
}

}  // namespace

double ValueHistogram::percentile(double part) const {
  double total = 0, below = 0;
  for (const float share : shares) total += share;
  for (size_t bin = 0; bin < kHistogramBins; ++bin) {
    const double share = shares[bin] / total;
    if (share > 0 && below + share >= part)
      return lower + (static_cast<double>(bin) + std::max(0.0, part - below) / share) * binWidth();
    below += share;
  }
  return upper;
}

size_t histogramBin(double mean, double lower, double upper) {
  const double part = upper > lower ? (mean - lower) * (kHistogramBins / (upper - lower)) : 0.0;
  // Not std::clamp: a manifest's range may be so wide or so narrow that the product is no number.
  return part > 0 ? static_cast<size_t>(std::min(part, double{kHistogramBins - 1})) : 0;
}

HistogramRecord recordOf(const ValueHistogram& histogram) {
  HistogramRecord record;
  record.lower = histogram.lower;
  record.upper = histogram.upper;
  record.volume = histogram.volume;
  record.shares = histogram.shares;
  record.checksum = checksumOfRecord(record);
  return record;
}

std::optional<ValueHistogram> readHistogram(const InputFile& file, uint64_t table_offset) {
  HistogramRecord record;
  if (table_offset < sizeof record || table_offset > file.size()) return std::nullopt;
  file.readAt(table_offset - sizeof record, std::span(&record, 1));
  if (record.magic != kHistogramMagic) return std::nullopt;
  if (!isValid(record))
    throw Error("{}: its histogram at offset {} is damaged; convert again", file.path().string(),
                table_offset - sizeof record);
  return ValueHistogram{record.lower, record.upper, record.volume, record.shares};
}

HistogramSums::HistogramSums(const RootCube& root, const std::vector<VariableInfo>& variables)
    : per_volume_(kWholesOfRoot / (root.size * root.size * root.size)),
      sums_(variables.size() * kHistogramBins) {
  for (const VariableInfo& variable : variables) ranges_.push_back({variable.min, variable.max});
}

void HistogramSums::add(const BrickSplats& leaf) {
  CURVISPLAT_CHECK_OP(leaf.variables.size(), ==, ranges_.size());
  for (size_t v = 0; v < ranges_.size(); ++v) {
    std::array<double, kHistogramBins> volumes{};
    const auto& values = leaf.variables[v];
    for (size_t n = 0; n < values.size(); ++n)
      volumes[histogramBin(values[n].mean, ranges_[v].lower, ranges_[v].upper)] += leaf.splats[n].weight;
    const MutexLock lock(summing_);
    for (size_t bin = 0; bin < kHistogramBins; ++bin)
      if (volumes[bin] > 0) sums_[v * kHistogramBins + bin].add(volumes[bin] * per_volume_);
  }
}

void HistogramSums::clear() {
  const MutexLock lock(summing_);
  std::fill(sums_.begin(), sums_.end(), Sum());
}

std::optional<ValueHistogram> HistogramSums::of(size_t variable) const {
  const MutexLock lock(summing_);
  const auto sums = std::span(sums_).subspan(variable * kHistogramBins, kHistogramBins);
  std::array<double, kHistogramBins> volumes{};
  double total = 0;
  for (size_t bin = 0; bin < kHistogramBins; ++bin) {
    volumes[bin] =
        static_cast<double>(sums[bin].whole) + std::ldexp(static_cast<double>(sums[bin].part), -kPartBits);
    total += volumes[bin];
  }
  if (!(total > 0 && total < kMaxWholes)) return std::nullopt;
  ValueHistogram histogram{ranges_[variable].lower, ranges_[variable].upper, total / per_volume_, {}};
  for (size_t bin = 0; bin < kHistogramBins; ++bin)
    histogram.shares[bin] = static_cast<float>(volumes[bin] / total);
  return histogram;
}

std::vector<uint64_t> HistogramSums::words() const {
  const MutexLock lock(summing_);
  std::vector<uint64_t> words;
  words.reserve(2 * sums_.size());
  for (const Sum& sum : sums_) words.insert(words.end(), {sum.whole, sum.part});
  return words;
}

void HistogramSums::setWords(std::span<const uint64_t> words) {
  const MutexLock lock(summing_);
  CURVISPLAT_CHECK_OP(words.size(), ==, 2 * sums_.size());
  for (size_t n = 0; n < sums_.size(); ++n) {
    sums_[n] = {words[2 * n], words[2 * n + 1]};
    sums_[n].carry();
  }
}

void HistogramSums::Sum::add(double units) {
  const double wholes = std::floor(std::min(units, kMaxWholes));
  whole += static_cast<uint64_t>(wholes);
  part += static_cast<uint64_t>(std::ldexp(std::min(units, kMaxWholes) - wholes, kPartBits));
  carry();
}

void HistogramSums::Sum::carry() {
  whole = std::min(whole + (part >> kPartBits), static_cast<uint64_t>(kMaxWholes));
  part &= (uint64_t{1} << kPartBits) - 1;
}

}  // namespace curvisplat
