// The subcommands. Each function adds one to the application: its options, and a callback that does the work
// and throws Error on failure.
#pragma once

#include <CLI/CLI.hpp>

namespace curvisplat {

void addConvert(CLI::App& app);
void addInfo(CLI::App& app);
void addRender(CLI::App& app);
void addView(CLI::App& app);
void addServe(CLI::App& app);
void addBench(CLI::App& app);
void addGenerate(CLI::App& app);
void addCompare(CLI::App& app);
void addColormaps(CLI::App& app);
void addExport(CLI::App& app);
/// The last one: it knows those before it.
void addManual(CLI::App& app);

}  // namespace curvisplat
