// What `curvisplat bench` says in the end: tables for a terminal and plots, from the measurements by their
// names. Pure.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "tools/throughput/frame_throughput.h"
#include "tools/throughput/measurements.h"
#include "tools/throughput/plot.h"
#include "tools/throughput/verdict.h"

namespace curvisplat {

/// A table of rates: a row a way of reading, a column a size or a depth.
std::string diskTable(const Measurements& measurements);
/// A row a stage: on one thread, on all, and what one of those gives.
std::string stageTable(const Measurements& measurements, unsigned threads);
/// A row a configuration.
std::string frameTable(std::span<const FramesOfConfiguration> frames, const Measurements& measurements);
/// What was left out, and why; rows with the same reason together. Empty if nothing was.
std::string leftOutTable(const Measurements& measurements);

/// disk.png, stages.png and frames.png; none of what was not measured.
Plots throughputPlots(const Measurements& measurements, std::span<const FramesOfConfiguration> frames,
                      unsigned threads);

/// The verdict on the finest frame that was drawn; nothing where stages or frames are missing. `draws_apart`
/// and `draw_stage`: whether a graphics card draws, and the name of its measurement.
std::optional<Verdict> verdictOf(const Measurements& measurements,
                                 std::span<const FramesOfConfiguration> frames, unsigned threads,
                                 bool draws_apart, const std::string& draw_stage);

}  // namespace curvisplat
