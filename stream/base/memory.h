// Memory from the system and back to it, for large buffers: arrays that are not filled with zeros, large
// pages, the return of freed memory, and a test whether a little memory is left.
//
// Nothing here changes what a program computes. An UnfilledArray belongs to one thread at a time; any thread
// may call the functions, but returnFreedMemory() and limitHeaps() set glibc's allocator for the whole
// process.
#pragma once

#include <cstddef>
#include <memory>
#include <span>

namespace curvisplat {

/// An array whose values are written before they are read. (A vector fills itself with zeros, in one thread,
/// which then takes the page faults of all of it.)
template <typename T>
class UnfilledArray {
 public:
  /// Discards the values. Keeps the memory for later sizes, and frees it before it takes more.
  void resize(size_t size) {
    if (capacity_ < size) {
      values_.reset();
      capacity_ = 0;
      values_ = std::make_unique_for_overwrite<T[]>(size);
      capacity_ = size;
    }
    size_ = size;
  }
  size_t size() const { return size_; }
  T* data() { return values_.get(); }
  T& operator[](size_t n) { return values_[n]; }
  std::span<T> span() { return {values_.get(), size_}; }

 private:
  std::unique_ptr<T[]> values_;
  size_t size_ = 0, capacity_ = 0;
};

/// Asks for large pages for the part of a buffer that consists of whole ones. The first touch of each page
/// costs a fault, and a frame's buffers of tens of megabytes cost thousands. Call it before the buffer is
/// written for the first time. It takes no memory beyond the buffer's and never fails: it is only a hint.
void preferHugePages(void* begin, size_t bytes);

/// Gives freed memory back to the system, so that the next pass of a conversion has all of its budget. From
/// the first call on, blocks of at least `large` bytes go back as soon as they are freed; the last call's
/// `large` holds. (glibc keeps freed blocks for later ones, of up to 32 MiB once such blocks were freed:
/// between buffers of different sizes that left 30 MiB unused of a budget of 256.)
void returnFreedMemory(size_t large = size_t{4} << 20);

/// Limits malloc to `most` heaps (arenas) from now on. Otherwise it makes a heap for each thread, which
/// keeps what that thread frees, and malloc_trim() does not return its end. Call it before other threads
/// begin: the heaps of those that have begun stay.
void limitHeaps(int most);

/// The limit that conversions pass to limitHeaps(). With a heap for each of 16 threads, a conversion with a
/// budget of 512 MiB took 576 to 590 MiB; with two heaps it took 496, in the same time.
inline constexpr int kHeapsOfConversion = 2;

/// Empties a vector and frees its memory. `values = {}` does not: that assigns no elements, and the capacity
/// stays.
template <typename Vector>
void freeMemory(Vector& values) {
  Vector().swap(values);
}

/// Throws std::bad_alloc unless these bytes can be mapped now. Maps and unmaps them, which takes some
/// microseconds. To be called before threads begin to work: glibc and other libraries allocate a few bytes
/// when a thread first uses them, and some end the process if they cannot. Under a limit of address space
/// (ulimit -v), buffers that just fit leave nothing for that.
inline constexpr size_t kSpareBytes = size_t{32} << 20;
void requireSpareMemory(size_t bytes = kSpareBytes);

}  // namespace curvisplat
