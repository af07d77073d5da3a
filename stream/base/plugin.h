// Plug-ins of the program, which are loaded only when they are needed: the libraries that they link would delay each start.
#pragma once

#include <string>

namespace curvisplat {

/// Loads a plug-in by dlopen() with these flags. Looks in the folder of the program (or of the library that contains this
/// function, as in the Python package), then where packages put plug-ins, then where the dynamic linker looks for libraries.
/// Returns nullptr, with the reason in `why_not`, if there is none or it cannot be loaded. Any thread.
void* openPlugin(const char* name, int flags, std::string& why_not);

}  // namespace curvisplat
