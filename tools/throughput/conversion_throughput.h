// Measures conversion: writes an analytic grid to a temporary folder, converts it, and removes everything.
//
//   conversion/cold/rate            nodes/s; grid files evicted from the page cache before each run
//   conversion/warm/rate            the same where they cannot be evicted
//   conversion/cold/phase/scatter   s, one measurement per phase
//   conversion/cold/peak_memory     B, peak of the process during the conversion
#pragma once

#include <cstdint>
#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "preprocess/convert/convert.h"
#include "preprocess/scenes/scenes.h"
#include "render/annotate/plot.h"
#include "stream/base/progress.h"
#include "tools/throughput/measurements.h"

namespace curvisplat {

struct ConversionEffort {
  uint64_t nodes = 8'000'000;  // approximate
  uint64_t memory_bytes = 0;   // as in ConvertOptions
  unsigned threads = 0;
  std::filesystem::path temporary_folder;  // must exist
  double repeat_s = 30;                    // repeats the conversion until this time has passed
  unsigned max_runs = 3;                   // or this many runs are done
};

struct ConversionReport {
  SceneGridSize size;
  bool cold = false;  // the grid's files were not in the page cache when a run began
  ConvertReport last;
  std::vector<Progress::Phase> phases;  // of the median run by time
  uint64_t peak_memory_bytes = 0;       // 0 where the system cannot reset the peak

  uint64_t nodes() const { return size.ni * size.nj * size.nk; }
};

/// Size of a nearly cubic grid of about `nodes` nodes, at least 8 per side.
SceneGridSize sizeOfGrid(uint64_t nodes);
/// Upper bound of the disk space, in bytes, for the grid, temporary files and cache together.
uint64_t diskBytesFor(uint64_t nodes);

/// Adds the measurements to `to`. Removes everything it wrote, also when it throws. Throws Interrupted, and
/// Error (before any work if the disk has too little space).
ConversionReport measureConversion(const ConversionEffort& effort, Measurements& to, Progress& progress);

/// One row per phase.
std::string conversionTable(const ConversionReport& report);
/// Total rate with its spread, memory and disk space.
std::string conversionSummary(const ConversionReport& report, const Measurements& measurements);
/// conversion.png
Plots conversionPlots(const ConversionReport& report);
nlohmann::ordered_json toJson(const ConversionReport& report);

}  // namespace curvisplat
