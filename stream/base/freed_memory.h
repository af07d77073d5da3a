// Gives memory that was freed back to the system, so that the next pass of a conversion has all of its budget.
//
// glibc keeps freed blocks for later ones, of up to 32 MiB if blocks of that size were freed once. Between buffers of different
// sizes that left 30 MiB unused where 256 were allowed; from the first call on, large blocks are the system's again as soon as
// they are freed.
#pragma once

#include <cstddef>

namespace curvisplat {

/// For the whole process. `large`: bytes of a large block; the last call's holds. Any thread.
void returnFreedMemory(size_t large = size_t{4} << 20);

/// From now on malloc makes no more heaps (arenas) than `most`, for the whole process. It makes one for each thread otherwise, which
/// keeps what the threads free, and malloc_trim() does not return its end. To be called before other threads begin: the heaps of
/// those that have begun stay.
void limitHeaps(int most);

/// Of conversions, for limitHeaps(). With a heap for each of 16 threads, one took 576 to 590 MiB of 512; with two 496, in the same time.
inline constexpr int kHeapsOfConversion = 2;

/// Empties a vector and frees its memory. `values = {}` does not: that assigns no elements, and the capacity stays.
template <typename Vector>
void freeMemory(Vector& values) {
  Vector().swap(values);
}

}  // namespace curvisplat
