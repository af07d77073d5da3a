// Completion of command lines in bash, from the same table of options as --help.
#pragma once

#include <CLI/CLI.hpp>
#include <string>

namespace curvisplat {

/// A script for bash-completion's folder, or to be sourced: completes subcommands, options, the values of
/// options that have only some, and files elsewhere.
std::string bashCompletion(const CLI::App& program);

}  // namespace curvisplat
