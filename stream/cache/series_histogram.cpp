#include "stream/cache/series_histogram.h"

#include <algorithm>
#include <array>

#include "stream/cache/cache_file.h"
#include "stream/cache/cache_format.h"
#include "stream/cache/steps_file.h"

namespace curvisplat {
namespace {

/// Adds a step's bins to those between `lower` and `upper`.
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

/// Nothing if it has none.
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
