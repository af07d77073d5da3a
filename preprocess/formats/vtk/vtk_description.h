// What the grids and the meshes of VTK files have in common to describe.
#pragma once

#include <algorithm>
#include <string>
#include <utility>

#include "preprocess/grid/grid_source.h"

namespace curvisplat {

/// Of a VtkGrid or a VtkMesh, whose warnings it takes, each once: many pieces may give the same one.
template <typename Data>
void describeFiles(Data& data, GridDescription& description) {
  description.format = data.format;
  description.files = data.files;
  description.times = data.times;
  description.time_step = data.time_step;
  for (std::string& warning : data.warnings)
    if (std::find(description.warnings.begin(), description.warnings.end(), warning) ==
        description.warnings.end())
      description.warnings.push_back(std::move(warning));
}

}  // namespace curvisplat
