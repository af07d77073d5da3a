// ParaView's file series (.vtk.series, .vts.series, .vtm.series): JSON that lists the files of the time steps.
//
//   {"file-series-version": "1.0", "files": [{"name": "a_0.vts", "time": 0.5}, ...]}
#pragma once

#include <functional>
#include <memory>

#include "preprocess/formats/common/open_grid_options.h"
#include "preprocess/grid/grid_source.h"
#include "stream/base/file.h"

namespace curvisplat {

/// Whether the file's name ends in .series.
bool isFileSeries(const InputFile& file);

/// Opens the file of the chosen time step with `open`. Throws Error.
std::unique_ptr<DataSource> openFileSeries(
    const OpenGridOptions& options,
    const std::function<std::unique_ptr<DataSource>(const OpenGridOptions&)>& open);

}  // namespace curvisplat
