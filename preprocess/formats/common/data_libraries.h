// HDF5, NetCDF, CGNS, PROJ and Blosc. A plug-in, curvisplat-formats.so (tools/formats), links them. It is loaded
// when one of their functions is first called: with the 40 libraries that they depend on, they would take
// half of the time in which the program starts.
//
// A source declares the functions that it calls, in the namespace curvisplat, where they hide those of the
// library's header:
//
//   CURVISPLAT_LIBRARY_FUNCTION(nc_open)
//   ... nc_open(path, NC_NOWRITE, &file) ...
#pragma once

#include <atomic>

namespace curvisplat {

/// Loads the libraries, unless they are there. Throws Error if they cannot be loaded. Any thread.
void loadDataLibraries();

/// The address of a function or variable of the libraries, which are loaded first if need be. Throws Error if
/// they cannot be loaded, or have none of this name. Any thread.
void* inDataLibraries(const char* name);

/// A function that is looked up when it is first called. Throws as inDataLibraries() then. Any thread.
template <typename Function>
class LibraryFunction {
 public:
  constexpr explicit LibraryFunction(const char* name) : name_(name) {}

  // NOLINTNEXTLINE(google-explicit-constructor): it stands for the function
  operator Function*() const {
    void* found = found_.load(std::memory_order_relaxed);
    if (!found) found_.store(found = inDataLibraries(name_), std::memory_order_relaxed);
    return reinterpret_cast<Function*>(found);
  }

 private:
  const char* name_;
  mutable std::atomic<void*> found_{nullptr};
};

/// A variable that is looked up whenever its value is needed. Throws as inDataLibraries(). Any thread.
template <typename Value>
class LibraryValue {
 public:
  constexpr explicit LibraryValue(const char* name) : name_(name) {}

  // NOLINTNEXTLINE(google-explicit-constructor): it stands for the variable
  operator Value() const { return *static_cast<const Value*>(inDataLibraries(name_)); }

 private:
  const char* name_;
};

// Two macros, so that `name` is expanded first: a header may define it as the name of one version of the
// function.
#define CURVISPLAT_LIBRARY_FUNCTION(name) CURVISPLAT_LIBRARY_FUNCTION_OF(name)
#define CURVISPLAT_LIBRARY_FUNCTION_OF(name) inline const LibraryFunction<decltype(::name)> name{#name};
#define CURVISPLAT_LIBRARY_VALUE(name) inline const LibraryValue<decltype(::name)> name{#name};

}  // namespace curvisplat
