// Reads a whole cache and looks for what opening it does not: damaged payloads, and an octree that does not
// keep what it stands for. For `info --verify` and for tests.
#pragma once

#include <string>
#include <vector>

#include "stream/base/progress.h"
#include "stream/cache/cache_reader.h"

namespace curvisplat {

struct CacheVerification {
  std::vector<std::string> findings;  // what is wrong, a line each, at most 100; none for a sound cache
  std::vector<std::string> notes;     // what could not be checked, and why
};

/// Decodes every brick. Checks
///   every payload   its checksum, that it decodes, and that it keeps to its record: box, octants (an inner
///                   brick's splats in their order), largest radius, range, slope, deviation
///   leaves          node runs that hold as many nodes as there are splats, within the manifest's blocks
///   inner bricks    that their weights sum to their children's, 1e-3 relative
///   the cache       that the weights sum to the manifest's volume; bricks.vdb against bricks.bin
CacheVerification verifyCache(const CacheReader& reader, Progress* progress = nullptr);

}  // namespace curvisplat
