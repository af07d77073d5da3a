// How many threads an option asks for.
#pragma once

#include <algorithm>
#include <thread>

namespace curvisplat {

/// `threads`, or one for each core where it is 0.
inline unsigned threadsOrCores(unsigned threads) {
  return threads > 0 ? threads : std::max(1u, std::thread::hardware_concurrency());
}

}  // namespace curvisplat
