// A grid whose files are compressed as a whole: gzip, xz, zstd (common/unpacked_file.h).
#pragma once

#include <functional>
#include <memory>
#include <vector>

#include "preprocess/formats/common/open_grid_options.h"
#include "preprocess/formats/common/unpacked_file.h"
#include "preprocess/grid/grid_source.h"

namespace curvisplat {

/// Decompresses the compressed ones among the files of `options` and opens the grid with `open`; without any,
/// that alone. Messages and the description name the compressed files. Throws Error.
std::unique_ptr<DataSource> openUnpacked(
    OpenGridOptions options, const std::function<std::unique_ptr<DataSource>(const OpenGridOptions&)>& open);

}  // namespace curvisplat
