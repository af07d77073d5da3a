// The options that say how grid files are written, shared by the subcommands that read grids.
#pragma once

#include <CLI/CLI.hpp>

#include "preprocess/open_grid.h"

namespace curvisplat {

/// Adds --byte-order, --records, --precision, --blocks, --iblank, --ascii and --binary to `app`; parsing sets
/// options.force. Adds --sphere, --flat and --vertical-scale, which set options.globe. `options` must live
/// until then.
void addGridOptions(CLI::App& app, OpenGridOptions& options);

}  // namespace curvisplat
