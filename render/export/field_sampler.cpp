#include "render/export/field_sampler.h"

#include <tbb/info.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/mat3x3.hpp>
#include <glm/matrix.hpp>
#include <utility>

#include "render/project/footprint.h"
#include "render/project/splat_pieces.h"
#include "stream/base/error.h"
#include "stream/cache/manifest.h"

namespace curvisplat {
namespace {

constexpr double kMaxRatio = 1000;  // of V to √det S': beyond it a splat is degenerate
constexpr size_t kKernelSteps = 4096;
constexpr double kMaxPlaces = 4;  // of a box, each way

/// K over equal steps of r².
const std::vector<double>& kernelTable() {
  static const std::vector<double> table = [] {
    std::vector<double> values(kKernelSteps + 2);
    for (size_t n = 0; n < values.size(); ++n)
      values[n] = kernel(kKernelSupport * std::sqrt(static_cast<double>(n) / kKernelSteps));
    return values;
  }();
  return table;
}

/// The lower triangular L of S = L Lᵀ.
glm::dmat3 choleskyOf(const glm::dmat3& s) {
  glm::dmat3 l(0.0);
  l[0][0] = std::sqrt(s[0][0]);
  l[0][1] = s[0][1] / l[0][0];
  l[0][2] = s[0][2] / l[0][0];
  l[1][1] = std::sqrt(s[1][1] - l[0][1] * l[0][1]);
  l[1][2] = (s[1][2] - l[0][2] * l[0][1]) / l[1][1];
  l[2][2] = std::sqrt(s[2][2] - l[0][2] * l[0][2] - l[1][2] * l[1][2]);
  return l;
}

/// L⁻¹ x for a lower triangular L.
glm::dvec3 solved(const glm::dmat3& l, const glm::dvec3& x) {
  const double u0 = x.x / l[0][0], u1 = (x.y - l[0][1] * u0) / l[1][1];
  return {u0, u1, (x.z - l[0][2] * u0 - l[1][2] * u1) / l[2][2]};
}

/// L⁻ᵀ x.
glm::dvec3 solvedTransposed(const glm::dmat3& l, const glm::dvec3& x) {
  const double u2 = x.z / l[2][2], u1 = (x.y - l[1][2] * u2) / l[1][1];
  return {(x.x - l[0][1] * u1 - l[0][2] * u2) / l[0][0], u1, u2};
}

/// The sums of some planes.
class Sums {
 public:
  Sums(const SampleLattice& lattice, uint32_t k_begin, uint32_t k_end, const VariableInfo& info)
      : lattice_(lattice),
        k_begin_(k_begin),
        k_end_(k_end),
        low_(info.min),
        high_(info.max),
        sums_(lattice.planePoints() * (k_end - k_begin)) {}

  /// Pieces that are cut at a face cannot be blurred before they are cut by much more than their size: those get the mean of several
  /// places of each box.
  void add(const glm::dvec3& corner, const SplatPiece& piece) {
    const Shape& p = piece.shape;
    const double a0 = p.axis0, a1 = p.axis1, a2 = p.axis2;
    const glm::dmat3 a{a0, a0 * p.shear10, a0 * p.shear20, 0, a1, a1 * p.shear21, 0, 0, a2};
    glm::ivec3 places(1);
    if (piece.faces.count > 0) {
      const glm::dmat3 s = a * glm::transpose(a);
      for (int axis = 0; axis < 3; ++axis)
        places[axis] = static_cast<int>(
            std::clamp(std::ceil(2 * lattice_.spacing[axis] / std::sqrt(s[axis][axis])), 1.0, kMaxPlaces));
    }
    const glm::dvec3 box = lattice_.spacing / glm::dvec3(places);
    for (int z = 0; z < places.z; ++z)
      for (int y = 0; y < places.y; ++y)
        for (int x = 0; x < places.x; ++x) {
          const glm::dvec3 place = box * (glm::dvec3(x, y, z) + 0.5) - 0.5 * lattice_.spacing;
          addBlurred(corner + glm::dvec3(piece.position) - place, piece, a, box);
        }
  }

  FieldSamples samples() const {
    FieldSamples out{std::vector<float>(sums_.size()), std::vector<float>(sums_.size())};
    for (size_t n = 0; n < sums_.size(); ++n) {
      const Sum& sum = sums_[n];
      const auto density = static_cast<float>(sum.inside);
      out.density[n] = density > kMinDensity ? density : 0;
      out.value[n] = density > kMinDensity
                         ? static_cast<float>(std::clamp(sum.scalar / sum.weight, low_, high_))
                         : std::numeric_limits<float>::quiet_NaN();
    }
    return out;
  }

 private:
  struct Face {
    glm::dvec3 normal{0.0};
    double distance = 0,
           width = 0;  // of a point x from the centre: normal · x + distance; of a box along the normal
  };
  struct Placed {
    glm::dvec3 centre;
    glm::dmat3 l;
    double ratio;
    glm::dvec3 slope{0.0};
    double mean = 0;
    std::array<Face, CutFaces::kMax> faces = {};
    int face_count = 0;
  };
  struct Sum {
    double weight = 0, inside = 0, scalar = 0;
  };
  static_assert(sizeof(Sum) + 2 * sizeof(float) == kSampleBytes);

  /// Adds a piece at `centre`, blurred by `box`, as the share of a lattice's box that it is.
  void addBlurred(const glm::dvec3& centre, const SplatPiece& piece, const glm::dmat3& a,
                  const glm::dvec3& box) {
    glm::dmat3 s = a * glm::transpose(a);
    for (int axis = 0; axis < 3; ++axis)
      s[axis][axis] += box[axis] * box[axis] / (12 * kKernelSigma * kKernelSigma);
    const glm::dmat3 l = choleskyOf(s);
    const double ratio = double{piece.weight} / (l[0][0] * l[1][1] * l[2][2]);
    if (!(ratio > 0 && std::isfinite(ratio))) return;
    const glm::dvec3 share = box / lattice_.spacing;
    Placed placed{centre, l, share.x * share.y * share.z * std::min(ratio, kMaxRatio)};
    placed.slope = solved(l, a * glm::dvec3(piece.slope.w0, piece.slope.w1, piece.slope.w2));
    placed.mean = piece.mean;
    for (const CutFace& face : piece.faces) {
      const glm::dvec3 normal = solvedTransposed(a, glm::dvec3(face.inward));
      placed.faces[static_cast<size_t>(placed.face_count++)] = {normal, face.distance,
                                                                glm::dot(glm::abs(normal), box)};
    }
    std::array<int64_t, 3> first, last;
    for (int axis = 0; axis < 3; ++axis) {
      const double reach = kKernelSupport * std::sqrt(s[axis][axis]);
      const double at = placed.centre[axis] - lattice_.origin[axis], h = lattice_.spacing[axis];
      const int64_t from = axis == 2 ? k_begin_ : 0;
      const int64_t to = axis == 2 ? k_end_ : lattice_.size[static_cast<size_t>(axis)];
      const auto whole = [&](double x) {
        return static_cast<int64_t>(
            std::clamp(x, static_cast<double>(from) - 1, static_cast<double>(to) + 1));
      };
      first[static_cast<size_t>(axis)] = std::max(from, whole(std::ceil((at - reach) / h)));
      last[static_cast<size_t>(axis)] = std::min(to - 1, whole(std::floor((at + reach) / h)));
    }
    for (int64_t k = first[2]; k <= last[2]; ++k)
      for (int64_t j = first[1]; j <= last[1]; ++j) addRow(placed, j, k, first[0], last[0]);
  }

  void addRow(const Placed& splat, int64_t j, int64_t k, int64_t first, int64_t last) {
    const std::vector<double>& table = kernelTable();
    const glm::dvec3& h = lattice_.spacing;
    const glm::dvec3 row = lattice_.origin - splat.centre +
                           glm::dvec3(0, static_cast<double>(j) * h.y, static_cast<double>(k) * h.z);
    Sum* sum = &sums_[static_cast<size_t>((k - k_begin_) * lattice_.size[1] + j) * lattice_.size[0] +
                      static_cast<size_t>(first)];
    for (int64_t i = first; i <= last; ++i, ++sum) {
      const glm::dvec3 x(row.x + static_cast<double>(i) * h.x, row.y, row.z);
      const glm::dvec3 u = solved(splat.l, x);
      const double at = glm::dot(u, u) * (kKernelSteps / (kKernelSupport * kKernelSupport));
      if (!(at < kKernelSteps)) continue;
      const auto step = static_cast<size_t>(at);
      const double share = at - static_cast<double>(step);
      const double weight = splat.ratio * (table[step] + share * (table[step + 1] - table[step]));
      double inside = 1;
      for (int n = 0; n < splat.face_count; ++n) {
        const Face& face = splat.faces[static_cast<size_t>(n)];
        inside *= std::clamp(0.5 + (glm::dot(face.normal, x) + face.distance) / face.width, 0.0, 1.0);
      }
      const double range = high_ - low_;
      const double scalar = std::clamp(splat.mean + glm::dot(splat.slope, u), low_ - range, high_ + range);
      sum->weight += weight;
      sum->inside += weight * inside;
      sum->scalar += weight * scalar;
    }
  }

  const SampleLattice& lattice_;
  const int64_t k_begin_, k_end_;
  const double low_, high_;
  std::vector<Sum> sums_;
};

}  // namespace

std::vector<uint32_t> bricksOfDetail(const CacheReader& cache, double detail) {
  const auto bricks = cache.bricks();
  std::vector<uint32_t> chosen;
  std::vector<bool> wanted(bricks.size(), false);
  for (uint32_t n = 0; n < bricks.size(); ++n) {  // parents come before their children
    const Brick& brick = bricks[n];
    if (brick.parent != kNoBrick && !wanted[n]) continue;
    if (brick.isLeaf() || double{brick.error} <= detail) {
      chosen.push_back(n);
      continue;
    }
    for (uint32_t child = 0; child < brick.child_count; ++child) wanted[brick.first_child + child] = true;
  }
  return chosen;
}

std::vector<uint32_t> bricksOfLevel(const CacheReader& cache, uint32_t level) {
  if (level >= cache.manifest().levels)
    throw UsageError("{}: there is no level {}; the last one is {}", cache.path().string(), level,
                     cache.manifest().levels - 1);
  const auto bricks = cache.bricks();
  std::vector<uint32_t> chosen;
  for (uint32_t n = 0; n < bricks.size(); ++n)
    if (bricks[n].cell.level == level || (bricks[n].cell.level < level && bricks[n].isLeaf()))
      chosen.push_back(n);
  return chosen;
}

std::vector<uint32_t> bricksInBox(const CacheReader& cache, std::span<const uint32_t> bricks,
                                  const glm::dvec3& lower, const glm::dvec3& upper) {
  std::vector<uint32_t> chosen;
  for (const uint32_t n : bricks) {
    const Brick& brick = cache.bricks()[n];
    bool reaches = true;
    for (int axis = 0; axis < 3; ++axis)
      reaches = reaches && brick.lower[axis] - brick.largest_radius <= upper[axis] &&
                brick.upper[axis] + brick.largest_radius >= lower[axis];
    if (reaches) chosen.push_back(n);
  }
  return chosen;
}

FieldSampler::FieldSampler(const CacheReader& cache, size_t variable, std::vector<uint32_t> bricks,
                           const SampleLattice& lattice)
    : cache_(cache), variable_(variable), bricks_(std::move(bricks)), lattice_(lattice) {
  if (!(std::min({lattice.spacing.x, lattice.spacing.y, lattice.spacing.z}) > 0))
    throw UsageError("a lattice's spacing must be above zero");
}

unsigned FieldSampler::threadsWithin(uint64_t bytes, const SampleLattice& lattice, uint32_t slab,
                                     unsigned threads) {
  const auto cores = static_cast<unsigned>(tbb::info::default_concurrency());
  const uint64_t of_thread = kSampleBytes * slab * lattice.planePoints();
  return static_cast<unsigned>(std::min<uint64_t>(threads > 0 ? threads : cores, bytes / of_thread));
}

FieldSamples FieldSampler::planes(uint32_t k_begin, uint32_t k_end, const Progress& progress) const {
  const Manifest& manifest = cache_.manifest();
  Sums sums(lattice_, k_begin, k_end, manifest.variables.at(variable_));
  const BorderStyle borders = borderStyleOf(manifest);
  // The blur widens supports by √3 h / (√12 σ_K) of their radius.
  const glm::dvec3 margin = kKernelSupport / (std::sqrt(12.0) * kKernelSigma) * lattice_.spacing;
  const glm::dvec3 size(lattice_.size[0] - 1, lattice_.size[1] - 1, 0);
  const glm::dvec3 lower = lattice_.origin + lattice_.spacing * glm::dvec3(0, 0, k_begin) - margin;
  const glm::dvec3 upper = lattice_.origin + lattice_.spacing * (size + glm::dvec3(0, 0, k_end - 1)) + margin;
  SplatGeometry g;
  SplatVariable v;
  BorderPieces parts;
  for (const uint32_t brick : bricksInBox(cache_, bricks_, lower, upper)) {
    progress.throwIfStopped();
    cache_.readGeometry(brick, g);
    cache_.readVariable(brick, variable_, v);
    const glm::dvec3 corner = manifest.root.cellMin(cache_.bricks()[brick].cell);
    for (size_t n = 0; n < g.size(); ++n) {
      const SplatPiece whole{{g.x[n], g.y[n], g.z[n]},
                             {g.axis0[n], g.axis1[n], g.axis2[n], g.shear10[n], g.shear20[n], g.shear21[n]},
                             {v.slope0[n], v.slope1[n], v.slope2[n]},
                             v.mean[n],
                             g.weight[n]};
      if (g.border_code[n] == kNoBorder) {
        sums.add(corner, whole);
        continue;
      }
      const size_t count = partsAtBorder(whole, g.border_code[n], borders, parts);
      for (size_t part = 0; part < count; ++part) sums.add(corner, parts[part]);
    }
  }
  return sums.samples();
}

void FieldSampler::sweep(
    uint32_t slab, unsigned threads, Progress& progress,
    const std::function<void(uint32_t k_begin, uint32_t k_end, const FieldSamples&)>& take) const {
  const uint32_t planes_of_all = lattice_.size[2];
  const auto workers = static_cast<uint32_t>(
      threads > 0 ? std::min(static_cast<int>(threads), tbb::info::default_concurrency())
                  : tbb::info::default_concurrency());
  tbb::task_arena arena(static_cast<int>(workers));
  progress.begin("sampling", planes_of_all, "planes");
  std::vector<FieldSamples> batch(workers);
  for (uint32_t begin = 0; begin < planes_of_all; begin += workers * slab) {
    const auto endOf = [&](uint32_t n) { return std::min(planes_of_all, begin + (n + 1) * slab); };
    const uint32_t count = std::min(workers, (planes_of_all - begin + slab - 1) / slab);
    arena.execute([&] {
      tbb::parallel_for(uint32_t{0}, count,
                        [&](uint32_t n) { batch[n] = planes(begin + n * slab, endOf(n), progress); });
    });
    for (uint32_t n = 0; n < count; ++n) take(begin + n * slab, endOf(n), std::exchange(batch[n], {}));
    progress.advance(std::min(planes_of_all, begin + workers * slab) - begin);
  }
  progress.end();
}

}  // namespace curvisplat
