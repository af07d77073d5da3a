// Recognises files of other formats by their first bytes, so that an Error can name them.
#pragma once

#include <optional>
#include <string>

#include "stream/base/file.h"

namespace curvisplat {

/// "a gzip archive: unpack it first", "a VTK XML file, which is not read yet"; nothing for what may be
/// PLOT3D.
std::optional<std::string> foreignFormat(const InputFile& file);

}  // namespace curvisplat
