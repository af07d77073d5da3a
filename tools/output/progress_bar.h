// A progress bar on the terminal: percentage, remaining time and rate.
#pragma once

#include "stream/base/progress.h"

namespace curvisplat {

/// A display that draws to standard error; empty if standard error is not a terminal.
Progress::Display progressBar();

}  // namespace curvisplat
