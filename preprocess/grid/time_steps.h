// Which of several time steps is opened.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>

#include "preprocess/grid/grid_source.h"

namespace curvisplat {

/// The step that was asked for, or the first. Throws Error if `file` has no such step; one without times has
/// a single one.
uint32_t chosenTimeStep(const std::string& file, std::span<const double> times,
                        std::optional<uint32_t> asked);

/// What a person should know who has not chosen between several steps: "has 3 time steps from 0 to 2.5; the
/// first is taken: choose with --time-step 0..2". Nothing if there is no choice, or if it was made.
std::optional<std::string> timeStepNote(const GridDescription& description, std::optional<uint32_t> asked);

}  // namespace curvisplat
