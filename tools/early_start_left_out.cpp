// A build without glibc's loader: threads keep the system's stack size.
#include "tools/early_start.h"

namespace curvisplat {
namespace {

[[maybe_unused]] const bool prepared = (beforeLibraries(), true);

}  // namespace

void endLoadingOfLibraries() {}

}  // namespace curvisplat
