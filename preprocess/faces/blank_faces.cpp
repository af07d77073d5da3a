#include "preprocess/faces/blank_faces.h"

#include <algorithm>
#include <array>
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

BlankFaces::BlankFaces(const FaceBox& box, uint64_t sort_bytes, const std::filesystem::path& temporary)
    : box_(box), quads_(kRecordSize, sort_bytes, temporary) {}

void BlankFaces::add(const LoadedSlab& loaded, const GridBlock& block, bool of_cells) {
  const Slab& slab = loaded.slab;
  const NodeArrays& nodes = loaded.nodes;
  const std::array<uint64_t, 3> size{block.ni, block.nj, block.nk};
  if (std::any_of(size.begin(), size.end(), [](uint64_t n) { return n < 2; })) return;
  if (std::all_of(nodes.blank.begin(), nodes.blank.end(), [](uint8_t mark) { return mark == 0; })) return;
  const WindowStrides strides(slab.window, block.ni);
  const std::array<size_t, 3> stride{1, strides.row, strides.plane};
  const auto isThere = [&](size_t at) {
    return of_cells ? cellIsThere(nodes, at, strides.row, strides.plane)
                    : cornerMarks(nodes.blank.data(), at, strides.row, strides.plane) == 0;
  };
  const auto codeAt = [&](size_t at) {
    return Code{faceCode(box_, nodes.x[at], 0), faceCode(box_, nodes.y[at], 1),
                faceCode(box_, nodes.z[at], 2)};
  };
  parallelFor(slab.box.k0, std::min(slab.box.k1, size[2] - 1), [&](uint64_t k) {
    const TraceScope trace("find faces of blanked cells");
    std::vector<double> found;
    for (uint64_t j = slab.box.j0; j < std::min(slab.box.j1, size[1] - 1); ++j)
      for (uint64_t i = slab.box.i0; i < std::min(slab.box.endOfRow(size[0]), size[0] - 1); ++i) {
        const std::array<uint64_t, 3> node{i, j, k};
        const size_t at = strides.at(i, j, k);
        const bool is_there = isThere(at);
        for (size_t axis = 0; axis < 3; ++axis) {
          if (node[axis] == 0 || isThere(at - stride[axis]) == is_there) continue;
          const auto [u, v] = kFaceAxes[axis];
          const uint64_t number = (node[axis] * size[v] + node[v]) * size[u] + node[u];
          const Quad quad{codeAt(at), codeAt(at + stride[u]), codeAt(at + stride[v]),
                          codeAt(at + stride[u] + stride[v])};
          appendRecord(slab.block, uint64_t{axis} << 60 | number, quad, found);
        }
      }
    quads_.add(found);
  });
}

std::optional<FileInfo> BlankFaces::write(const std::filesystem::path& output, const Progress& progress) {
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
