// Reads a whole cache and checks what opening does not: the payloads, and that coarse bricks preserve the
// weight of the bricks that they stand for. For `info --verify` and for tests.
#pragma once

#include <string>
#include <vector>

#include "stream/base/progress.h"
#include "stream/cache/cache_reader.h"

namespace curvisplat {

/// The results of verifyCache().
struct CacheVerification {
  std::vector<std::string> findings;  // errors, one line each, at most 100; empty for an intact cache
  std::vector<std::string> notes;     // checks that were impossible, and why
};

/// Decodes every brick and checks
///
///   every payload   its checksum; that it decodes; that the splats agree with the brick's record: box,
///                   octants (in inner bricks, the splats' order), largest radius, range, slope, deviation
///   leaves          the node runs hold one sample per splat and lie in the manifest's blocks
///   inner bricks    the sum of the weights equals the children's, within 1e-3
///   the cache       the sum of the leaves' weights equals the manifest's volume, within 1e-3; bricks.vdb
///                   agrees with bricks.bin
///   histograms      the shares are those of the leaves' splats, within 1e-5
///   faces.bin       its table; every patch's checksum; that it decodes; that its nodes lie in its box, and the box in
///                   that of its parent
CacheVerification verifyCache(const CacheReader& reader, Progress* progress = nullptr);

}  // namespace curvisplat
