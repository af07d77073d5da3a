// Manual pages (man 1) of the program and of its subcommands, from the same table of options as --help.
#pragma once

#include <CLI/CLI.hpp>
#include <string>

namespace curvisplat {

/// The page of the whole program, which names the subcommands. Subcommands without a group are hidden.
std::string programManual(const CLI::App& program);
/// The page of one subcommand.
std::string commandManual(const CLI::App& program, const CLI::App& command);

}  // namespace curvisplat
