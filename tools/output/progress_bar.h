// A bar on the terminal that shows how far a job is, and how long it will take.
#pragma once

#include "stream/base/progress.h"

namespace curvisplat {

/// Draws to standard error; no display if that is not a terminal.
Progress::Display progressBar();

}  // namespace curvisplat
