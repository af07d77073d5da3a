// How a variable's values are spread over the volume of the data: a histogram of the finest splats, which
// lies in the step's file of values, before its table (cache_format.h). A file without one was written by an
// earlier version.
//
//   file of values   ... | values streams | zeros | HistogramRecord | table
//                                                                   ^ table_offset
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

/// A histogram of the finest splats' means, by their share of the volume.
struct ValueHistogram {
  double lower = 0, upper = 0;                 // range of the samples, which the bins divide evenly
  double volume = 0;                           // of all splats, world units cubed
  std::array<float, kHistogramBins> shares{};  // of the volume; the sum is 1

  double binWidth() const { return (upper - lower) / kHistogramBins; }
  /// The value below which the share `part` (0 to 1) of the volume lies, to a bin's width.
  double percentile(double part) const;
};

/// The bin of a mean. Values beyond the ends are in the outermost bins.
size_t histogramBin(double mean, double lower, double upper);

HistogramRecord recordOf(const ValueHistogram& histogram);

/// The histogram that ends at `table_offset` of a file of values; nullopt if there is none. Throws Error if
/// it is damaged.
std::optional<ValueHistogram> readHistogram(const InputFile& file, uint64_t table_offset);

/// How the values of a step are spread, for manifest().variables[variable] of the reader. nullopt between
/// two steps, and for files of earlier versions. Throws Error if the histogram is damaged.
std::optional<ValueHistogram> stepHistogram(const CacheReader& cache, size_t variable);

/// How the values of all steps of a series are spread: the sum of the steps' histograms over the range of
/// the series, each with its volume. The volume of a step's bin is divided evenly among the bins that it
/// overlaps; `volume` is the mean of the steps'. nullopt if a step has no histogram. Opens one file of each
/// step and reads 2 KiB of it. Throws Error if one is damaged.
std::optional<ValueHistogram> seriesHistogram(const CacheReader& cache, size_t variable);

/// The sums of the variables' histograms while a cache is written. Any thread.
class HistogramSums {
 public:
  /// `variables`: with their ranges.
  HistogramSums(const RootCube& root, const std::vector<VariableInfo>& variables);

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
  };
  /// A volume, in integers, so that sums do not depend on the order.
  struct Sum {
    uint64_t whole = 0;  // of the root's volume times 2^-40
    uint64_t part = 0;   // of that times 2^-40; below 2^40

    void add(double units);
    void carry();
  };

  const double per_volume_;  // wholes in a volume of 1
  std::vector<Range> ranges_;
  mutable Mutex summing_;
  std::vector<Sum> sums_ GUARDED_BY(summing_);  // [variable][bin]
};

}  // namespace curvisplat
