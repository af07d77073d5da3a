// The first pass over an unstructured grid: what is in it. For conversion and for `info`.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "preprocess/gather/mesh_reader.h"
#include "preprocess/survey/grid_survey.h"
#include "stream/base/progress.h"

namespace curvisplat {

struct MeshSurvey {
  GridSurvey grid;                     // samples: points or cells, as the reader's scalars are
  std::array<uint64_t, 6> cells_of{};  // [CellKind]; kNone: hidden ones and those that are not solid
  uint64_t drawn_cells = 0, unused_points = 0;
  uint64_t chunk_bytes = 0;  // of the largest chunk of cells that was read
  std::vector<bool> used;    // [point]: a cell that is drawn has it
};

/// Reads cells, then points. Memory: a bit a point and a few chunks. Throws Error if the files are damaged or if
/// nothing is drawn. Does not depend on threads.
MeshSurvey surveyMesh(const MeshReader& reader, Progress& progress);

}  // namespace curvisplat
