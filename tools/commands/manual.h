// Describes the program's subcommands and options for manual pages and completion (manual.cpp), and for
// messages about unknown subcommands (main.cpp). Pure functions of CLI11's table of options, for any thread.
#pragma once

#include <CLI/CLI.hpp>

#include <string>
#include <vector>

namespace curvisplat {

/// The subcommands that are listed by --help.
std::vector<const CLI::App*> shownCommands(const CLI::App& program);
/// The words that are allowed as the option's value; empty if other values are allowed, too.
std::vector<std::string> choicesOf(const CLI::Option& option);
/// The placeholder of the option's value: "NUMBER", "big|little"; empty for a flag.
std::string valueName(const CLI::Option& option);

}  // namespace curvisplat
