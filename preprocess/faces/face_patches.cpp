#include "preprocess/faces/face_patches.h"

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <numeric>
#include <utility>

#include "preprocess/grid/parallel.h"
#include "stream/base/trace.h"
#include "stream/codec/face_codec.h"

namespace curvisplat {
namespace {

// Edges whose lengths differ by less are skipped together.
constexpr double kAlike = 1.5;
// Patches that are in memory at once: of one scalar, 17 MiB.
constexpr uint64_t kPatchesAtOnce = 256;

using Pair = std::array<uint64_t, 2>;

uint64_t patchesAlong(const GridFace& face, const std::array<uint32_t, 2>& stride, size_t along) {
  const uint64_t quads = uint64_t{kPatchQuads} * stride[along];
  return (face.nodes[along] - 1 + quads - 1) / quads;
}

/// The mean length of the edges along u and v, of a sample of rows.
std::array<double, 2> meanEdges(const FaceSpool& spool, uint32_t number) {
  constexpr uint64_t kRows = 64;
  const GridFace& face = spool.faces()[number];
  std::array<double, 2> sum{};
  std::array<uint64_t, 2> count{};
  const auto add = [&](size_t along, const std::array<uint32_t, 3>& a, const std::array<uint32_t, 3>& b) {
    if (a[0] == LatticeRow::kNone || b[0] == LatticeRow::kNone) return;
    sum[along] += glm::distance(spool.box().at(a), spool.box().at(b));
    ++count[along];
  };
  const uint64_t step = std::max<uint64_t>(1, (face.nodes[1] - 1) / kRows);
  for (uint64_t v = 0; v + 1 < face.nodes[1]; v += step) {
    std::array<uint32_t, 3> left{};
    forRowParts(face.nodes[0], [&](const RowRange& part) {
      const LatticeRow here = spool.row(number, v, part), next = spool.row(number, v + 1, part);
      for (uint64_t u = part.begin; u < part.end; ++u) {
        const std::array<uint32_t, 3>& node = here.codes[u - part.begin];
        if (u > 0) add(0, left, node);
        add(1, node, next.codes[u - part.begin]);
        left = node;
      }
    });
  }
  return {count[0] ? sum[0] / static_cast<double>(count[0]) : 0,
          count[1] ? sum[1] / static_cast<double>(count[1]) : 0};
}

/// Strides of the levels, from 1 until one patch covers the face. Where edges are longer along one axis, the
/// other is skipped first, so that a boundary layer's quads become square.
std::vector<std::array<uint32_t, 2>> stridesOf(const GridFace& face, const std::array<double, 2>& edges) {
  std::vector<std::array<uint32_t, 2>> levels{{1, 1}};
  while (true) {
    std::array<uint32_t, 2> stride = levels.back();
    const bool can[2] = {patchesAlong(face, stride, 0) > 1, patchesAlong(face, stride, 1) > 1};
    if (!can[0] && !can[1]) return levels;
    const double length[2] = {edges[0] * stride[0], edges[1] * stride[1]};
    const std::array<uint32_t, 2> before = stride;
    for (const size_t n : {size_t{0}, size_t{1}})
      if (can[n] && (!can[1 - n] || length[n] <= kAlike * length[1 - n])) stride[n] = 2 * before[n];
    levels.push_back(stride);
  }
}

/// A patch, and where it is among those of its level.
struct Built {
  FacePatch patch;
  Pair place{};
  PatchLattice lattice;
  bool any = false;  // quad
};

class PatchBuilder {
 public:
  PatchBuilder(const FaceSpool& spool, uint32_t face, const QuadMask& drawn)
      : spool_(spool), face_(spool.faces()[face]), number_(face), drawn_(drawn) {}

  /// The patches of a row of a level from place `first` on, kPatchesAtOnce at the most. Decimates rows of
  /// nodes as it reads them.
  std::vector<Built> part(const std::array<uint32_t, 2>& stride, const Pair& first) const {
    std::vector<Built> built(std::min(kPatchesAtOnce, patchesAlong(face_, stride, 0) - first[0]));
    for (size_t n = 0; n < built.size(); ++n) begin(built[n], stride, {first[0] + n, first[1]});
    const FacePatch &left = built.front().patch, &right = built.back().patch;
    const RowRange range{left.first[0], latticeIndex(face_, right, 0, right.nodes[0] - 1u) + 1};
    {
      const TraceScope trace("read faces");
      for (uint64_t r = 0; r < left.nodes[1]; ++r) {
        const LatticeRow nodes = rowOf(latticeIndex(face_, left, 1, r), range, stride[0]);
        for (Built& b : built) append(b, nodes, range.begin);
      }
    }
    parallelFor(size_t{0}, built.size(), [&](size_t n) {
      const TraceScope trace("complete patch");
      complete(built[n]);
    });
    return built;
  }

 private:
  LatticeRow rowOf(uint64_t v, const RowRange& range, uint32_t stride) const {
    return stride > 1 ? spool_.thinnedRow(number_, v, range, stride) : spool_.row(number_, v, range);
  }

  void begin(Built& b, const std::array<uint32_t, 2>& stride, const Pair& place) const {
    b.place = place;
    FacePatch& patch = b.patch;
    patch.face = number_;
    patch.stride = stride;
    for (size_t n = 0; n < 2; ++n) {
      patch.first[n] = place[n] * kPatchQuads * stride[n];
      const uint64_t quads = (face_.nodes[n] - 1 - patch.first[n] + stride[n] - 1) / stride[n];
      patch.nodes[n] = static_cast<uint16_t>(std::min<uint64_t>(quads, kPatchQuads) + 1);
    }
    b.lattice.columns = patch.nodes[0];
    b.lattice.rows = patch.nodes[1];
    b.lattice.scalars.resize(spool_.scalars());
  }

  /// `row` begins at node `first`, and has the nodes of the patch's level alone.
  void append(Built& b, const LatticeRow& row, uint64_t first) const {
    const uint32_t stride = b.patch.stride[0];
    for (uint64_t n = 0; n < b.patch.nodes[0]; ++n) {
      const uint64_t at = (latticeIndex(face_, b.patch, 0, n) - first + stride - 1) / stride;
      for (size_t axis = 0; axis < 3; ++axis) b.lattice.codes[axis].push_back(row.codes[at][axis]);
      for (size_t s = 0; s < row.scalars.size(); ++s) b.lattice.scalars[s].push_back(row.scalars[s][at]);
    }
  }

  void complete(Built& b) const {
    FacePatch& patch = b.patch;
    PatchLattice& lattice = b.lattice;
    const auto missing = [&](size_t n) { return lattice.codes[0][n] == LatticeRow::kNone; };
    lattice.quads.resize(patch.quadCount());
    patch.lower = glm::dvec3(std::numeric_limits<double>::infinity());
    patch.upper = -patch.lower;
    const bool coarse = patch.stride[0] > 1 || patch.stride[1] > 1;
    for (uint64_t r = 0; r + 1 < patch.nodes[1]; ++r)
      for (uint64_t c = 0; c + 1 < patch.nodes[0]; ++c) {
        const size_t at = r * patch.nodes[0] + c;
        const size_t corners[4] = {at, at + 1, at + patch.nodes[0] + 1, at + patch.nodes[0]};
        if (std::any_of(corners, corners + 4, missing)) continue;
        if (!drawn_.mostOf(latticeIndex(face_, patch, 0, c), latticeIndex(face_, patch, 0, c + 1),
                           latticeIndex(face_, patch, 1, r), latticeIndex(face_, patch, 1, r + 1)))
          continue;
        lattice.quads[r * (patch.nodes[0] - 1u) + c] = 1;
        b.any = true;
        glm::dvec3 corner[4];
        for (int n = 0; n < 4; ++n) {
          corner[n] = positionOf(lattice, corners[n]);
          patch.lower = glm::min(patch.lower, corner[n]);
          patch.upper = glm::max(patch.upper, corner[n]);
        }
        for (int n = 0; coarse && n < 4; ++n)
          patch.error =
              std::max(patch.error, static_cast<float>(glm::distance(corner[n], corner[(n + 1) % 4])));
      }
    fillMissing(lattice);
  }

  glm::dvec3 positionOf(const PatchLattice& lattice, size_t n) const {
    return spool_.box().at({lattice.codes[0][n], lattice.codes[1][n], lattice.codes[2][n]});
  }

  /// Nodes that are not there get what takes no bits: the place and the values of the one before.
  static void fillMissing(PatchLattice& lattice) {
    const size_t count = lattice.codes[0].size();
    size_t first = 0;
    while (first < count && lattice.codes[0][first] == LatticeRow::kNone) ++first;
    for (size_t n = 0; n < count; ++n) {
      if (lattice.codes[0][n] != LatticeRow::kNone) continue;
      const size_t from = n > 0 ? n - 1 : first;
      for (auto& codes : lattice.codes) codes[n] = from < count ? codes[from] : 0;
      for (auto& values : lattice.scalars) values[n] = from < count ? values[from] : 0;
    }
  }

  const FaceSpool& spool_;
  const GridFace& face_;
  const uint32_t number_;
  const QuadMask& drawn_;
};

/// The patches of a level that have a quad or a child, by their places.
class Level {
 public:
  void add(const Pair& place, FacePatch patch) { patches_.emplace(place, std::move(patch)); }
  bool empty() const { return patches_.empty(); }
  bool has(const Pair& place) const { return patches_.contains(place); }
  const FacePatch& at(const Pair& place) const { return patches_.at(place); }
  std::map<Pair, FacePatch>& all() { return patches_; }

 private:
  std::map<Pair, FacePatch> patches_;
};

/// The places of the patches, a level below, that a patch may replace.
std::vector<Pair> childPlaces(const Pair& place, const std::array<uint32_t, 2>& stride,
                              const std::array<uint32_t, 2>& fine) {
  std::vector<Pair> places;
  const uint64_t by[2] = {stride[0] / fine[0], stride[1] / fine[1]};
  for (uint64_t v = 0; v < by[1]; ++v)
    for (uint64_t u = 0; u < by[0]; ++u) places.push_back({place[0] * by[0] + u, place[1] * by[1] + v});
  return places;
}

/// All levels in the order of the file: the coarsest first, and the children of a patch next to each other.
std::vector<FacePatch> inOrder(std::vector<Level>& levels, std::span<const std::array<uint32_t, 2>> strides,
                               uint32_t first_number) {
  for (size_t n = 1; n < levels.size(); ++n)
    for (auto& [place, patch] : levels[n].all())
      for (const Pair& child : childPlaces(place, strides[n], strides[n - 1])) {
        if (!levels[n - 1].has(child)) continue;
        const FacePatch& below = levels[n - 1].at(child);
        patch.lower = glm::min(patch.lower, below.lower);
        patch.upper = glm::max(patch.upper, below.upper);
        patch.error = std::max(patch.error, below.error);
      }
  std::vector<FacePatch> patches;
  std::vector<Pair> places;
  for (const auto& [place, patch] : levels.back().all()) {
    patches.push_back(patch);
    places.push_back(place);
  }
  size_t begin = 0;
  for (size_t n = levels.size() - 1; n > 0; --n) {
    const size_t end = patches.size();
    for (size_t parent = begin; parent < end; ++parent)
      for (const Pair& child : childPlaces(places[parent], strides[n], strides[n - 1])) {
        if (!levels[n - 1].has(child)) continue;
        if (patches[parent].child_count++ == 0)
          patches[parent].first_child = first_number + static_cast<uint32_t>(patches.size());
        patches.push_back(levels[n - 1].at(child));
        places.push_back(child);
      }
    begin = end;
  }
  return patches;
}

}  // namespace

bool QuadMask::mostOf(uint64_t u0, uint64_t u1, uint64_t v0, uint64_t v1) const {
  uint64_t count = 0;
  for (uint64_t v = v0; v < v1; ++v)
    for (uint64_t u = u0; u < u1; ++u) count += at(u, v);
  return 2 * count >= (u1 - u0) * (v1 - v0);
}

std::vector<FacePatch> writePatches(const FaceSpool& spool, uint32_t face, const QuadMask& drawn,
                                    uint32_t first_number, FacesWriter& writer, const Progress& progress) {
  const PatchBuilder builder(spool, face, drawn);
  const auto strides = stridesOf(spool.faces()[face], meanEdges(spool, face));
  std::vector<Level> levels;
  for (const std::array<uint32_t, 2>& stride : strides) {
    Level level;
    const auto is_needed = [&](const Built& built) {
      if (built.any || levels.empty()) return built.any;
      const std::vector<Pair> below = childPlaces(built.place, stride, strides[levels.size() - 1]);
      return std::any_of(below.begin(), below.end(), [&](const Pair& p) { return levels.back().has(p); });
    };
    const auto write_part = [&](const Pair& first) {
      progress.throwIfStopped();
      std::vector<Built> part = builder.part(stride, first);
      std::vector<std::vector<std::byte>> streams(part.size());
      parallelFor(size_t{0}, part.size(), [&](size_t n) {
        const TraceScope trace("encode patch");
        if (is_needed(part[n])) streams[n] = encodePatch(part[n].lattice);
      });
      for (size_t n = 0; n < part.size(); ++n) {
        if (streams[n].empty()) continue;
        part[n].patch.extent = writer.append(streams[n]);
        level.add(part[n].place, part[n].patch);
      }
    };
    for (uint64_t v = 0; v < patchesAlong(spool.faces()[face], stride, 1); ++v)
      for (uint64_t u = 0; u < patchesAlong(spool.faces()[face], stride, 0); u += kPatchesAtOnce)
        write_part({u, v});
    if (level.empty()) return {};
    levels.push_back(std::move(level));
  }
  return inOrder(levels, strides, first_number);
}

FaceRegions::FaceRegions(std::vector<FaceRegion> regions) : regions_(std::move(regions)) {
  std::stable_sort(regions_.begin(), regions_.end(),
                   [](const FaceRegion& a, const FaceRegion& b) { return a.face < b.face; });
}

std::span<const FaceRegion> FaceRegions::of(uint32_t face) const {
  const auto before = [](const FaceRegion& region, uint64_t number) { return region.face < number; };
  const auto first = std::lower_bound(regions_.begin(), regions_.end(), uint64_t{face}, before);
  return {first, std::lower_bound(first, regions_.end(), uint64_t{face} + 1, before)};
}

RegionRows::RegionRows(std::span<const FaceRegion> regions, const RowRange& quads)
    : regions_(regions),
      quads_(quads),
      by_first_(regions.size()),
      changes_(regions.empty() ? 0 : quads.end - quads.begin + 1),
      inside_(quads.end - quads.begin) {
  std::iota(by_first_.begin(), by_first_.end(), 0u);
  by_last_ = by_first_;
  const auto sort_by = [&](std::vector<uint32_t>& numbers, auto row_of) {
    std::sort(numbers.begin(), numbers.end(),
              [&](uint32_t a, uint32_t b) { return row_of(regions_[a]) < row_of(regions_[b]); });
  };
  sort_by(by_first_, [](const FaceRegion& region) { return region.first[1]; });
  sort_by(by_last_, [](const FaceRegion& region) { return region.last[1]; });
}

std::span<const uint8_t> RegionRows::row(uint64_t v) {
  const size_t before = begun_ + ended_;
  for (; begun_ < by_first_.size() && regions_[by_first_[begun_]].first[1] <= v; ++begun_)
    change(regions_[by_first_[begun_]], 1);
  for (; ended_ < by_last_.size() && regions_[by_last_[ended_]].last[1] <= v; ++ended_)
    change(regions_[by_last_[ended_]], -1);
  if (begun_ + ended_ == before) return inside_;
  int32_t regions = 0;
  for (size_t quad = 0; quad < inside_.size(); ++quad) {
    regions += changes_[quad];
    inside_[quad] = regions > 0;
  }
  return inside_;
}

void RegionRows::change(const FaceRegion& region, int32_t by) {
  const auto quad = [&](uint64_t node) { return std::clamp(node, quads_.begin, quads_.end) - quads_.begin; };
  changes_[quad(region.first[0])] += by;
  changes_[quad(region.last[0])] -= by;
}

}  // namespace curvisplat
