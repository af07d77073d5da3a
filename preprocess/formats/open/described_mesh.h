// An unstructured grid under another description: of a decompressed file, or of one of a series.
#pragma once

#include <functional>
#include <memory>
#include <string>

#include "preprocess/mesh/mesh_source.h"

namespace curvisplat {

/// The mesh in `source` under `description`; null if it is no mesh. Errors are rethrown with what `message` makes of
/// their text, unless it is empty.
std::unique_ptr<DataSource> describedMesh(std::unique_ptr<DataSource>& source, GridDescription description,
                                          std::function<std::string(std::string)> message = {});

}  // namespace curvisplat
