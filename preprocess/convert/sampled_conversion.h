// What conversion of a structured grid will take, from the conversion of a sample of it: for `convert --dry-run`, and for
// sampledNeeds() (convert.h).
#pragma once

#include <cstdint>
#include <filesystem>
#include <vector>

#include "preprocess/convert/convert_options.h"
#include "preprocess/grid/grid_source.h"

namespace curvisplat {

/// Rounded.
uint64_t times(uint64_t count, double factor);

/// How much larger a grid is than its sample.
struct SampleScale {
  double volume = 1, faces = 1;

  /// `options`: those of the whole grid.
  static SampleScale of(const GridDescription& whole, const GridDescription& sample,
                        const ConvertOptions& options);
  /// Of the whole, from the files of the sample's cache.
  uint64_t bytesOf(const std::vector<FileReport>& files) const;
};

/// The options for a sample, which is converted within `folder`.
ConvertOptions optionsOfSample(const ConvertOptions& options, const std::filesystem::path& folder);

}  // namespace curvisplat
