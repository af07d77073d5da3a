#include "preprocess/faces/blank_faces.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/common.hpp>
#include <limits>
#include <vector>

#include "preprocess/faces/face_nodes.h"
#include "preprocess/grid/hexahedron.h"
#include "preprocess/grid/parallel.h"
#include "stream/base/trace.h"
#include "stream/cache/faces_file.h"
#include "stream/codec/face_codec.h"

namespace curvisplat {
namespace {

constexpr size_t kCorners = 4, kKeyDoubles = 3;
constexpr size_t kRecordSize = kKeyDoubles + 3 * kCorners / 2;  // two coordinates in a double
constexpr int kCodeBits = 26;
constexpr size_t kStrips = 32;  // of a patch

using Code = std::array<uint32_t, 3>;

/// Coordinates of the corners at (u, v), (u + 1, v), (u, v + 1) and (u + 1, v + 1).
using Quad = std::array<Code, kCorners>;

void appendRecord(uint32_t block, uint64_t number, const Quad& quad, std::vector<double>& out) {
  const size_t at = out.size();
  out.resize(at + kRecordSize);
  RecordSorter::setKey(out.data() + at, block, 0, number);
  const uint32_t* const codes = quad.data()->data();
  for (size_t n = 0; n < 3 * kCorners / 2; ++n)
    out[at + kKeyDoubles + n] = static_cast<double>(uint64_t{codes[2 * n]} << kCodeBits | codes[2 * n + 1]);
}

Quad quadOf(const double* record) {
  Quad quad;
  uint32_t* const codes = quad.data()->data();
  for (size_t n = 0; n < 3 * kCorners / 2; ++n) {
    const auto both = static_cast<uint64_t>(record[kKeyDoubles + n]);
    codes[2 * n] = static_cast<uint32_t>(both >> kCodeBits);
    codes[2 * n + 1] = static_cast<uint32_t>(both & ((uint64_t{1} << kCodeBits) - 1));
  }
  return quad;
}

/// Puts quads into strips, and writes 32 strips as a patch that is a face of its own.
class StripWriter {
 public:
  StripWriter(const std::filesystem::path& output, const FaceBox& box)
      : box_(box), writer_(output, box, {}) {}

  /// `follows`: its first two corners are the right ones of the quad before it.
  void add(const Quad& quad, bool follows) {
    const size_t columns = strip_[0].size();
    if (!follows || columns > kPatchQuads) {
      if (columns + 2 > kPatchQuads + 1) endStrip();
      for (size_t row : {size_t{0}, size_t{1}}) strip_[row].push_back(quad[2 * row]);
    }
    drawn_.resize(strip_[0].size() - 1, 0);
    drawn_.push_back(1);
    for (size_t row : {size_t{0}, size_t{1}}) strip_[row].push_back(quad[2 * row + 1]);
  }

  std::optional<FileInfo> finish() {
    endStrip();
    flush();
    const FileInfo info = writer_.finish(faces_, patches_, {});
    if (!faces_.empty()) return info;
    return std::nullopt;
  }

 private:
  void endStrip() {
    if (strip_[0].empty()) return;
    const size_t quads = size_t{kPatchQuads};
    if (lattice_.rows > 0) lattice_.quads.insert(lattice_.quads.end(), quads, 0);  // between strips
    drawn_.resize(quads, 0);
    lattice_.quads.insert(lattice_.quads.end(), drawn_.begin(), drawn_.end());
    for (std::vector<Code>& row : strip_) {
      row.resize(quads + 1, row.back());
      for (const Code& code : row)
        for (size_t axis = 0; axis < 3; ++axis) lattice_.codes[axis].push_back(code[axis]);
      row.clear();
    }
    drawn_.clear();
    lattice_.columns = kPatchQuads + 1;
    lattice_.rows = static_cast<uint16_t>(lattice_.rows + 2);
    if (lattice_.rows == 2 * kStrips) flush();
  }

  void flush() {
    if (lattice_.rows == 0) return;
    const auto number = static_cast<uint32_t>(faces_.size());
    FacePatch patch;
    patch.face = number;
    patch.stride = {1, 1};
    patch.nodes = {lattice_.columns, lattice_.rows};
    patch.lower = glm::dvec3(std::numeric_limits<double>::infinity());
    patch.upper = -patch.lower;
    for (size_t n = 0; n < lattice_.codes[0].size(); ++n) {
      const glm::dvec3 at = box_.at({lattice_.codes[0][n], lattice_.codes[1][n], lattice_.codes[2][n]});
      patch.lower = glm::min(patch.lower, at);
      patch.upper = glm::max(patch.upper, at);
    }
    patch.extent = writer_.append(encodePatch(lattice_));
    faces_.push_back({0, 0, FaceSide::kPlane, 0, {lattice_.columns, lattice_.rows}, number});
    patches_.push_back({patch});
    lattice_ = {};
  }

  const FaceBox box_;
  FacesWriter writer_;
  std::array<std::vector<Code>, 2> strip_;
  std::vector<uint8_t> drawn_;
  PatchLattice lattice_;
  std::vector<GridFace> faces_;
  std::vector<std::vector<FacePatch>> patches_;  // [face]
};

}  // namespace

BlankFaces::BlankFaces(const GridDescription& grid, const FaceBox& box, uint64_t sort_bytes,
                       const std::filesystem::path& temporary)
    : box_(box),
      quads_(kRecordSize, sort_bytes / 4, temporary),
      end_quads_(kRecordSize + 1, sort_bytes / 4, temporary),
      ends_(grid.blocks, grid.coordinate_bytes, sort_bytes / 4, temporary),
      drawn_ends_(grid.blocks, grid.coordinate_bytes, sort_bytes / 4, temporary) {}

/// A slab, and what its cells are.
struct BlankFaces::Window {
  const LoadedSlab& loaded;
  const FaceBox& box;
  std::array<uint64_t, 3> size;  // of the block, in nodes
  bool of_cells;
  WindowStrides strides{loaded.slab.window, size[0]};
  std::array<size_t, 3> stride{1, strides.row, strides.plane};

  bool isThere(size_t at) const {
    return of_cells ? cellIsThere(loaded.nodes, at, strides.row, strides.plane)
                    : cornerMarks(loaded.nodes.blank.data(), at, strides.row, strides.plane) == 0;
  }
  /// The quad at right angles to an axis with its first corner at a node of the window.
  Quad quadAt(size_t at, size_t axis) const {
    const auto [u, v] = kFaceAxes[axis];
    const auto codeAt = [&](size_t node) {
      const NodeArrays& nodes = loaded.nodes;
      return Code{faceCode(box, nodes.x[node], 0), faceCode(box, nodes.y[node], 1),
                  faceCode(box, nodes.z[node], 2)};
    };
    return {codeAt(at), codeAt(at + stride[u]), codeAt(at + stride[v]), codeAt(at + stride[u] + stride[v])};
  }
  uint64_t numberOf(const std::array<uint64_t, 3>& node, size_t axis) const {
    const auto [u, v] = kFaceAxes[axis];
    return uint64_t{axis} << 60 | ((node[axis] * size[v] + node[v]) * size[u] + node[u]);
  }
};

void BlankFaces::add(const LoadedSlab& loaded, const GridBlock& block, bool of_cells) {
  const Window window{loaded, box_, {block.ni, block.nj, block.nk}, of_cells};
  if (std::any_of(window.size.begin(), window.size.end(), [](uint64_t n) { return n < 2; })) return;
  const std::vector<uint8_t>& marks = loaded.nodes.blank;
  const bool any = std::any_of(marks.begin(), marks.end(), [](uint8_t mark) { return mark != 0; });
  const NodeBox& box = loaded.slab.box;
  parallelFor(box.k0, std::min(box.k1, window.size[2] - 1), [&](uint64_t k) {
    const TraceScope trace("find faces of blanked cells");
    if (any) addInside(window, k);
    addEnds(window, k);
  });
}

/// Adds the quads between two cells of the block.
void BlankFaces::addInside(const Window& window, uint64_t k) {
  const Slab& slab = window.loaded.slab;
  const std::array<uint64_t, 3>& size = window.size;
  std::vector<double> found;
  for (uint64_t j = slab.box.j0; j < std::min(slab.box.j1, size[1] - 1); ++j)
    for (uint64_t i = slab.box.i0; i < std::min(slab.box.endOfRow(size[0]), size[0] - 1); ++i) {
      const std::array<uint64_t, 3> node{i, j, k};
      const size_t at = window.strides.at(i, j, k);
      const bool is_there = window.isThere(at);
      for (size_t axis = 0; axis < 3; ++axis) {
        if (node[axis] == 0 || window.isThere(at - window.stride[axis]) == is_there) continue;
        appendRecord(slab.block, window.numberOf(node, axis), window.quadAt(at, axis), found);
      }
    }
  quads_.add(found);
}

/// Adds the quads at the ends of the block, those of blanked cells, too, wherever they lie.
void BlankFaces::addEnds(const Window& window, uint64_t k) {
  const Slab& slab = window.loaded.slab;
  const NodeArrays& nodes = window.loaded.nodes;
  std::vector<AbuttingFaces::Centre> ends, drawn;
  std::vector<double> quads;
  const auto addCell = [&](const std::array<uint64_t, 3>& cell) {
    const size_t at = window.strides.at(cell[0], cell[1], cell[2]);
    const bool is_there = window.isThere(at);
    const std::array<glm::dvec3, 8> corners = cornersAt(nodes.x.data(), nodes.y.data(), nodes.z.data(), at,
                                                        window.strides.row, window.strides.plane);
    for (int axis = 0; axis < 3; ++axis)
      for (const bool upper : {false, true}) {
        const CellFace face{slab.block, cell, axis, upper};
        if (!ends_.isAtEnd(face)) continue;
        const AbuttingFaces::Centre centre = ends_.centreOf(face, corners);
        const double sum = centre.at.x + centre.at.y + centre.at.z;
        if (!std::isfinite(sum) || (centre.collapsed && !is_there)) continue;
        ends.push_back(centre);
        if (!is_there) continue;
        drawn.push_back(centre);
        std::array<uint64_t, 3> node = cell;
        const auto a = static_cast<size_t>(axis);
        node[a] += upper;
        appendRecord(slab.block, window.numberOf(node, a),
                     window.quadAt(at + (upper ? window.stride[a] : 0), a), quads);
        quads.push_back(static_cast<double>(centre.face));
      }
  };
  const std::array<uint64_t, 3>& size = window.size;
  for (uint64_t j = slab.box.j0; j < std::min(slab.box.j1, size[1] - 1); ++j) {
    const bool row_at_end = j == 0 || j + 2 == size[1] || k == 0 || k + 2 == size[2];
    for (uint64_t i = slab.box.i0; i < std::min(slab.box.endOfRow(size[0]), size[0] - 1); ++i)
      if (row_at_end || i == 0 || i + 2 == size[0]) addCell({i, j, k});
  }
  end_quads_.add(quads);
  const MutexLock lock(adding_);
  ends_.add(ends);
  drawn_ends_.add(drawn);
}

/// Adds the quads of drawn cells that have a blanked cell of another block, or of the other end of theirs, beside them.
void BlankFaces::addCoastsBetweenBlocks(const Progress& progress) {
  ends_.match(progress);
  drawn_ends_.match(progress);
  std::vector<double> found;
  end_quads_.drain([&](const double* record) {
    progress.throwIfStopped();
    const auto face = static_cast<uint64_t>(record[kRecordSize]);
    if (!ends_.abuts(face) || drawn_ends_.abuts(face)) return;
    found.assign(record, record + kRecordSize);
    quads_.add(found);
  });
}

std::optional<FileInfo> BlankFaces::write(const std::filesystem::path& output, const Progress& progress) {
  addCoastsBetweenBlocks(progress);
  StripWriter writer(output, box_);
  double block = -1;
  uint64_t last = 0;
  quads_.drain([&](const double* record) {
    const uint64_t number = RecordSorter::numberOf(record);
    const bool follows = RecordSorter::alongOf(record) == block && number == last + 1;
    block = RecordSorter::alongOf(record);
    last = number;
    progress.throwIfStopped();
    writer.add(quadOf(record), follows);
  });
  const std::optional<FileInfo> info = writer.finish();
  if (!info) removeFile(output);
  return info;
}

}  // namespace curvisplat
