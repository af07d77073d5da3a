// Names threads, for debuggers and top.
#pragma once

namespace curvisplat {

/// `name`: at most 15 characters.
void nameThisThread(const char* name);

}  // namespace curvisplat
