// Files that stand for others: files that are compressed as a whole (gzip, xz, zstd), and lists of the files
// of time steps. Each function finds the real files and has `open` open them; messages and the description
// name the files that the user gave. Any thread may call them.
#pragma once

#include <functional>
#include <memory>
#include <vector>

#include "preprocess/formats/common/open_grid_options.h"
#include "preprocess/formats/common/unpacked_file.h"
#include "preprocess/grid/grid_source.h"
#include "stream/base/file.h"

namespace curvisplat {

/// Decompresses the compressed files of `options` into temporary files (common/unpacked_file.h) and opens
/// the grid with `open`; if there are none, only opens the grid. Messages and the description name the
/// compressed files. Throws Error.
std::unique_ptr<DataSource> openUnpacked(
    OpenGridOptions options, const std::function<std::unique_ptr<DataSource>(const OpenGridOptions&)>& open);

/// Whether the file's name ends in .series.
bool isFileSeries(const InputFile& file);

/// Opens the file of the chosen time step of a file series of ParaView (.vtk.series, .vts.series,
/// .vtm.series) with `open`: JSON that lists the files of the time steps. Throws Error.
///
///   {"file-series-version": "1.0", "files": [{"name": "a_0.vts", "time": 0.5}, ...]}
std::unique_ptr<DataSource> openFileSeries(
    const OpenGridOptions& options,
    const std::function<std::unique_ptr<DataSource>(const OpenGridOptions&)>& open);

}  // namespace curvisplat
