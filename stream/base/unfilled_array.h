// An array whose values are written before they are read. A vector fills what it is resized to with zeros, by one thread, which then
// takes the page faults of all of it.
#pragma once

#include <cstddef>
#include <memory>
#include <span>

namespace curvisplat {

template <typename T>
class UnfilledArray {
 public:
  /// Values are lost. Memory is kept for later sizes, and freed before more is taken.
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

}  // namespace curvisplat
