// Finds files beside the program: plug-ins, which are loaded only when they are needed since the libraries
// that they link would delay each start, and files of a bundle (tools/packaging/bundle.sh).
#pragma once

#include <filesystem>
#include <string>
#include <string_view>

namespace curvisplat {

/// Loads a plug-in by dlopen() with these flags. Looks in the folder of the program (or of the library that contains this
/// function, as in the Python package), then where packages put plug-ins, then where the dynamic linker looks for libraries.
/// Returns nullptr, with the reason in `why_not`, if there is none or it cannot be loaded. Any thread.
void* openPlugin(const char* name, int flags, std::string& why_not);

/// Returns what to do about a plug-in that could not be loaded, for the end of a message: raise the limit of memory, where it is the reason
/// (ulimit -v), else install the program again.
const char* pluginAdvice(std::string_view why_not);

/// A file that a bundle carries, since it must not rely on the system's: share/curvisplat/NAME beside the program's folder, or NAME
/// beside the Python module. Empty outside of bundles. Any thread.
std::filesystem::path bundledFile(const char* name);

}  // namespace curvisplat
