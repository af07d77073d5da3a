// Options that describe grid files, shared by the subcommands that read grids.
#pragma once

#include <CLI/CLI.hpp>

#include "preprocess/formats/derived/derived_source.h"
#include "preprocess/formats/open/open_grid.h"

namespace curvisplat {

/// Adds to `app` the options that set the given fields of `options`, which must outlive parsing:
///   options.time_step   --time-step
///   options.force       --byte-order, --records, --precision, --blocks, --iblank, --ascii, --binary
///   options.globe       --sphere, --flat, --vertical-scale
void addGridOptions(CLI::App& app, OpenGridOptions& options);

/// Adds --gamma and --gas-constant.
void addGasOptions(CLI::App& app, GasModel& gas);

/// Opens the grid and adds the scalars that can be derived from its own.
std::unique_ptr<DataSource> openWithDerived(const OpenGridOptions& grid, const DerivedOptions& derived);

}  // namespace curvisplat
