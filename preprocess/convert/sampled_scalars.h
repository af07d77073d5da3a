// Facts about scalars from a sample of a conversion's splats: how their values are coded, and by which bins
// their percentiles are counted.
#pragma once

#include <cstddef>
#include <vector>

#include "preprocess/convert/value_sample.h"
#include "stream/cache/value_histogram.h"
#include "stream/codec/values_codec.h"

namespace curvisplat {

struct SampledScalars {
  std::vector<ValueCoding> codings;  // [variable]
  std::vector<HistogramBins> bins;   // [variable]

  SampledScalars() = default;
  SampledScalars(const ValueSample& sample, size_t variables, ValuePrecision precision) {
    for (size_t v = 0; v < variables; ++v) {
      codings.push_back({precision, sample.spreadOf(v)});
      bins.push_back(sample.binsOf(v));
      bins.back().coding = codings.back();
    }
  }

  /// Divides the histograms by the sample's bins. Call it before any leaf is added.
  void divide(HistogramSums& histograms) const {
    for (size_t v = 0; v < bins.size(); ++v) histograms.divide(v, bins[v]);
  }
};

}  // namespace curvisplat
