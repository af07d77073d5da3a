// A grid under another description than its reader gives: of a decompressed file, or of one of a series.
#pragma once

#include <functional>
#include <memory>
#include <string>

#include "preprocess/grid/grid_source.h"
#include "preprocess/mesh/mesh_source.h"

namespace curvisplat {

/// Changes the text of an error.
using ErrorText = std::function<std::string(std::string)>;

/// `source` under `description`, which has the same blocks or pieces and the same scalars. Errors are rethrown with
/// what `text` makes of theirs, unless it is empty.
std::unique_ptr<GridSource> described(std::unique_ptr<GridSource> source, GridDescription description,
                                      ErrorText text = {});
/// The same of a grid of either kind.
std::unique_ptr<DataSource> described(std::unique_ptr<DataSource> source, GridDescription description,
                                      ErrorText text = {});

}  // namespace curvisplat
