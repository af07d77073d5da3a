// Options that choose time steps of a cache, shared by the subcommands that read one.
#pragma once

#include <CLI/CLI.hpp>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "stream/cache/cache_reader.h"

namespace curvisplat {

/// Command-line arguments as given; checked and parsed later.
struct StepArguments {
  std::optional<uint64_t> step;
  std::optional<std::string> time, steps;
  bool interpolates = false;

  bool severalSteps() const { return steps.has_value(); }
};

/// Adds --step and --time under the heading `group`.
void addStepOptions(CLI::App& command, StepArguments& arguments, const std::string& group);
/// Adds --steps, of which each is a frame.
void addStepsOption(CLI::App& command, StepArguments& arguments, const std::string& group);

/// Adds --interpolate.
void addInterpolateOption(CLI::App& command, StepArguments& arguments, const std::string& group);

/// What to draw, in order: one, unless --steps was given. Throws UsageError if options contradict each other or the
/// cache has no such step.
std::vector<StepPosition> chosenSteps(const StepArguments& arguments, const CacheReader& cache);

/// The cache at the first of its chosen steps. Throws Error as CacheReader.
CacheReader openAtStep(const std::filesystem::path& path, const StepArguments& arguments);

}  // namespace curvisplat
