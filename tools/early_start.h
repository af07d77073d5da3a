// Prepares the process before the libraries that it loads have begun.
#pragma once

namespace curvisplat {

/// Called once, before the initialisers of all libraries where the system can do that, else among them. main.cpp has it.
void beforeLibraries();

/// Gives threads the system's stack size again. Until main() calls this, stacks are small, so that libraries
/// that start threads when they are loaded (log4cplus, which OpenVDB needs) take little of a small limit.
void endLoadingOfLibraries();

}  // namespace curvisplat
