#include "stream/cache/value_histogram.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <limits>
#include <numeric>
#include <utility>

#include "stream/base/checksum.h"
#include "stream/base/error.h"
#include "stream/cache/cache_format.h"
#include "stream/cache/cache_index.h"
#include "stream/cache/cache_reader.h"
#include "stream/cache/series.h"

namespace curvisplat {
namespace {

constexpr int kPartBits = 40;
constexpr float kLargest = std::numeric_limits<float>::max();
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
  if (!percentiles.empty()) {
    const double at = std::clamp(part, 0.0, 1.0) * kPercentiles;
    const auto n = std::min(static_cast<size_t>(at), size_t{kPercentiles - 1});
    return std::lerp(double{percentiles[n]}, double{percentiles[n + 1]}, at - static_cast<double>(n));
  }
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

double ValueHistogram::shareBelow(double value) const {
  if (!percentiles.empty()) {
    const auto above = std::upper_bound(percentiles.begin(), percentiles.end(), value);
    if (above == percentiles.begin()) return 0;
    if (above == percentiles.end()) return 1;
    const double from = above[-1];
    return (static_cast<double>(above - percentiles.begin() - 1) + (value - from) / (*above - from)) /
           kPercentiles;
  }
  double below = 0;
  for (size_t bin = 0; bin < kHistogramBins; ++bin) {
    const double from = lower + static_cast<double>(bin) * binWidth();
    if (value < from) break;
    below += shares[bin] * (binWidth() > 0 ? std::min(1.0, (value - from) / binWidth()) : 1.0);
  }
  return below;
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

PercentilesRecord percentilesOf(const ValueHistogram& histogram) {
  CURVISPLAT_CHECK_OP(histogram.percentiles.size(), ==, kPercentiles + 1);
  PercentilesRecord record;
  std::copy(histogram.percentiles.begin(), histogram.percentiles.end(), record.values.begin());
  record.checksum = checksumOf(std::as_bytes(std::span(record.values)));
  return record;
}

namespace {

/// Reads the percentiles that end at `offset`; empty if there are none.
std::vector<float> readPercentiles(const InputFile& file, uint64_t offset, const HistogramRecord& histogram) {
  PercentilesRecord record;
  if (offset < sizeof record) return {};
  file.readAt(offset - sizeof record, std::span(&record, 1));
  if (record.magic != kPercentilesMagic) return {};
  const auto& values = record.values;
  bool fine = record.version == 1 && record.intervals == kPercentiles &&
              record.checksum == checksumOf(std::as_bytes(std::span(values)));
  for (size_t n = 0; n < values.size(); ++n)
    fine &= std::isfinite(values[n]) && (n == 0 || values[n - 1] <= values[n]);
  // The range is in double precision.
  fine &= values.front() >= static_cast<float>(histogram.lower) &&
          values.back() <= static_cast<float>(histogram.upper);
  if (!fine)
    throw Error("{}: its percentiles at offset {} are damaged; convert again", file.path().string(),
                offset - sizeof record);
  return {values.begin(), values.end()};
}

}  // namespace

std::optional<ValueHistogram> readHistogram(const InputFile& file, uint64_t table_offset) {
  HistogramRecord record;
  if (table_offset < sizeof record || table_offset > file.size()) return std::nullopt;
  file.readAt(table_offset - sizeof record, std::span(&record, 1));
  if (record.magic != kHistogramMagic) return std::nullopt;
  if (!isValid(record))
    throw Error("{}: its histogram at offset {} is damaged; convert again", file.path().string(),
                table_offset - sizeof record);
  return ValueHistogram{record.lower, record.upper, record.volume, record.shares,
                        readPercentiles(file, table_offset - sizeof record, record)};
}

HistogramSums::HistogramSums(const RootCube& root, const std::vector<VariableInfo>& variables)
    : per_volume_(kWholesOfRoot / (root.size * root.size * root.size)),
      sums_(variables.size() * kHistogramBins) {
  for (const VariableInfo& variable : variables)
    ranges_.push_back({variable.min, variable.max, ranges_.size() * kHistogramBins});
}

void HistogramSums::divide(size_t variable, HistogramBins bins) {
  Range& divided = ranges_.at(variable);
  divided.bins = std::move(bins);
  CURVISPLAT_CHECK_OP(divided.bins.shares.size(), ==, divided.bins.edges.size() + 1);
  divided.shares_below.assign(1, 0);
  for (const double share : divided.bins.shares)
    divided.shares_below.push_back(divided.shares_below.back() + share);
  // A value in an even bin is at or above all edges in the bins before it.
  divided.edges_below.assign(kHistogramBins + 1, 0);
  for (const float edge : divided.bins.edges)
    ++divided.edges_below[histogramBin(edge, divided.lower, divided.upper) + 1];
  std::partial_sum(divided.edges_below.begin(), divided.edges_below.end(), divided.edges_below.begin());
  size_t sums = 0;
  for (Range& range : ranges_) {
    range.first_sum = sums;
    sums += range.sums();
  }
  const MutexLock lock(summing_);
  sums_.assign(sums, {});
}

size_t HistogramSums::Range::binOf(double mean) const {
  const size_t even_bin = histogramBin(mean, lower, upper);
  const auto begin = bins.edges.begin();
  const auto above = std::upper_bound(begin + edges_below[even_bin], begin + edges_below[even_bin + 1], mean);
  return static_cast<size_t>(above - begin);
}

/// Adds a splat to the bins that its mean may have been in before it was rounded: to `volumes` [bin] if that is one, else to
/// `densities` [bin], what begins and what ends there of volume for a share.
void HistogramSums::Range::addMean(double mean, double weight, double rounding, std::vector<double>& volumes,
                                   std::vector<double>& densities) const {
  const auto& edges = bins.edges;
  const size_t bin = binOf(mean);
  size_t first = bin, last = bin;
  if (bin > 0 && edges[bin - 1] > mean - rounding) first = binOf(mean - rounding);
  if (bin < edges.size() && edges[bin] <= mean + rounding) last = binOf(mean + rounding);
  const double share = shares_below[last + 1] - shares_below[first];
  if (first == last || !(share > 0)) {
    volumes[bin] += weight;
    return;
  }
  densities[first] += weight / share;
  densities[last + 1] -= weight / share;
}

void HistogramSums::add(const BrickSplats& leaf) {
  CURVISPLAT_CHECK_OP(leaf.variables.size(), ==, ranges_.size());
  std::vector<double> volumes, followed, densities;  // of even bins; of those that follow the distribution
  for (size_t v = 0; v < ranges_.size(); ++v) {
    const Range& range = ranges_[v];
    const auto& values = leaf.variables[v];
    const size_t bins = range.sums() - kHistogramBins;
    volumes.assign(kHistogramBins, 0);
    followed.assign(bins, 0);
    densities.assign(bins + 1, 0);
    const auto [least, most] =
        std::minmax_element(values.begin(), values.end(),
                            [](const SplatScalar& a, const SplatScalar& b) { return a.mean < b.mean; });
    for (size_t n = 0; n < values.size(); ++n) {
      const double mean = values[n].mean, weight = leaf.splats[n].weight;
      volumes[histogramBin(mean, range.lower, range.upper)] += weight;
      if (bins == 0) continue;
      const double rounding = largestMeanError(range.bins.coding, least->mean, most->mean, mean);
      range.addMean(mean, weight, rounding, followed, densities);
    }
    double density = 0;
    for (size_t bin = 0; bin < bins; ++bin) {
      density += densities[bin];
      volumes.push_back(followed[bin] + std::max(0.0, density * range.bins.shares[bin]));
    }
    const MutexLock lock(summing_);
    for (size_t bin = 0; bin < volumes.size(); ++bin)
      if (volumes[bin] > 0) sums_[range.first_sum + bin].add(volumes[bin] * per_volume_);
  }
}

void HistogramSums::clear() {
  const MutexLock lock(summing_);
  std::fill(sums_.begin(), sums_.end(), Sum());
}

/// The volume of a sum, in wholes (Sum).
double HistogramSums::volumeOf(const Sum& sum) {
  return static_cast<double>(sum.whole) + std::ldexp(static_cast<double>(sum.part), -kPartBits);
}

std::optional<ValueHistogram> HistogramSums::of(size_t variable) const {
  const MutexLock lock(summing_);
  const Range& range = ranges_[variable];
  const auto sums = std::span(sums_).subspan(range.first_sum, kHistogramBins);
  double total = 0;
  for (const Sum& sum : sums) total += volumeOf(sum);
  if (!(total > 0 && total < kMaxWholes)) return std::nullopt;
  ValueHistogram histogram{range.lower, range.upper, total / per_volume_, {}, percentilesOf(range)};
  for (size_t bin = 0; bin < kHistogramBins; ++bin)
    histogram.shares[bin] = static_cast<float>(volumeOf(sums[bin]) / total);
  return histogram;
}

std::vector<float> HistogramSums::percentilesOf(const Range& range) const {
  const std::vector<float>& edges = range.bins.edges;
  if (edges.empty()) return {};
  const auto sums = std::span(sums_).subspan(range.first_sum + kHistogramBins, edges.size() + 1);
  double total = 0;
  for (const Sum& sum : sums) total += volumeOf(sum);
  std::vector<float> percentiles{static_cast<float>(range.lower)};
  double below = 0;
  for (size_t bin = 0; bin < sums.size(); ++bin) {
    const double here = volumeOf(sums[bin]);
    const double lower = bin == 0 ? range.lower : edges[bin - 1];
    const double upper = bin == edges.size() ? range.upper : edges[bin];
    while (percentiles.size() < kPercentiles) {
      const double wanted = static_cast<double>(percentiles.size()) / kPercentiles * total;
      if (!(here > 0 && below + here >= wanted)) break;
      // A bin of one value has that value, not the next float, which after 0 would be 1.4e-45.
      const bool is_one = std::nextafter(static_cast<float>(lower), kLargest) >= static_cast<float>(upper);
      percentiles.push_back(
          static_cast<float>(is_one ? lower : std::lerp(lower, upper, (wanted - below) / here)));
    }
    below += here;
  }
  percentiles.resize(kPercentiles + 1, static_cast<float>(range.upper));
  // Rounding may take splats' means, and an edge in double precision, beyond the ends of the samples' range.
  for (size_t n = 1; n <= kPercentiles; ++n)
    percentiles[n] = std::clamp(percentiles[n], percentiles[n - 1], static_cast<float>(range.upper));
  return percentiles;
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

/// The percentiles of all steps together, each with its volume; empty if one of them has none. By bisection of floats, whose
/// order is that of their bits.
std::vector<float> unitedPercentiles(const std::vector<ValueHistogram>& steps) {
  const auto has_none = [](const ValueHistogram& step) { return step.percentiles.empty(); };
  if (std::any_of(steps.begin(), steps.end(), has_none)) return {};
  double total = 0;
  for (const ValueHistogram& step : steps) total += step.volume;
  const auto ordered = [](float value) {
    const auto bits = std::bit_cast<int32_t>(value);
    return bits < 0 ? int64_t{INT32_MIN} - bits : int64_t{bits};
  };
  const auto floatOf = [](int64_t order) {
    return std::bit_cast<float>(static_cast<int32_t>(order < 0 ? int64_t{INT32_MIN} - order : order));
  };
  int64_t least = INT64_MAX, most = INT64_MIN;
  for (const ValueHistogram& step : steps) {
    least = std::min(least, ordered(step.percentiles.front()));
    most = std::max(most, ordered(step.percentiles.back()));
  }
  std::vector<float> united{floatOf(least)};
  int64_t low = least;
  for (uint32_t n = 1; n <= kPercentiles; ++n) {
    // The first value that no less lies below.
    int64_t high = most;
    while (low < high) {
      const int64_t middle = low + (high - low) / 2;
      double below = 0;
      for (const ValueHistogram& step : steps) below += step.volume * step.shareBelow(floatOf(middle));
      (below * kPercentiles >= n * total ? high : low) = middle + (below * kPercentiles >= n * total ? 0 : 1);
    }
    united.push_back(floatOf(low));
  }
  return united;
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
  std::vector<ValueHistogram> steps;
  for (uint64_t step = 0; step < series.steps.size(); ++step) {
    const uint32_t geometry = series.steps[step].geometry;
    const auto folder =
        geometry == 0 ? cache.cachePath() : cacheFolder(cache.cachePath(), geometryFolderName(geometry));
    const InputFile file(cacheFile(folder, stepValuesName(series, step, info.number)));
    const auto of_step = histogramOfFile(file);
    if (!of_step) return std::nullopt;
    addStep(*of_step, info.min, info.max, volumes);
    steps.push_back(*of_step);
  }
  double total = 0;
  for (const double volume : volumes) total += volume;
  if (!(total > 0)) return std::nullopt;
  ValueHistogram sum{
      info.min, info.max, total / static_cast<double>(series.steps.size()), {}, unitedPercentiles(steps)};
  for (size_t bin = 0; bin < kHistogramBins; ++bin)
    sum.shares[bin] = static_cast<float>(volumes[bin] / total);
  return sum;
}

}  // namespace curvisplat
