// Runs long work for Python: without the interpreter's lock, with progress, and until Ctrl-C.
#pragma once

#include <pybind11/pybind11.h>

#include <functional>

#include "stream/base/progress.h"

namespace curvisplat::python {

/// Runs `work` in a thread of its own while this one, which must hold the interpreter's lock, waits without it and
/// looks for signals every 50 ms. `report`: None, or a callable that gets (phase, done, total, unit), at most twenty times a
/// second, in this thread. Throws what `work` throws; after Ctrl-C, or if `report` raises, stops the work and throws
/// that Python exception.
void runInterruptibly(const pybind11::object& report, const std::function<void(Progress&)>& work);

}  // namespace curvisplat::python
