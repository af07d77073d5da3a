// Decodes the bytes of a chunk of a Zarr array. Any thread.
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "preprocess/formats/netcdf/zarr_array.h"

namespace curvisplat {

/// The bytes that the codecs of `array` have made `bytes` of. Throws Error, with `place`, if they are damaged, or not
/// exactly as many as the array's chunks have: of values of variable length, at most 16 MiB.
std::vector<std::byte> decodedZarr(const ZarrArray& array, std::vector<std::byte> bytes,
                                   const std::string& place);

}  // namespace curvisplat
