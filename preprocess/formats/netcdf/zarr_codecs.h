// Decodes the bytes of a chunk of a Zarr array. Any thread.
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "preprocess/formats/netcdf/zarr_array.h"

namespace curvisplat {

/// Decodes `bytes`, a stored chunk, by the codecs of `array`. Throws Error, which names `place`, if they are
/// damaged or do not decode to exactly a chunk's bytes. A chunk of values of variable length may have up to
/// 16 MiB.
std::vector<std::byte> decodedZarr(const ZarrArray& array, std::vector<std::byte> bytes,
                                   const std::string& place);

}  // namespace curvisplat
