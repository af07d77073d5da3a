// Whether a values stream (values_codec.h) has fine means.
#pragma once

#include <cstddef>
#include <span>

namespace curvisplat {

/// Only streams of a cache with the feature kFineValues may have them. Throws Error as stepsBackOf().
bool hasFineMeans(std::span<const std::byte> stream);

}  // namespace curvisplat
