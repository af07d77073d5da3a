#include "preprocess/formats/common/data_libraries.h"

#include <dlfcn.h>

#include <string>

#include "stream/base/error.h"
#include "stream/base/plugin.h"

namespace curvisplat {
namespace {

void* openDataLibraries() {
  constexpr const char* kName = "curvisplat-formats.so";
  std::string why_not;
  void* const module = openPlugin(kName, RTLD_LAZY | RTLD_LOCAL, why_not);
  if (!module)
    throw Error("the libraries of this format are needed and cannot be loaded: {}: {}; {}", kName, why_not,
                pluginAdvice(why_not));
  return module;
}

void* dataLibraries() {
  static void* const loaded = openDataLibraries();
  return loaded;
}

}  // namespace

void loadDataLibraries() {
  dataLibraries();
}

void* inDataLibraries(const char* name) {
  void* const found = ::dlsym(dataLibraries(), name);
  if (!found) throw Error("the libraries of this format have no {}; install curvisplat again", name);
  return found;
}

}  // namespace curvisplat
