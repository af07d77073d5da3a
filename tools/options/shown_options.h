// What manual pages and completion tell of the program's options.
#pragma once

#include <CLI/CLI.hpp>
#include <string>
#include <vector>

namespace curvisplat {

/// The subcommands that are listed by --help.
std::vector<const CLI::App*> shownCommands(const CLI::App& program);
/// The values that an option or argument may have, if it is one of some words; else nothing.
std::vector<std::string> choicesOf(const CLI::Option& option);
/// What stands for the value: "NUMBER", "big|little"; empty for a flag.
std::string valueName(const CLI::Option& option);

}  // namespace curvisplat
