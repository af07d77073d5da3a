// A machine that has no threads left (ulimit -u, ulimit -v): an error of one line and exit status 1, wherever
// that shows. Libraries start threads before main() and in places where no exception may leave.
#pragma once

namespace curvisplat {

/// Gives threads the system's stack size again. Until main() calls this, stacks are small, so that libraries
/// that start threads when they are loaded (log4cplus, which OpenVDB needs) take little of a small limit.
void endLoadingOfLibraries();

}  // namespace curvisplat
