#include "stream/vdb/vdb_library.h"

#include <dlfcn.h>

#include <string>

#include "stream/base/error.h"
#include "stream/base/os.h"
#include "stream/base/plugin.h"
#include "stream/base/threads.h"

namespace curvisplat {
namespace {

/// Throws Error if this process cannot have the threads and the memory that libopenvdb's log4cplus takes while it is loaded: where one
/// is missing, it ends the process, or leaves it waiting for ever.
void requireRoomForLibrary() {
  constexpr unsigned kThreads = 8;             // it starts 4
  constexpr size_t kBytes = size_t{96} << 20;  // with all that it links it maps 56 MiB
  if (errorOfThreads(kThreads, kBytes) != 0)
    throw Error(
        "cannot start a thread: the system has none left; raise the limits of processes and memory (ulimit "
        "-u, ulimit -v)");
}

// The library has 70,000 symbols to look up, of which most are its own. Found there first, and not in each of the program's 80 libraries,
// they take half the time: 35 ms instead of 75. Sanitizers do not allow it.
int ownSymbolsFirst() {
#ifdef CURVISPLAT_SANITIZED
  return 0;
#else
  return os::ownSymbolsFirst();
#endif
}

const VdbFunctions& loadFunctions() {
  requireRoomForLibrary();
  constexpr const char* kName = "curvisplat-vdb.so";
  std::string why_not;
  void* const module = openPlugin(kName, RTLD_NOW | RTLD_LOCAL | ownSymbolsFirst(), why_not);
  using Entry = const VdbFunctions* (*)(const char*);
  const auto entry = module ? reinterpret_cast<Entry>(::dlsym(module, "curvisplatVdb")) : nullptr;
  const VdbFunctions* const functions = entry ? entry(CURVISPLAT_VERSION) : nullptr;
  if (module && !functions) why_not = "it is of another version than the program";
  if (!functions)
    throw Error("OpenVDB is needed and cannot be loaded: {}: {}; {}", kName, why_not, pluginAdvice(why_not));
  return *functions;
}

const VdbFunctions& functions() {
  static const VdbFunctions& loaded = loadFunctions();
  return loaded;
}

}  // namespace

std::vector<std::byte> brickGridsFile(const RootCube& root, std::span<const Brick> bricks) {
  return functions().brick_grids_file(root, bricks);
}

uint64_t brickGridsMemory(std::span<const Brick> bricks) {
  return functions().brick_grids_memory(bricks);
}

BrickGridsComparison compareBrickGrids(std::span<const std::byte> bytes, const RootCube& root,
                                       std::span<const Brick> bricks, uint64_t most_memory) {
  return functions().compare_brick_grids(bytes, root, bricks, most_memory);
}

std::unique_ptr<CountingGrid> makeCountingGrid(uint32_t level, uint64_t memory_bytes) {
  return functions().make_counting_grid(level, memory_bytes);
}

std::unique_ptr<FogVolume> makeFogVolume(const glm::dvec3& origin, double side) {
  return functions().make_fog_volume(origin, side);
}

}  // namespace curvisplat
