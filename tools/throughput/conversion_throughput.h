// How fast this machine converts: an analytic grid is written to a temporary folder, converted, and removed.
//
//   conversion/cold/rate            nodes/s; the grid's files out of the page cache when it begins, looked at
//   conversion/warm/rate            where they cannot be got out of it
//   conversion/cold/phase/scatter   s
//   conversion/cold/peak_memory     B, of the process while it converts
#pragma once

#include <cstdint>
#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "preprocess/convert/convert.h"
#include "preprocess/scenes/scenes.h"
#include "stream/base/progress.h"
#include "tools/throughput/measurements.h"
#include "tools/throughput/plot.h"

namespace curvisplat {

struct ConversionEffort {
  uint64_t nodes = 8'000'000;  // about
  uint64_t memory_bytes = 0;   // as ConvertOptions has it
  unsigned threads = 0;
  std::filesystem::path temporary_folder;  // exists
  double repeat_s = 30;                    // converts again while it has not taken so long,
  unsigned most_runs = 3;                  // and not more often
};

struct ConversionReport {
  SceneGridSize size;
  bool cold = false;  // the grid's files were, at the start of each run
  ConvertReport last;
  std::vector<Progress::Phase> phases;  // of the run in the middle by its time
  uint64_t peak_memory_bytes = 0;       // 0 where the system cannot tell it of the conversion alone

  uint64_t nodes() const { return size.ni * size.nj * size.nk; }
};

/// The grid of about so many nodes: nearly a cube, 8 a side at least.
SceneGridSize sizeOfGrid(uint64_t nodes);
/// What the grid, the conversion's temporary files and the cache may take on the disk together.
uint64_t diskBytesFor(uint64_t nodes);

/// Adds to `to`. Whatever happens, what it wrote is gone when it returns or throws: Error (before any work
/// where the folder has too little space), Interrupted.
ConversionReport measureConversion(const ConversionEffort& effort, Measurements& to, Progress& progress);

/// A row a phase.
std::string conversionTable(const ConversionReport& report);
/// Rate, memory and disk over all phases, with the spread of the rate.
std::string conversionSummary(const ConversionReport& report, const Measurements& measurements);
/// conversion.png
Plots conversionPlots(const ConversionReport& report);
nlohmann::ordered_json toJson(const ConversionReport& report);

}  // namespace curvisplat
