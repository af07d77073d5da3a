#include "preprocess/faces/face_spool.h"

#include <tbb/blocked_range2d.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "preprocess/faces/blank_faces.h"
#include "preprocess/faces/face_nodes.h"
#include "preprocess/grid/hexahedron.h"
#include "preprocess/grid/parallel.h"
#include "stream/base/error.h"
#include "stream/base/mutex.h"
#include "stream/base/trace.h"

namespace curvisplat {
namespace {

constexpr uint64_t kPositionBytes = 3 * sizeof(uint32_t);

using Node = std::array<uint64_t, 3>;

Node sizeOf(const GridBlock& block) {
  return {block.ni, block.nj, block.nk};
}

/// The part of a face's lattice whose nodes (or, of the layer of cells behind it, lowest nodes) are in the box.
struct LatticeBox {
  std::array<uint64_t, 2> first{}, end{};
  bool empty = false;

  LatticeBox(const GridFace& face, const Node& size, const NodeBox& box, uint64_t layer) {
    const Node from{box.i0, box.j0, box.k0}, to{box.endOfRow(size[0]), box.j1, box.k1};
    const auto axis = static_cast<size_t>(face.axis);
    empty = layer < from[axis] || layer >= to[axis];
    for (size_t n = 0; n < 2; ++n) {
      first[n] = from[kFaceAxes[axis][n]];
      end[n] = to[kFaceAxes[axis][n]];
    }
  }
};

Node nodeAt(const GridFace& face, uint64_t layer, uint64_t u, uint64_t v) {
  const auto axis = static_cast<size_t>(face.axis);
  Node node{};
  node[axis] = layer;
  node[kFaceAxes[axis][0]] = u;
  node[kFaceAxes[axis][1]] = v;
  return node;
}

/// The index of the layer of cells behind a face, or at either side of an index plane.
uint64_t layerOfCells(const GridFace& face, const Node& size) {
  return std::min(face.index, size[static_cast<size_t>(face.axis)] - 2);
}

bool isThere(const NodeArrays& nodes, size_t at, bool of_cells) {
  return of_cells ? !(nodes.blank[at] & kNoNode) : !nodes.blank[at];
}

}  // namespace

std::span<const GridFace> facesOfBlock(std::span<const GridFace> faces, uint32_t block) {
  const auto before = [](const GridFace& face, uint32_t number) { return face.block < number; };
  const auto first = std::lower_bound(faces.begin(), faces.end(), block, before);
  return {first, std::lower_bound(first, faces.end(), block + 1, before)};
}

FaceSpool::FaceSpool(const NodeReader& reader, std::vector<GridFace> faces, const FaceBox& box,
                     const std::filesystem::path& folder)
    : reader_(reader), faces_(std::move(faces)), box_(box), file_(folder) {
  const auto before = [](const GridFace& a, const GridFace& b) { return a.block < b.block; };
  CURVISPLAT_CHECK(std::is_sorted(faces_.begin(), faces_.end(), before));
  uint64_t end = 0;
  for (const GridFace& face : faces_) {
    const uint64_t nodes = face.nodes[0] * face.nodes[1];
    places_.push_back({end, end + nodes * kPositionBytes});
    end += nodes * (kPositionBytes + scalars() * sizeof(float));
  }
}

void FaceSpool::fill(const SlabBuffers& buffers, AbuttingFaces& abutting, BlankFaces* blanks,
                     Progress& progress) {
  SlabStream slabs(reader_, buffers, blanks ? BlankFaces::kHalo : kCornerHalo);
  size_t first_face = 0, end_face = 0;
  uint32_t block = std::numeric_limits<uint32_t>::max();
  while (const LoadedSlab* loaded = slabs.next()) {
    if (loaded->slab.block != block) {
      block = loaded->slab.block;
      const std::span<const GridFace> of_block = facesOfBlock(faces_, block);
      first_face = static_cast<size_t>(of_block.data() - faces_.data());
      end_face = first_face + of_block.size();
    }
    const GridBlock& whole = reader_.source().description().blocks[block];
    if (blanks) blanks->add(*loaded, whole, ofCells());
    parallelInvoke([&] { addEnds(*loaded, abutting); },
                   [&] { parallelFor(first_face, end_face, [&](size_t face) { store(*loaded, face); }); });
    progress.advance(rowsOf(loaded->slab.box) * loaded->slab.box.rowNodes(whole.ni));
  }
}

void FaceSpool::store(const LoadedSlab& loaded, size_t face_number) {
  const TraceScope trace("take faces");
  const GridFace& face = faces_[face_number];
  const NodeArrays& nodes = loaded.nodes;
  const Node size = sizeOf(reader_.source().description().blocks[face.block]);
  const bool of_cells = ofCells();
  std::vector<std::array<uint32_t, 3>> codes;
  std::vector<float> values;
  const auto code_of = [&](double at, int axis) { return faceCode(box_, at, axis); };
  // Rows that follow one another in the file are written at once.
  const auto is_last = [&](const LatticeBox& box, uint64_t v) {
    return v + 1 == box.end[1] || box.first[0] > 0 || box.end[0] < face.nodes[0];
  };
  const LatticeBox part(face, size, loaded.slab.box, face.index);
  const WindowStrides strides(loaded.slab.window, size[0]);
  const auto placeOf = [&](const Node& node) { return strides.at(node[0], node[1], node[2]); };
  uint64_t first = 0;
  for (uint64_t v = part.first[1]; !part.empty && v < part.end[1]; ++v) {
    if (codes.empty()) first = v * face.nodes[0] + part.first[0];
    for (uint64_t u = part.first[0]; u < part.end[0]; ++u) {
      const size_t at = placeOf(nodeAt(face, face.index, u, v));
      if (isThere(nodes, at, of_cells))
        codes.push_back({code_of(nodes.x[at], 0), code_of(nodes.y[at], 1), code_of(nodes.z[at], 2)});
      else
        codes.push_back({LatticeRow::kNone, 0, 0});
    }
    if (!is_last(part, v)) continue;
    file_.out().writeAt(places_[face_number].positions + first * kPositionBytes,
                        std::as_bytes(std::span(codes)));
    codes.clear();
  }
  if (scalars() == 0) return;
  const uint64_t layer = of_cells ? layerOfCells(face, size) : face.index;
  const LatticeBox of_values(face, size, loaded.slab.box, layer);
  for (uint64_t v = of_values.first[1]; !of_values.empty && v < of_values.end[1]; ++v) {
    if (values.empty()) first = v * face.nodes[0] + of_values.first[0];
    for (uint64_t u = of_values.first[0]; u < of_values.end[0]; ++u) {
      const Node node = nodeAt(face, layer, u, v);
      const size_t at = placeOf(node);
      const bool has_cell =
          of_cells && node[0] + 1 < size[0] && node[1] + 1 < size[1] && node[2] + 1 < size[2];
      const bool none = of_cells && !(has_cell && cellIsThere(nodes, at, strides.row, strides.plane));
      for (const std::vector<float>& scalar : nodes.scalars) values.push_back(none ? NAN : scalar[at]);
    }
    if (!is_last(of_values, v)) continue;
    file_.out().writeAt(places_[face_number].scalars + first * scalars() * sizeof(float),
                        std::as_bytes(std::span(values)));
    values.clear();
  }
}

/// Adds the ends of the cells whose lowest nodes are in the slab's box, and which have their corners at the
/// end.
void FaceSpool::addEnds(const LoadedSlab& loaded, AbuttingFaces& abutting) const {
  const Slab& slab = loaded.slab;
  const Node size = sizeOf(reader_.source().description().blocks[slab.block]);
  const uint64_t j1 = std::min(slab.box.j1, size[1] - 1), k1 = std::min(slab.box.k1, size[2] - 1);
  constexpr uint64_t kRowsPerTask = 32;
  Mutex adding;
  parallelFor(tbb::blocked_range2d<uint64_t>(slab.box.k0, std::max(slab.box.k0, k1), 1, slab.box.j0,
                                             std::max(slab.box.j0, j1), kRowsPerTask),
              [&](const tbb::blocked_range2d<uint64_t>& rows) {
                const TraceScope trace("take ends of blocks");
                const NodeBox box{rows.cols().begin(), rows.cols().end(), rows.rows().begin(),
                                  rows.rows().end(),   slab.box.i0,       slab.box.i1};
                addEndsIn(loaded, box, abutting, adding);
              });
}

/// Adds the ends of the cells whose lowest nodes are in `box`. Several threads, each with a box.
void FaceSpool::addEndsIn(const LoadedSlab& loaded, const NodeBox& box, AbuttingFaces& abutting,
                          Mutex& adding) const {
  const Slab& slab = loaded.slab;
  const NodeArrays& nodes = loaded.nodes;
  const Node size = sizeOf(reader_.source().description().blocks[slab.block]);
  const WindowStrides strides(slab.window, size[0]);
  constexpr size_t kCentresAtOnce = 4096;
  std::vector<AbuttingFaces::Centre> centres;
  const auto add = [&] {
    const MutexLock lock(adding);
    abutting.add(centres);
    centres.clear();
  };
  const auto isThereAt = [&](const CellFace& face, size_t at) {
    if (ofCells()) return cellIsThere(nodes, at, strides.row, strides.plane);
    const size_t bit = size_t{1} << face.axis;
    for (size_t corner = 0; corner < 8; ++corner)
      if (((corner & bit) != 0) == face.upper &&
          nodes.blank[at + (corner & 1) + (corner >> 1 & 1) * strides.row + (corner >> 2) * strides.plane])
        return false;
    return true;
  };
  const auto addCell = [&](CellFace face) {
    const size_t at = strides.at(face.cell[0], face.cell[1], face.cell[2]);
    const std::array<glm::dvec3, 8> corners =
        cornersAt(nodes.x.data(), nodes.y.data(), nodes.z.data(), at, strides.row, strides.plane);
    for (face.axis = 0; face.axis < 3; ++face.axis)
      for (const bool upper : {false, true}) {
        face.upper = upper;
        if (abutting.isAtEnd(face) && isThereAt(face, at))
          centres.push_back(abutting.centreOf(face, corners));
      }
    if (centres.size() >= kCentresAtOnce) add();
  };
  for (uint64_t k = box.k0; k < box.k1; ++k)
    for (uint64_t j = box.j0; j < box.j1; ++j) {
      const bool row_at_end = j == 0 || j + 2 == size[1] || k == 0 || k + 2 == size[2];
      // In other rows only the first and the last cell are at an end.
      const auto next = [&](uint64_t i) {
        return row_at_end || i + 2 >= size[0] ? i + 1 : std::max(i + 1, size[0] - 2);
      };
      const uint64_t first = row_at_end || box.i0 == 0 ? box.i0 : std::max(box.i0, size[0] - 2);
      for (uint64_t i = first; i < box.i1 && i + 1 < size[0]; i = next(i))
        addCell({slab.block, {i, j, k}, 0, false});
    }
  add();
}

std::vector<float> FaceSpool::storedScalars(size_t face, uint64_t v, const RowRange& range) const {
  std::vector<float> values((range.end - range.begin) * scalars());
  const uint64_t first = v * faces_[face].nodes[0] + range.begin;
  file_.in().readAt(places_[face].scalars + first * scalars() * sizeof(float), std::span(values));
  return values;
}

std::vector<uint8_t> FaceSpool::cellsOfRow(size_t face, uint64_t v, const RowRange& quads) const {
  const std::vector<float> values = storedScalars(face, v, quads);
  std::vector<uint8_t> there(quads.end - quads.begin);
  for (size_t u = 0; u < there.size(); ++u) there[u] = !std::isnan(values[u * scalars()]);
  return there;
}

LatticeRow FaceSpool::row(size_t face_number, uint64_t v, const RowRange& range) const {
  const GridFace& face = faces_[face_number];
  const uint64_t begin = range.begin, end = std::min(range.end, face.nodes[0]);
  LatticeRow row;
  row.codes.resize(end - begin);
  file_.in().readAt(places_[face_number].positions + (v * face.nodes[0] + begin) * kPositionBytes,
                    std::span(row.codes));
  row.scalars.assign(scalars(), std::vector<float>(end - begin));
  if (scalars() == 0) return row;
  // A node's value is made from the cells on both sides of it.
  const uint64_t first = ofCells() && begin > 0 ? begin - 1 : begin;
  const std::vector<float> here = storedScalars(face_number, v, {first, end});
  if (!ofCells()) {
    for (size_t s = 0; s < scalars(); ++s)
      for (size_t n = 0; n < end - begin; ++n) row.scalars[s][n] = here[n * scalars() + s];
    return row;
  }
  const std::vector<float> before = v > 0 ? storedScalars(face_number, v - 1, {first, end}) : here;
  for (size_t s = 0; s < scalars(); ++s)
    for (uint64_t u = begin; u < end; ++u) {
      double sum = 0;
      int count = 0;
      for (const std::vector<float>* of : {&before, &here})
        for (uint64_t cell = u > 0 ? u - 1 : 0; cell <= u; ++cell)
          if (const float value = (*of)[(cell - first) * scalars() + s]; !std::isnan(value))
            sum += double{value}, ++count;
      row.scalars[s][u - begin] = count > 0 ? static_cast<float>(sum / count) : 0;
    }
  return row;
}

LatticeRow FaceSpool::thinnedRow(size_t face, uint64_t v, const RowRange& range, uint32_t stride) const {
  // Reads pieces that a processor's cache holds; single nodes where the stride skips whole pages.
  constexpr uint64_t kPieceNodes = 4096, kMaxStride = 512;
  const uint64_t step = stride > kMaxStride ? stride : kPieceNodes / stride * stride;
  const uint64_t piece = stride > kMaxStride ? 1 : step;
  const uint64_t last = std::min(range.end, faces_[face].nodes[0]) - 1;
  LatticeRow thinned;
  thinned.scalars.resize(scalars());
  const auto add = [&](uint64_t begin, uint64_t end) {
    const LatticeRow of_piece = row(face, v, {begin, end});
    for (uint64_t n = 0; n < end - begin; n += stride) {
      thinned.codes.push_back(of_piece.codes[n]);
      for (size_t s = 0; s < scalars(); ++s) thinned.scalars[s].push_back(of_piece.scalars[s][n]);
    }
  };
  for (uint64_t begin = range.begin; begin < last; begin += step) add(begin, std::min(begin + piece, last));
  add(last, last + 1);
  return thinned;
}

}  // namespace curvisplat
