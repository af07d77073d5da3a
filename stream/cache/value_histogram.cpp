#include "stream/cache/value_histogram.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

#include "stream/base/checksum.h"
#include "stream/base/error.h"
#include "stream/cache/cache_format.h"
#include "stream/cache/cache_index.h"
#include "stream/cache/cache_reader.h"
#include "stream/cache/series.h"

namespace curvisplat {
namespace {

constexpr int kPartBits = 40;
constexpr double kWholesOfRoot = 0x1p40;
/// The largest sum, of cells that overlap 4 million times.
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

namespace {

/// Adds the volumes of a step's bins to `volumes`, the bins between `lower` and `upper`.
void addStep(const ValueHistogram& step, double lower, double upper,
             std::array<double, kHistogramBins>& volumes) {
  const double width = (upper - lower) / kHistogramBins;
  const auto placeOf = [&](double value) {
    // Not std::clamp: a manifest's range may be so wide that the quotient is no number.
    const double place = width > 0 ? (value - lower) / width : 0.0;
    return place > 0 ? std::min(place, double{kHistogramBins}) : 0.0;
  };
  for (size_t bin = 0; bin < kHistogramBins; ++bin) {
    const double volume = step.shares[bin] * step.volume;
    if (!(volume > 0)) continue;
    const double from = step.lower + static_cast<double>(bin) * step.binWidth();
    const double begin = placeOf(from), end = placeOf(from + step.binWidth());
    const auto first = std::min(static_cast<size_t>(begin), size_t{kHistogramBins - 1});
    for (size_t to = first; to < kHistogramBins; ++to) {
      const double inside =
          std::min(end, static_cast<double>(to + 1)) - std::max(begin, static_cast<double>(to));
      volumes[to] += end > begin ? volume * inside / (end - begin) : volume;
      if (!(end > static_cast<double>(to + 1))) break;
    }
  }
}

/// The histogram in a file of values; nullopt if it has none.
std::optional<ValueHistogram> histogramOfFile(const InputFile& file) {
  VariableHeader header;
  if (file.size() < sizeof header) return std::nullopt;
  file.readAt(0, std::span(&header, 1));
  return header.magic == kVariableMagic ? readHistogram(file, header.table_offset) : std::nullopt;
}

}  // namespace

std::optional<ValueHistogram> stepHistogram(const CacheReader& cache, size_t variable) {
  if (cache.position().part > 0) return std::nullopt;
  return histogramOfFile(InputFile(cache.valuesPath(variable)));
}

std::optional<ValueHistogram> seriesHistogram(const CacheReader& cache, size_t variable) {
  const Series& series = cache.series();
  const VariableInfo& info = cache.seriesManifest().variables[variable];
  if (series.steps.size() == 1) return stepHistogram(cache, variable);
  std::array<double, kHistogramBins> volumes{};
  for (uint64_t step = 0; step < series.steps.size(); ++step) {
    const uint32_t geometry = series.steps[step].geometry;
    const auto folder =
        geometry == 0 ? cache.cachePath() : cacheFolder(cache.cachePath(), geometryFolderName(geometry));
    const InputFile file(cacheFile(folder, stepValuesName(series, step, info.number)));
    const auto of_step = histogramOfFile(file);
    if (!of_step) return std::nullopt;
    addStep(*of_step, info.min, info.max, volumes);
  }
  double total = 0;
  for (const double volume : volumes) total += volume;
  if (!(total > 0)) return std::nullopt;
  ValueHistogram sum{info.min, info.max, total / static_cast<double>(series.steps.size()), {}};
  for (size_t bin = 0; bin < kHistogramBins; ++bin)
    sum.shares[bin] = static_cast<float>(volumes[bin] / total);
  return sum;
}

}  // namespace curvisplat
