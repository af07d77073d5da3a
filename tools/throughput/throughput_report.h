// The report of `curvisplat bench`: tables for a terminal, plots and a verdict, made from the measurements,
// which are found by name. Pure.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "render/annotate/plot.h"
#include "tools/throughput/frame_throughput.h"
#include "tools/throughput/measurements.h"
#include "tools/throughput/verdict.h"

namespace curvisplat {

/// Rates by way of reading (rows) and by block size or depth (columns).
std::string diskTable(const Measurements& measurements);
/// One row per stage: its rate on one thread and on all threads, and the ratio.
std::string stageTable(const Measurements& measurements, unsigned threads);
/// One row per configuration.
std::string frameTable(std::span<const FramesOfConfiguration> frames, const Measurements& measurements);
/// Measurements that were not made, grouped by reason. Empty if all were made.
std::string leftOutTable(const Measurements& measurements);

/// disk.png, stages.png and frames.png, without those that have no measurement.
Plots throughputPlots(const Measurements& measurements, std::span<const FramesOfConfiguration> frames,
                      unsigned threads);

/// The verdict on the finest frame that was drawn; nullopt if stages or frames were not measured.
///   draws_apart   a graphics card draws, so that drawing takes no time of the cores
///   draw_stage    name of the measurement of drawing
std::optional<Verdict> verdictOf(const Measurements& measurements,
                                 std::span<const FramesOfConfiguration> frames, unsigned threads,
                                 bool draws_apart, const std::string& draw_stage);

}  // namespace curvisplat
