// Names for threads, as debuggers and top show them.
#pragma once

namespace curvisplat {

/// At most 15 characters.
void nameThisThread(const char* name);

}  // namespace curvisplat
