#include "preprocess/faces/grid_faces_pass.h"

#include <algorithm>

#include "preprocess/coincidence/abutting_faces.h"
#include "preprocess/faces/blank_faces.h"
#include "preprocess/faces/face_nodes.h"
#include "preprocess/faces/face_patches.h"
#include "preprocess/faces/face_spool.h"
#include "stream/base/error.h"
#include "stream/base/trace.h"
#include "stream/cache/faces_file.h"

namespace curvisplat {
namespace {

std::array<uint64_t, 3> nodesAlong(const GridBlock& block) {
  return {block.ni, block.nj, block.nk};
}

/// The planes of the grid from one index of `plane` to the next.
uint64_t partsOf(const IndexPlane& plane, const GridDescription& grid, uint32_t block) {
  return plane.is_of_parts ? 1 : grid.refinement.ofBlock(block)[static_cast<size_t>(plane.axis)];
}

/// All faces that may be drawn, block after block: blocks without volume have none.
std::vector<GridFace> facesOf(const GridDescription& grid, std::span<const IndexPlane> planes) {
  std::vector<GridFace> faces;
  for (uint32_t block = 0; block < grid.blocks.size(); ++block) {
    const std::array<uint64_t, 3> size = nodesAlong(grid.blocks[block]);
    if (std::any_of(size.begin(), size.end(), [](uint64_t n) { return n < 2; })) continue;
    const auto add = [&](int axis, FaceSide side, uint64_t index) {
      const auto [u, v] = kFaceAxes[static_cast<size_t>(axis)];
      faces.push_back({block, axis, side, index, {size[u], size[v]}, kNoPatch});
    };
    for (int axis = 0; axis < 3; ++axis) {
      add(axis, FaceSide::kMin, 0);
      add(axis, FaceSide::kMax, size[static_cast<size_t>(axis)] - 1);
    }
    for (const IndexPlane& plane : planes) {
      const auto axis = static_cast<size_t>(plane.axis);
      const uint64_t parts = partsOf(plane, grid, block);
      if (plane.block.value_or(block) == block && plane.index <= (size[axis] - 1) / parts)
        add(plane.axis, FaceSide::kPlane, parts * plane.index);
    }
  }
  return faces;
}

/// The boundaries as parts of faces. Those inside of a block, or of a line or a point, are none.
std::vector<FaceRegion> regionsOf(const GridDescription& grid, std::span<const GridFace> faces) {
  std::vector<FaceRegion> regions;
  for (const GridBoundary& boundary : grid.boundaries)
    for (const GridFace& face : facesOfBlock(faces, boundary.block)) {
      const auto axis = static_cast<size_t>(face.axis);
      if (face.side == FaceSide::kPlane || boundary.first[axis] != face.index ||
          boundary.last[axis] != face.index)
        continue;
      FaceRegion region{static_cast<uint32_t>(&face - faces.data()), {}, {}, boundary.name, boundary.type};
      bool is_area = true;
      for (size_t along = 0; along < 2; ++along) {
        region.first[along] = boundary.first[kFaceAxes[axis][along]];
        region.last[along] = std::min(boundary.last[kFaceAxes[axis][along]], face.nodes[along] - 1);
        is_area = is_area && region.first[along] < region.last[along];
      }
      if (is_area) regions.push_back(std::move(region));
    }
  return regions;
}

class FacesPass {
 public:
  FacesPass(const NodeReader& reader, const FacesJob& job, Progress& progress)
      : grid_(reader.source().description()),
        job_(job),
        progress_(progress),
        abutting_(grid_.blocks, grid_.coordinate_bytes, sortBytes(), job.temporary),
        spool_(reader, facesOf(grid_, job.planes), FaceBox::of(job.lower, job.upper), job.temporary) {
    if (!job.blanks.empty()) blanks_.emplace(grid_, spool_.box(), sortBytes(), job.temporary);
  }

  FacesFiles write(const SlabBuffers& slabs) {
    spool_.fill(slabs, abutting_, blanks_ ? &*blanks_ : nullptr, progress_);
    FacesFiles files;
    if (blanks_) files.blanks = blanks_->write(job_.blanks, progress_);
    files.faces = writeOuter();
    return files;
  }

 private:
  std::optional<FileInfo> writeOuter() {
    abutting_.keepFolds();
    abutting_.match(progress_);
    const FaceRegions regions(regionsOf(grid_, spool_.faces()));
    FacesWriter writer(job_.output, spool_.box(), job_.variables);
    Written written;
    for (uint32_t n = 0; n < spool_.faces().size(); ++n) {
      const std::span<const FaceRegion> own = regions.of(n);
      Quads quads = quadsOf(n, own);
      add(n, spool_.faces()[n].side, quads.drawn, own, writer, written);
      // A body without thickness is a side that abuts on itself.
      if (quads.folds && !isPlane(n)) add(n, FaceSide::kPlane, quads.with_folds, {}, writer, written);
    }
    const FileInfo info = writer.finish(written.faces, written.patches, written.regions);
    if (!written.faces.empty()) return info;
    removeFile(job_.output);
    return std::nullopt;
  }

  /// Memory for AbuttingFaces, and as much for BlankFaces.
  uint64_t sortBytes() const {
    const uint64_t needs = (job_.blanks.empty() ? 2 : 4) * AbuttingFaces::needsOf(grid_.blocks).memory_bytes;
    if (2 * needs > job_.sort_bytes)
      throw Error("--memory: the faces of this grid's blocks take {} MiB; give more, or add --no-surfaces",
                  (2 * needs >> 20) + 1);
    return (job_.sort_bytes - needs) / (job_.blanks.empty() ? 1 : 2);
  }

  struct Written {
    std::vector<GridFace> faces;
    std::vector<std::vector<FacePatch>> patches;  // [face]
    std::vector<FaceRegion> regions;
    uint32_t patch_count = 0;
  };

  void add(uint32_t spooled, FaceSide side, const QuadMask& quads, std::span<const FaceRegion> regions,
           FacesWriter& writer, Written& written) const {
    std::vector<FacePatch> patches =
        writePatches(spool_, spooled, quads, written.patch_count, writer, progress_);
    if (patches.empty()) return;
    const auto number = static_cast<uint32_t>(written.faces.size());
    GridFace& face = written.faces.emplace_back(spool_.faces()[spooled]);
    face.side = side;
    face.root = written.patch_count;
    for (FacePatch& patch : patches) patch.face = number;
    written.patch_count += static_cast<uint32_t>(patches.size());
    written.patches.push_back(std::move(patches));
    for (const FaceRegion& region : regions) written.regions.emplace_back(region).face = number;
  }

  /// Whether the face was asked for as an index plane, too.
  bool isPlane(uint32_t number) const {
    const GridFace& face = spool_.faces()[number];
    const std::span<const GridFace> of_block = facesOfBlock(spool_.faces(), face.block);
    return face.side == FaceSide::kPlane ||
           std::any_of(of_block.begin(), of_block.end(), [&](const GridFace& other) {
             return other.side == FaceSide::kPlane && other.axis == face.axis && other.index == face.index;
           });
  }

  struct Quads {
    QuadMask drawn, with_folds;
    bool folds = false;
  };

  /// The quads of a face that are drawn (those that another block does not close) and those of boundaries.
  /// The nodes and cells of all of them are there.
  Quads quadsOf(uint32_t number, std::span<const FaceRegion> regions) const {
    const TraceScope trace("find drawn quads");
    const GridFace& face = spool_.faces()[number];
    Quads quads{QuadMask(face), QuadMask(face)};
    forRowParts(quads.drawn.columns(), [&](const RowRange& part) { drawPart(number, regions, part, quads); });
    return quads;
  }

  /// Finds the quads in a range of the columns.
  void drawPart(uint32_t number, std::span<const FaceRegion> regions, const RowRange& part,
                Quads& quads) const {
    const GridFace& face = spool_.faces()[number];
    const RowRange nodes{part.begin, part.end + 1};
    LatticeRow before = spool_.row(number, 0, nodes);
    RegionRows region_rows(regions, part);
    for (uint64_t v = 0; v < quads.drawn.rows(); ++v) {
      progress_.throwIfStopped();
      LatticeRow next = spool_.row(number, v + 1, nodes);
      const std::span<const uint8_t> in_region = region_rows.row(v);
      std::vector<uint8_t> there(part.end - part.begin, 1);
      if (spool_.ofCells()) there = spool_.cellsOfRow(number, v, part);
      for (uint64_t u = part.begin; u < part.end; ++u) {
        bool is_there = there[u - part.begin];
        for (const LatticeRow* row : {&before, &next})
          for (const uint64_t node : {u, u + 1})
            is_there = is_there && row->codes[node - part.begin][0] != LatticeRow::kNone;
        if (!is_there) continue;
        const bool is_outer = face.side == FaceSide::kPlane || !abutting_.abuts(cellOf(face, u, v));
        const bool folds = face.side != FaceSide::kPlane && abutting_.folds(cellOf(face, u, v));
        quads.folds |= folds;
        if (is_outer || in_region[u - part.begin]) quads.drawn.draw(u, v);
        if (is_outer || folds) quads.with_folds.draw(u, v);
      }
      before = std::move(next);
    }
  }

  static CellFace cellOf(const GridFace& face, uint64_t u, uint64_t v) {
    const auto axis = static_cast<size_t>(face.axis);
    CellFace cell{face.block, {}, face.axis, face.side == FaceSide::kMax};
    cell.cell[axis] = face.side == FaceSide::kMax ? face.index - 1 : 0;
    cell.cell[kFaceAxes[axis][0]] = u;
    cell.cell[kFaceAxes[axis][1]] = v;
    return cell;
  }

  const GridDescription& grid_;
  const FacesJob& job_;
  Progress& progress_;
  AbuttingFaces abutting_;
  FaceSpool spool_;
  std::optional<BlankFaces> blanks_;
};

}  // namespace

uint64_t temporaryBytesOfFaces(const GridDescription& grid, std::span<const IndexPlane> planes,
                               size_t scalars) {
  uint64_t nodes = 0;
  for (const GridFace& face : facesOf(grid, planes)) nodes += face.nodes[0] * face.nodes[1];
  return nodes * (12 + 4 * scalars) + AbuttingFaces::needsOf(grid.blocks).disk_bytes;
}

uint64_t memoryOfFaces(const GridDescription& grid, std::span<const IndexPlane> planes) {
  // While a face is cut, its patches are in a map, and in two vectors with their places.
  constexpr uint64_t kWhileCut = sizeof(FacePatch) + 2 * (sizeof(FacePatch) + 64);
  uint64_t all = 0, most = 0;
  for (const GridFace& face : facesOf(grid, planes)) {
    const auto along = [&](size_t axis) { return (face.nodes[axis] - 1 + kPatchQuads - 1) / kPatchQuads; };
    const uint64_t finest = along(0) * along(1);
    const uint64_t patches = finest > 1 ? 2 * finest : 1;  // each level has half as many or fewer
    all += patches;
    most = std::max(most, patches);
  }
  return all * sizeof(FacePatch) + most * kWhileCut;
}

void checkPlanes(const GridDescription& grid, std::span<const IndexPlane> planes) {
  for (const IndexPlane& plane : planes) {
    const char axis = "ijk"[plane.axis];
    const auto a = static_cast<size_t>(plane.axis);
    if (plane.block && *plane.block >= grid.blocks.size())
      throw Error("--surface: the grid has no block {}; it has blocks 1 to {}", *plane.block + 1,
                  grid.blocks.size());
    uint64_t last = 0;
    for (uint32_t n = 0; n < grid.blocks.size(); ++n)
      if (plane.block.value_or(n) == n)
        last = std::max(last, (nodesAlong(grid.blocks[n])[a] - 1) / partsOf(plane, grid, n));
    if (plane.index > last)
      throw Error("--surface: {} {}={}; expected 0 to {}",
                  plane.block ? fmt::format("block {} has no", *plane.block + 1) : "no block has", axis,
                  plane.index, last);
  }
}

Halo FacesJob::halo() const {
  return blanks.empty() ? kCornerHalo : BlankFaces::kHalo;
}

FacesFiles writeGridFaces(const NodeReader& reader, const FacesJob& job, const SlabBuffers& slabs,
                          Progress& progress) {
  if (facesOf(reader.source().description(), job.planes).empty()) return {};
  return FacesPass(reader, job, progress).write(slabs);
}

}  // namespace curvisplat
