// Where the values streams of new variables or steps go.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "stream/cache/value_histogram.h"
#include "stream/codec/brick_codec.h"

namespace curvisplat {

class ValuesWriter {
 public:
  /// `variables`: the new ones, or those of the step, with their ranges.
  ValuesWriter(const RootCube& root, const std::vector<VariableInfo>& variables)
      : histograms_(root, variables) {}
  virtual ~ValuesWriter() = default;
  /// Appends a brick's streams, one per variable. Each brick comes once, in the order of conversion.
  virtual void append(uint32_t brick, std::span<const EncodedValues> values) = 0;

  /// For the histograms of the variables, which are written if every leaf was added. Any thread may add.
  HistogramSums& histograms() { return histograms_; }

 private:
  HistogramSums histograms_;
};

}  // namespace curvisplat
