// A sample of a conversion's splats, the larger ones the likelier: what the bins of a scalar's histogram
// (stream/cache/value_histogram.h) and the codes of its values (stream/codec/values_codec.h) follow.
//
// Each splat has a priority, a number from 0 to 1 that is a hash of its node over its weight, and the sample is
// those with the smallest. So it depends on the splats alone, not on their order, threads, ranks or
// interruptions, and of a small grid it has every splat. A splat stands for a volume of 1 / threshold, or for its own
// weight where that is more (N. Duffield, C. Lund, M. Thorup, Priority sampling for estimation of arbitrary subset
// sums, JACM 2007).
#pragma once

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "stream/base/mutex.h"
#include "stream/base/ranks.h"
#include "stream/cache/value_histogram.h"
#include "stream/codec/values_codec.h"
#include "stream/model/splats.h"

namespace curvisplat {

class ValueSample {
 public:
  static constexpr size_t kSplats = 32768;

  /// Takes fewer splats if there are very many variables, so that the sample stays below 16 MiB.
  explicit ValueSample(size_t variables)
      : columns_(kValues + variables), splats_(std::min(kSplats, kMaxNumbers / columns_)) {}

  /// The splats that one thread adds.
  class Adder {
   public:
    explicit Adder(ValueSample& sample) : sample_(&sample) {}
    /// Each splat of the conversion is to be added once.
    void add(uint64_t node, double weight, std::span<const SplatScalar> values);
    /// To be called at the end.
    void flush();

   private:
    ValueSample* sample_;
    std::vector<double> rows_;
  };

  /// The sample so far as numbers, in an order of its own, to be added to another. Not while others add.
  std::vector<double> rows() const;
  /// Any thread.
  void add(std::span<const double> rows);
  /// Gathers, at rank 0, the sample of all ranks; elsewhere the sample stays. All ranks have to call it.
  void gatherFrom(Ranks& ranks);

  /// How a variable's values are spread: from 5 to 95 % of the volume.
  ValueSpread spreadOf(size_t variable) const;
  /// The bins of a variable's histogram, each of 1/4096 of the volume, about.
  HistogramBins binsOf(size_t variable) const;

 private:
  static constexpr size_t kPriority = 0, kNode = 1, kWeight = 2, kValues = 3;  // columns of a row

  struct Weighed {
    float value;
    double weight;
  };
  /// The values of the sample, in order, with the volumes that they stand for; `total` becomes their sum.
  std::vector<Weighed> sorted(size_t variable, double& total) const;
  /// The first rows by priority.
  std::vector<double> smallest(std::span<const double> rows) const;

  static constexpr size_t kMaxNumbers = size_t{1} << 20;

  const size_t columns_, splats_;
  std::atomic<double> threshold_{kNoThreshold};  // no row with a larger priority is in the sample
  static constexpr double kNoThreshold = 1e300;
  mutable Mutex adding_;
  std::vector<double> rows_ GUARDED_BY(adding_);
};

}  // namespace curvisplat
