// The checksum of HDF5's structures of version 2: Bob Jenkins' lookup3, of the bytes before it.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>

namespace curvisplat {

uint32_t hdf5Checksum(std::string_view bytes);

/// Where the structure that begins there in `whole` has its checksum at its end, puts that of the same place in
/// `changed` right, and returns true.
bool renewChecksum(std::string_view whole, size_t begin, std::string& changed);

}  // namespace curvisplat
