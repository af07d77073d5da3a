// The options that say how grid files are written, shared by the subcommands that read grids.
#pragma once

#include <CLI/CLI.hpp>

#include "preprocess/formats/derived/derived_source.h"
#include "preprocess/formats/open/open_grid.h"

namespace curvisplat {

/// Adds --time-step, --byte-order, --records, --precision, --blocks, --iblank, --ascii and --binary to `app`;
/// parsing sets options.time_step and options.force. Adds --sphere, --flat and --vertical-scale, which set
/// options.globe. `options` must live until then.
void addGridOptions(CLI::App& app, OpenGridOptions& options);

/// Adds --gamma and --gas-constant.
void addGasOptions(CLI::App& app, GasModel& gas);

/// What openGrid() gives, with the scalars that can be derived from it.
std::unique_ptr<GridSource> openWithDerived(const OpenGridOptions& grid, const DerivedOptions& derived);

}  // namespace curvisplat
