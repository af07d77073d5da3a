// The choice between the time steps of a file.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>

#include "preprocess/grid/grid_source.h"

namespace curvisplat {

/// The step that the user chose, or the first. Throws Error if `file` has no such step; a file without times
/// has a single step.
uint32_t chosenTimeStep(const std::string& file, std::span<const double> times,
                        std::optional<uint32_t> asked);

/// A note for users who have not chosen between several steps: "3 time steps from 0 to 2.5; using the first:
/// choose with --time-step 0..2". nullopt if there is a single step, or if the user chose one.
std::optional<std::string> timeStepNote(const GridDescription& description, std::optional<uint32_t> asked);

/// The time that the files state for the open step: that of the step, or that in the Q file's header unless it is 0, which
/// many programs write for all steps.
std::optional<double> statedTime(const GridDescription& description);

}  // namespace curvisplat
