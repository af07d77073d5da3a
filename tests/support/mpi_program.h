// The real curvisplat program as several ranks, started by mpirun.
#pragma once

#include <string>
#include <vector>

#include "tests/support/run_program.h"

namespace curvisplat {

/// "", or why the program cannot be started as several ranks here: tests skip with it.
std::string whyNoRanks();

/// Runs CURVISPLAT_PROGRAM as `count` ranks and waits for them. mpirun's own explanations are left out.
ProgramResult runAsRanks(unsigned count, const std::vector<std::string>& arguments,
                         const std::string& program = CURVISPLAT_PROGRAM);

}  // namespace curvisplat
