// How a variable's values are spread over the volume of the data: a histogram and percentiles of the finest
// splats, which lie in the step's file of values, before its table (cache_format.h). A file without one, or
// without both, was written by an earlier version.
//
//   file of values   ... | values streams | zeros | PercentilesRecord | HistogramRecord | table
//                                                                                       ^ table_offset
//
// The histogram's bins divide the range evenly, which says nothing where a long tail stretches it. Percentiles come
// from bins that follow a sample of the values (HistogramBins): each has about 1/4096 of the volume, which is then counted exactly.
// A mean that was rounded counts for all bins of values that it may have been, by the sample. So a percentile's rank is wrong by a bin's
// share at most, and one between two of the 1001 that are stored by 0.1 %.
//
// It depends on the decoded splats alone: not on threads, memory or ranks, nor on whether the values were
// converted with the geometry, added later or resumed. So sums are of integers, which no order changes. Any
// thread may use all of this.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <type_traits>
#include <vector>

#include "stream/base/file.h"
#include "stream/base/mutex.h"
#include "stream/cache/manifest.h"
#include "stream/codec/values_codec.h"
#include "stream/model/octree.h"
#include "stream/model/splats.h"

namespace curvisplat {

class CacheReader;

inline constexpr uint32_t kHistogramBins = 512;
inline constexpr std::array<char, 8> kHistogramMagic{'C', 'V', 'S', 'h', 'i', 's', 't', 'o'};

/// A histogram as it is on disk.
struct HistogramRecord {
  std::array<char, 8> magic = kHistogramMagic;  //  0
  uint32_t version = 1;                         //  8
  uint32_t bins = kHistogramBins;               // 12
  double lower = 0, upper = 0;                  // 16: range of the samples, which the bins divide evenly
  double volume = 0;                            // 32: sum of the splats' weights, world units cubed
  uint64_t checksum = 0;                        // 40: of the bytes before and behind it
  std::array<float, kHistogramBins> shares{};   // 48: of the volume, of the splats whose means lie in a bin
};                                              // 2096
static_assert(sizeof(HistogramRecord) == 2096 && std::is_trivially_copyable_v<HistogramRecord>);

inline constexpr uint32_t kPercentiles = 1000;
inline constexpr std::array<char, 8> kPercentilesMagic{'C', 'V', 'S', 'p', 'e', 'r', 'c', 't'};

/// Percentiles as they are on disk.
struct PercentilesRecord {
  std::array<char, 8> magic = kPercentilesMagic;  //  0
  uint32_t version = 1;                           //  8
  uint32_t intervals = kPercentiles;              // 12
  uint64_t checksum = 0;                          // 16: of `values`
  std::array<float, kPercentiles + 1> values{};   // 24: values[n]: n / 1000 of the volume is below
  uint32_t reserved = 0;                          // 4028: zero
};                                                // 4032
static_assert(sizeof(PercentilesRecord) == 4032 && std::is_trivially_copyable_v<PercentilesRecord>);

/// A histogram of the finest splats' means, by their share of the volume.
struct ValueHistogram {
  double lower = 0, upper = 0;                 // range of the samples, which the bins divide evenly
  double volume = 0;                           // of all splats, world units cubed
  std::array<float, kHistogramBins> shares{};  // of the volume; the sum is 1
  std::vector<float> percentiles{};            // as in PercentilesRecord; empty: not known

  double binWidth() const { return (upper - lower) / kHistogramBins; }
  /// The value below which the share `part` (0 to 1) of the volume lies; without percentiles to a bin's width.
  double percentile(double part) const;
  /// The share of the volume that lies below `value`, or at it.
  double shareBelow(double value) const;
};

/// Bins that follow the distribution of a variable's values.
struct HistogramBins {
  std::vector<float> edges;    // between bins, increasing; the outermost bins reach to the ends of the range
  std::vector<double> shares;  // about what each has of the volume
  ValueCoding
      coding;  // how means were rounded: each stands for all values that it may have been, by these shares
};

/// The bin of a mean. Values beyond the ends are in the outermost bins.
size_t histogramBin(double mean, double lower, double upper);

HistogramRecord recordOf(const ValueHistogram& histogram);
/// The record of a histogram that has percentiles.
PercentilesRecord percentilesOf(const ValueHistogram& histogram);

/// The histogram that ends at `table_offset` of a file of values; nullopt if there is none. Throws Error if
/// it is damaged.
std::optional<ValueHistogram> readHistogram(const InputFile& file, uint64_t table_offset);

/// How the values of a step are spread, for manifest().variables[variable] of the reader. nullopt between
/// two steps, and for files of earlier versions. Throws Error if the histogram is damaged.
std::optional<ValueHistogram> stepHistogram(const CacheReader& cache, size_t variable);

/// How the values of all steps of a series are spread: the sum of the steps' histograms over the range of
/// the series, each with its volume, and their percentiles as of one step, if all have some. The volume of a
/// step's bin is divided evenly among the bins that it overlaps; `volume` is the mean of the steps'. nullopt if a step has no histogram.
/// Opens one file of each step and reads 6 KiB of it. Throws Error if one is damaged.
std::optional<ValueHistogram> seriesHistogram(const CacheReader& cache, size_t variable);

/// The sums of the variables' histograms while a cache is written. Any thread.
class HistogramSums {
 public:
  /// `variables`: with their ranges.
  HistogramSums(const RootCube& root, const std::vector<VariableInfo>& variables);

  /// Has a variable's percentiles found by these bins; a variable without bins gets none. Call it before any
  /// leaf is added.
  void divide(size_t variable, HistogramBins bins);
  /// Adds a leaf's splats, as decoded. Each leaf is to be added once.
  void add(const BrickSplats& leaf);
  /// Forgets all leaves.
  void clear();
  /// The histogram of a variable. nullopt if no leaf was added, or if their weights sum to 4 million times
  /// the root's volume.
  std::optional<ValueHistogram> of(size_t variable) const;

  /// The sums as words, to be added word by word to those of other processes.
  std::vector<uint64_t> words() const;
  void setWords(std::span<const uint64_t> words);

 private:
  struct Range {
    double lower, upper;
    size_t first_sum;  // in sums_, of the even bins; those of `bins` follow
    HistogramBins bins{};
    std::vector<double> shares_below{};   // [bin], and all
    std::vector<uint32_t> edges_below{};  // [even bin]: how many edges no value in it is below

    size_t sums() const { return kHistogramBins + (bins.edges.empty() ? 0 : bins.edges.size() + 1); }
    size_t binOf(double mean) const;
    void addMean(double mean, double weight, double rounding, std::vector<double>& volumes,
                 std::vector<double>& densities) const;
  };
  /// A volume, in integers, so that sums do not depend on the order.
  struct Sum {
    uint64_t whole = 0;  // of the root's volume times 2^-40
    uint64_t part = 0;   // of that times 2^-40; below 2^40

    void add(double units);
    void carry();
  };

  static double volumeOf(const Sum& sum);
  std::vector<float> percentilesOf(const Range& range) const REQUIRES(summing_);

  const double per_volume_;  // wholes in a volume of 1
  std::vector<Range> ranges_;
  mutable Mutex summing_;
  std::vector<Sum> sums_ GUARDED_BY(summing_);  // [variable][even bin, then bin of `bins`]
};

}  // namespace curvisplat
