// The entry of curvisplat-vdb.so.
#include "tools/vdb/vdb_plugin.h"

#include <openvdb/openvdb.h>

#include <mutex>
#include <string_view>

namespace curvisplat {

void initializeOpenVdb() {
  static std::once_flag once;
  std::call_once(once, [] { openvdb::initialize(); });
}

}  // namespace curvisplat

/// nullptr if the program that loads it is of another version.
extern "C" __attribute__((visibility("default"))) const curvisplat::VdbFunctions* curvisplatVdb(
    const char* version) {
  using namespace curvisplat;
  static constexpr VdbFunctions kFunctions = {vdb_plugin::brickGridsFile, vdb_plugin::brickGridsMemory,
                                              vdb_plugin::compareBrickGrids, vdb_plugin::makeCountingGrid,
                                              vdb_plugin::makeFogVolume};
  return std::string_view(version) == CURVISPLAT_VERSION ? &kFunctions : nullptr;
}
