// Ranges of the numbers of an array of several dimensions, as boxes of it: HDF5 reads boxes. Pure: any thread.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>

namespace curvisplat {

inline constexpr size_t kMaxArrayRank = 32;  // as HDF5
inline constexpr uint64_t kMaxArrayValues = uint64_t{1} << 48;

uint64_t arrayProduct(std::span<const uint64_t> counts);

/// Splits a range of numbers into boxes of an array of the given dimensions, as few as possible, and calls
/// use(first, count) for each, in their order. The slowest dimension comes first.
using UseArrayBox = std::function<void(std::span<const uint64_t> first, std::span<const uint64_t> count)>;
void forEachArrayBox(std::span<const uint64_t> dims, uint64_t begin, uint64_t count, const UseArrayBox& use);

}  // namespace curvisplat
