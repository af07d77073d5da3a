// Facts about single nodes and cells that all files of faces need: which cells are drawn, coordinates as files have them.
// Pure; any thread.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "preprocess/grid/grid_source.h"
#include "preprocess/grid/hexahedron.h"
#include "preprocess/grid/node_reader.h"
#include "stream/model/grid_faces.h"

namespace curvisplat {

/// [axis] the axes u and v of a face across it.
inline constexpr std::array<std::array<size_t, 2>, 3> kFaceAxes{{{1, 2}, {0, 2}, {0, 1}}};

/// Whether a cell of cell-centred data is drawn: all corners are there, and it has a value.
inline bool cellIsThere(const NodeArrays& nodes, size_t at, size_t row_stride, size_t plane_stride) {
  return !(cornerMarks(nodes.blank.data(), at, row_stride, plane_stride) & kNoNode) &&
         !(nodes.blank[at] & (kNoValue | kBlankValue | kValueNotFinite));
}

/// A coordinate in steps of the box.
inline uint32_t faceCode(const FaceBox& box, double at, int axis) {
  if (!(box.step[axis] > 0)) return 0;
  const double steps = std::nearbyint((at - box.lower[axis]) / box.step[axis]);
  return static_cast<uint32_t>(std::clamp(steps, 0.0, double{FaceBox::kSteps}));
}

}  // namespace curvisplat
