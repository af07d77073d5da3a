#include "preprocess/survey/cell_survey.h"

#include <tbb/blocked_range.h>

#include <algorithm>
#include <array>
#include <glm/common.hpp>

#include "preprocess/grid/hexahedron.h"
#include "preprocess/grid/parallel.h"
#include "preprocess/grid/slabs.h"
#include "preprocess/survey/grid_checksum.h"
#include "stream/base/mutex.h"
#include "stream/base/trace.h"

namespace curvisplat {
namespace {

constexpr size_t kNodesPerTask = 16384;

/// Adds a cell to the survey. Returns whether the cell is drawn.
bool addCell(const NodeArrays& nodes, size_t at, size_t row_stride, size_t plane_stride, GridSurvey& survey) {
  ++survey.nodes;
  const uint8_t own = nodes.blank[at];
  if ((cornerMarks(nodes.blank.data(), at, row_stride, plane_stride) & kNoNode) || (own & kNoValue)) {
    ++survey.blanked.by_grid;
    return false;
  }
  if (own & kBlankValue) {
    ++survey.blanked.by_value;
    return false;
  }
  if (own & kValueNotFinite) {
    ++survey.blanked.not_finite;
    return false;
  }
  for (const glm::dvec3& corner :
       cornersAt(nodes.x.data(), nodes.y.data(), nodes.z.data(), at, row_stride, plane_stride)) {
    survey.lower = glm::min(survey.lower, corner);
    survey.upper = glm::max(survey.upper, corner);
  }
  for (size_t scalar = 0; scalar < survey.ranges.size(); ++scalar) {
    const double value = nodes.scalars[scalar][at];
    survey.ranges[scalar].min = std::min(survey.ranges[scalar].min, value);
    survey.ranges[scalar].max = std::max(survey.ranges[scalar].max, value);
  }
  return true;
}

}  // namespace

GridSurvey surveyCells(const NodeReader& reader, uint64_t slab_bytes, const SurveyExtras& extras,
                       Progress& progress) {
  AbuttingFaces* const faces = extras.faces;
  Mutex adding_faces;  // guards *faces
  GridSurvey nothing;
  nothing.ranges.resize(reader.scalars());
  GridSurvey survey = nothing;
  GridChecksum checksum;
  SlabStream slabs(reader, slab_bytes, kCornerHalo);
  while (const LoadedSlab* loaded = slabs.next()) {
    const Slab& slab = loaded->slab;
    const NodeArrays& nodes = loaded->nodes;
    const GridBlock& block = reader.source().description().blocks[slab.block];
    const WindowStrides strides(slab.window, block.ni);
    const uint64_t rows = slab.box.j1 - slab.box.j0, row_nodes = slab.box.rowNodes(block.ni);
    const auto add_ends = [&](const std::array<uint64_t, 3>& cell, size_t at,
                              std::vector<AbuttingFaces::Centre>& ends) {
      for (int axis = 0; axis < 3; ++axis)
        for (const bool upper : {false, true})
          if (const CellFace face{slab.block, cell, axis, upper}; faces->isAtEnd(face))
            ends.push_back(faces->centreOf(face, cornersAt(nodes.x.data(), nodes.y.data(), nodes.z.data(), at,
                                                           strides.row, strides.plane)));
    };
    const auto add_row = [&](size_t row, GridSurvey& to, std::vector<AbuttingFaces::Centre>& ends) {
      const uint64_t j = slab.box.j0 + row % rows, k = slab.box.k0 + row / rows;
      if (j + 1 == block.nj || k + 1 == block.nk) return;
      const bool row_at_end = j == 0 || j + 2 == block.nj || k == 0 || k + 2 == block.nk;
      size_t at = strides.at(slab.box.i0, j, k);
      for (uint64_t i = slab.box.i0; i < slab.box.i1 && i + 1 < block.ni; ++i, ++at) {
        const bool is_there = addCell(nodes, at, strides.row, strides.plane, to);
        const bool at_end = row_at_end || i == 0 || i + 2 == block.ni;
        if (faces && is_there && at_end) add_ends({i, j, k}, at, ends);
      }
    };
    // Counts, minima and maxima do not depend on how the work is divided.
    survey = unitedSurvey(
        std::move(survey),
        parallelReduce(
            tbb::blocked_range<size_t>(0, rowsOf(slab.box), kNodesPerTask / row_nodes + 1), nothing,
            [&](const tbb::blocked_range<size_t>& range, GridSurvey of_range) {
              const TraceScope trace("scan cells");
              std::vector<AbuttingFaces::Centre> ends;
              for (size_t row = range.begin(); row < range.end(); ++row) add_row(row, of_range, ends);
              if (!ends.empty()) {
                const MutexLock lock(adding_faces);
                faces->add(ends);
              }
              return of_range;
            },
            unitedSurvey));
    checksum.add(*loaded, block);
    if (extras.sample) extras.sample->add(*loaded, block);
    progress.advance(rowsOf(slab.box) * row_nodes);
  }
  survey.grid_checksum = checksum.value();
  return survey;
}

}  // namespace curvisplat
