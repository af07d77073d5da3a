// What a frame of Dear ImGui looks like, as a number.
#pragma once

#include <cstdint>

struct ImDrawData;

namespace curvisplat {

/// Two frames that look the same have the same number, and others almost certainly not, as long as no texture's contents
/// change: of those it knows only which are used.
uint64_t appearanceOf(const ImDrawData& frame);

}  // namespace curvisplat
