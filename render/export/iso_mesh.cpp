#include "render/export/iso_mesh.h"

#include <tbb/info.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <limits>
#include <map>
#include <optional>
#include <unordered_map>
#include <utility>
#include <vector>

#include "render/export/field_sampler.h"
#include "render/export/iso_cells.h"
#include "render/export/iso_mesh_file.h"
#include "render/project/tile_set.h"
#include "stream/base/error.h"
#include "stream/base/text.h"
#include "stream/base/threads.h"
#include "stream/cache/manifest.h"
#include "stream/model/kernel.h"

namespace curvisplat {
namespace {

constexpr uint32_t kNoIndex = std::numeric_limits<uint32_t>::max();

/// A lattice around the data with one point more on each side, as a parallel view along the longest axis.
struct LatticeView {
  IsoLattice lattice;
  ScreenView view;

  LatticeView(const Manifest& manifest, uint32_t voxels) {
    const glm::dvec3 extent = manifest.upper - manifest.lower;
    int axis = 0;
    for (int n = 1; n < 3; ++n)
      if (extent[n] > extent[axis]) axis = n;
    const double h = (extent[axis] > 0 ? extent[axis] : 1) / voxels;
    const std::array<int, 3> axes{(axis + 1) % 3, (axis + 2) % 3, axis};
    const std::array<glm::dvec3*, 3> directions{&view.right, &view.down, &view.forward};
    lattice.spacing = h;
    for (size_t n = 0; n < 3; ++n) {
      *directions[n] = glm::dvec3(0.0);
      (*directions[n])[axes[n]] = 1;
      lattice.size[n] = std::min(voxels, static_cast<uint32_t>(std::ceil(extent[axes[n]] / h - 1e-6))) + 3;
    }
    view.size = {static_cast<int>(lattice.size[0]), static_cast<int>(lattice.size[1])};
    view.focal_px = 1 / h;
    view.near = -std::numeric_limits<double>::infinity();
    // Pixel (0, 0) and the plane 0 are at the data's lower corner, less one step and a part: faces of the data in planes of the
    // lattice would be found or not by rounding.
    constexpr double kBefore = 1.03125;
    view.eye = manifest.lower - kBefore * glm::dvec3(h);
    view.eye[axes[0]] -= (0.5 - 0.5 * view.size.width) * h;
    view.eye[axes[1]] -= (0.5 - 0.5 * view.size.height) * h;
  }

  glm::dvec3 dataFromView(const glm::dvec3& at) const {
    return view.eye + at.x * view.right + at.y * view.down + at.z * view.forward;
  }
};

/// Bricks in which the value may be, as IsoSplats takes splats.
std::vector<uint32_t> bricksWith(const CacheReader& cache, size_t variable, double value, double detail) {
  constexpr double kMargin = 1.25, kDeviations = 2;
  std::vector<uint32_t> bricks = bricksOfDetail(cache, detail);
  std::erase_if(bricks, [&](uint32_t n) {
    const BrickVariable& bounds = cache.brickVariables(variable)[n];
    const double spread = kMargin * (kKernelSupport + kMergedReach) * double{bounds.largest_slope} +
                          kDeviations * double{bounds.largest_deviation};
    return value < double{bounds.min} - spread || value > double{bounds.max} + spread;
  });
  return bricks;
}

/// Numbers the vertices that triangles use, in their order, and cuts triangles off at borders.
class Stitcher {
 public:
  Stitcher(const LatticeView& lattice, IsoMeshFile& file) : lattice_(lattice), file_(file) {}

  void add(const IsoCells& cells) {
    for (const IsoCells::Cell& cell : cells.cells)
      vertices_.emplace(cell.number, Vertex{cell.vertex, cell.number, kNoIndex});
    for (const auto& quad : cells.quads) {
      std::array<Vertex*, 4> corners;
      bool all = true;
      for (size_t n = 0; n < 4; ++n) {
        const auto found = vertices_.find(quad[n]);
        all = all && found != vertices_.end();
        if (all) corners[n] = &found->second;
      }
      CURVISPLAT_CHECK(all);
      const auto apart = [&](size_t a, size_t b) {
        return glm::distance(corners[a]->of.at, corners[b]->of.at);
      };
      if (apart(0, 2) <= apart(1, 3)) {
        cut({corners[0], corners[1], corners[2]});
        cut({corners[0], corners[2], corners[3]});
      } else {
        cut({corners[0], corners[1], corners[3]});
        cut({corners[1], corners[2], corners[3]});
      }
    }
  }
  /// Forgets the vertices of cubes that `keep` says no to.
  template <typename Keep>
  void keepOnly(const Keep& keep) {
    std::erase_if(vertices_, [&](const auto& vertex) { return !keep(vertex.first); });
    std::erase_if(cuts_, [&](const auto& cut) { return !keep(cut.first.first) || !keep(cut.first.second); });
  }

 private:
  struct Vertex {
    IsoVertex of;
    uint64_t number;  // of its cube
    uint32_t index;
  };

  uint32_t write(const IsoVertex& vertex) {
    const glm::dvec3 at = lattice_.dataFromView(vertex.at);
    const glm::dvec3 normal = double{vertex.normal.x} * lattice_.view.right +
                              double{vertex.normal.y} * lattice_.view.down +
                              double{vertex.normal.z} * lattice_.view.forward;
    return file_.addVertex(at, glm::vec3(normal));
  }
  uint32_t indexOf(Vertex& vertex) {
    if (vertex.index == kNoIndex) vertex.index = write(vertex.of);
    return vertex.index;
  }

  /// The vertex at which a triangle's edge leaves the data: once for both triangles of an edge.
  uint32_t between(const Vertex& a, const Vertex& b) {
    const Vertex &first = a.number < b.number ? a : b, &second = a.number < b.number ? b : a;
    const auto [at, is_new] = cuts_.try_emplace({first.number, second.number}, kNoIndex);
    if (is_new) {
      const float part = first.of.inside / (first.of.inside - second.of.inside);
      const glm::vec3 normal = glm::mix(first.of.normal, second.of.normal, part);
      at->second = write({glm::mix(first.of.at, second.of.at, double{part}), normal, 0});
    }
    return at->second;
  }

  void cut(const std::array<Vertex*, 3>& corners) {
    std::array<uint32_t, 4> polygon;
    size_t count = 0;
    for (size_t n = 0; n < 3; ++n) {
      Vertex &from = *corners[n], &to = *corners[(n + 1) % 3];
      const bool inside = from.of.inside >= 0;
      if (inside) polygon[count++] = indexOf(from);
      if (inside != (to.of.inside >= 0)) polygon[count++] = between(from, to);
    }
    for (size_t n = 2; n < count; ++n) file_.addTriangle({polygon[0], polygon[n - 1], polygon[n]});
  }

  const LatticeView& lattice_;
  IsoMeshFile& file_;
  std::unordered_map<uint64_t, Vertex> vertices_;           // by the cube's number
  std::map<std::pair<uint64_t, uint64_t>, uint32_t> cuts_;  // of two cubes
};

class IsoMesher {
 public:
  IsoMesher(const CacheReader& cache, size_t variable, const IsoMeshOptions& options, IsoMeshFile& file,
            Progress& progress)
      : cache_(cache),
        variable_(variable),
        options_(options),
        values_{options.value},
        lattice_(cache.manifest(), options.voxels),
        bricks_(bricksWith(cache, variable, options.value, 0.5 * lattice_.lattice.spacing)),
        columns_((lattice_.lattice.size[0] + kTileSide - 1) / kTileSide),
        stitcher_(lattice_, file),
        progress_(progress),
        arena_(
            std::min(static_cast<int>(threadsOrCores(options.threads)), tbb::info::default_concurrency())) {}

  double thinPart() const {
    return static_cast<double>(thin_) / static_cast<double>(std::max(splats_, uint64_t{1}));
  }
  double spacing() const { return lattice_.lattice.spacing; }

  /// Goes through the tiles, as many at a time as have splats that fit into half of the memory.
  void run() {
    const size_t tiles = TileSet::tilesOf(lattice_.view.size);
    progress_.begin("isosurface", tiles, "tiles");
    std::vector<TileRange> left{{0, tiles}};
    while (!left.empty()) {
      const TileRange range = left.back();
      left.pop_back();
      IsoSplats splats(
          {lattice_.view, values_, borderStyleOf(cache_.manifest()), {}, 0, range, options_.memory_bytes / 2},
          bricks_.size());
      read(splats, range);
      if (splats.overflowed()) {
        if (range.count() == 1) throwTooLittle("more");  // a tile of smaller voxels meets fewer splats
        const size_t middle = (range.begin + range.end) / 2;
        left.push_back({middle, range.end});
        left.push_back({range.begin, middle});
        continue;
      }
      arena_.execute([&] { splats.sort(); });
      stitch(splats, range);
    }
    progress_.end();
  }

 private:
  /// `other`: what else than more memory helps.
  [[noreturn]] void throwTooLittle(const char* other) const {
    throw UsageError("--memory {}: is too little for an isosurface by --voxels {}; give more, or {} --voxels",
                     byteText(options_.memory_bytes), options_.voxels, other);
  }

  void read(IsoSplats& splats, const TileRange& range) {
    glm::dvec3 lower, upper;
    boxOf(range, lower, upper);
    const Manifest& manifest = cache_.manifest();
    arena_.execute([&] {
      tbb::parallel_for(size_t{0}, bricks_.size(), [&](size_t part) {
        progress_.throwIfStopped();
        const Brick& brick = cache_.bricks()[bricks_[part]];
        if (splats.overflowed() || !reaches(brick, lower, upper)) return;
        SplatGeometry geometry;
        SplatVariable values;
        cache_.readGeometry(bricks_[part], geometry);
        cache_.readVariable(bricks_[part], variable_, values);
        const SplatRange all{0, static_cast<uint32_t>(geometry.size())};
        splats.add(part, manifest.root.cellMin(brick.cell), arraysOf(std::as_const(geometry)),
                   arraysOf(std::as_const(values)), nullptr, {&all, 1});
      });
    });
  }

  /// The box of the columns of rows of tiles; all of the data along the columns.
  void boxOf(const TileRange& range, glm::dvec3& lower, glm::dvec3& upper) const {
    const double h = spacing();
    const auto first = static_cast<double>(range.begin / columns_ * kTileSide),
               last = static_cast<double>(((range.end - 1) / columns_ + 1) * kTileSide + 4);
    const double height = lattice_.view.size.height;
    lower = cache_.manifest().lower;
    upper = cache_.manifest().upper;
    for (int axis = 0; axis < 3; ++axis)
      if (lattice_.view.down[axis] > 0) {
        lower[axis] = lattice_.view.eye[axis] + (first - 1 - 0.5 * height) * h;
        upper[axis] = lattice_.view.eye[axis] + (last + 1 - 0.5 * height) * h;
      }
  }
  static bool reaches(const Brick& brick, const glm::dvec3& lower, const glm::dvec3& upper) {
    for (int axis = 0; axis < 3; ++axis)
      if (brick.lower[axis] - brick.largest_radius > upper[axis] ||
          brick.upper[axis] + brick.largest_radius < lower[axis])
        return false;
    return true;
  }

  /// Counts a tile's splats, and those that are thinner than half a voxel. A splat in several tiles counts in each.
  void countThin(std::span<const IsoSplats::Placed> splats) {
    splats_ += splats.size();
    thin_ += static_cast<uint64_t>(
        std::count_if(splats.begin(), splats.end(), [&](const IsoSplats::Placed& placed) {
          const IsoSplat& s = *placed.splat;
          return double{
                     std::max({glm::length(s.by_right), glm::length(s.by_down), glm::length(s.by_forward)})} *
                     spacing() >
                 2;
        }));
  }

  void stitch(const IsoSplats& splats, const TileRange& range) {
    const auto workers = static_cast<size_t>(arena_.max_concurrency());
    const uint64_t bytes = options_.memory_bytes / 4;
    std::vector<IsoCells> batch;
    for (size_t begin = range.begin; begin < range.end;) {
      size_t end = begin;
      for (uint64_t taken = 0; end < range.end && end - begin < workers; ++end) {
        taken += isoCellsBytes(splats, end, lattice_.lattice);
        if (taken > bytes) break;
      }
      if (end == begin) throwTooLittle("fewer");
      batch.assign(end - begin, {});
      arena_.execute([&] {
        tbb::parallel_for(size_t{0}, batch.size(), [&](size_t n) {
          progress_.throwIfStopped();
          batch[n] = isoCells(splats, begin + n, lattice_.lattice);
        });
      });
      for (size_t tile = begin; tile < end; ++tile) {
        stitcher_.add(batch[tile - begin]);
        countThin(splats.inTile(tile));
        // What the next tiles share with those before them: the last column of this one, and the last row of a row of tiles.
        const uint64_t x1 = (tile % columns_ + 1) * kTileSide - 1, y1 = (tile / columns_ + 1) * kTileSide - 1;
        const IsoLattice& lattice = lattice_.lattice;
        stitcher_.keepOnly([&](uint64_t number) {
          const uint64_t column = number / lattice.size[2];
          const uint64_t x = column % lattice.size[0], y = column / lattice.size[0];
          return y == y1 || (x == x1 && y + kTileSide > y1) || (y + kTileSide == y1 && x >= x1);
        });
      }
      progress_.advance(end - begin);
      begin = end;
    }
  }

  const CacheReader& cache_;
  const size_t variable_;
  const IsoMeshOptions& options_;
  const std::vector<double> values_;
  const LatticeView lattice_;
  const std::vector<uint32_t> bricks_;
  const size_t columns_;
  Stitcher stitcher_;
  Progress& progress_;
  tbb::task_arena arena_;
  uint64_t splats_ = 0, thin_ = 0;
};

}  // namespace

void requireIsovalue(const CacheReader& cache, size_t variable, double value) {
  const VariableInfo& info = cache.manifest().variables.at(variable);
  if (!(value >= info.min && value <= info.max))
    throw UsageError("--iso {:g}: no isosurface: the values of {} go from {:g} to {:g}", value, info.name,
                     info.min, info.max);
}

IsoMeshReport writeIsoMesh(const CacheReader& cache, size_t variable, const IsoMeshOptions& options,
                           const std::filesystem::path& path, Progress& progress) {
  const VariableInfo& info = cache.manifest().variables.at(variable);
  requireIsovalue(cache, variable, options.value);
  IsoMeshFile file(path);
  IsoMesher mesher(cache, variable, options, file, progress);
  mesher.run();
  if (file.triangles() == 0)
    throw Error("{}: no isosurface of {} at {:g} within voxels of {:g}; give more --voxels",
                cache.path().string(), info.name, options.value, mesher.spacing());
  file.finish(info.name, options.value);
  return {file.vertices(), file.triangles(), mesher.spacing(), mesher.thinPart()};
}

}  // namespace curvisplat
