// A build without io_uring: makeUringReads() of async_reads.h.
#include "stream/paging/async_reads.h"

namespace curvisplat {

std::unique_ptr<AsyncReads> makeUringReads(unsigned) {
  return nullptr;
}

}  // namespace curvisplat
