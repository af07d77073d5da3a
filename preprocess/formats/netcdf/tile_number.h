// The number of a tile in the name of its file.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>

namespace curvisplat {

/// The number in "NAME.tile3.nc" or "tile3.nc"; nullopt if the name has none.
std::optional<uint32_t> tileNumber(const std::filesystem::path& path);

}  // namespace curvisplat
