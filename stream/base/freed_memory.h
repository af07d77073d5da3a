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

/// From now on all threads allocate from the first heap, for the whole process. To be called before other threads begin: those
/// that have allocated keep the heaps that malloc has made for them, whose ends malloc_trim() does not return. A server whose three
/// viewers of 96 MiB had left kept up to 480 MiB in such heaps. A picture takes the same time with one (on two cores).
void allocateFromOneHeap();

/// Empties a vector and frees its memory. `values = {}` does not: that assigns no elements, and the capacity stays.
template <typename Vector>
void freeMemory(Vector& values) {
  Vector().swap(values);
}

}  // namespace curvisplat
