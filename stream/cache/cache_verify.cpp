#include "stream/cache/cache_verify.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/common.hpp>
#include <glm/vector_relational.hpp>

#include "stream/base/error.h"
#include "stream/cache/cache_index.h"
#include "stream/cache/faces_file.h"
#include "stream/cache/value_histogram.h"
#include "stream/model/border_code.h"
#include "stream/model/splats.h"
#include "stream/model/thin_walls.h"
#include "stream/vdb/brick_grids.h"

namespace curvisplat {
namespace {

constexpr size_t kMaxFindings = 100;
constexpr uint64_t kMaxGridBytes = 64 << 10;  // of bricks.vdb per brick; a single brick takes 10 KiB
constexpr double kWeightTolerance = 1e-3;
// Records were computed from doubles before these were rounded to floats.
constexpr double kRounding = 1e-5;

class Verifier {
 public:
  explicit Verifier(const CacheReader& reader)
      : reader_(reader),
        bricks_(reader.bricks()),
        weights_(bricks_.size()),
        whole_(bricks_.size()),
        volumes_(reader.manifest().variables.size()) {}

  CacheVerification verify(Progress* progress) {
    if (progress) progress->begin("verify", bricks_.size(), "bricks");
    for (uint32_t n = 0; n < bricks_.size(); ++n) {
      verifyGeometry(n);
      for (size_t v = 0; v < reader_.manifest().variables.size(); ++v) verifyValues(n, v);
      if (progress) progress->advance(1);
    }
    verifyWeights();
    verifyHistograms();
    verifyGrids();
    verifyThinWalls();
    verifyFaces();
    if (progress) progress->end();
    return std::move(result_);
  }

 private:
  template <typename... Args>
  void find(fmt::format_string<Args...> format, Args&&... args) {
    if (result_.findings.size() < kMaxFindings)
      result_.findings.push_back(fmt::format(format, std::forward<Args>(args)...));
  }

  void findIn(uint32_t n, const std::string& what) {
    const Cell& cell = bricks_[n].cell;
    find("{}: brick {} (level {}, cell {} {} {}): {}", reader_.path().string(), n, cell.level, cell.at[0],
         cell.at[1], cell.at[2], what);
  }

  void verifyGeometry(uint32_t n) {
    std::vector<NodeRun> runs;
    try {
      reader_.readGeometry(n, geometry_, &runs);
    } catch (const Error& error) {
      return find("{}", error.what());
    }
    whole_[n] = true;
    for (float weight : geometry_.weight) weights_[n] += weight;
    verifyBox(n);
    verifyOctants(n);
    verifyRadius(n);
    verifyRuns(n, runs);
  }

  void verifyBox(uint32_t n) {
    const Brick& brick = bricks_[n];
    const glm::dvec3 corner = reader_.manifest().root.cellMin(brick.cell);
    const double slack = kRounding * reader_.manifest().root.cellSize(brick.cell.level);
    const std::vector<float>* const coordinates[] = {&geometry_.x, &geometry_.y, &geometry_.z};
    for (int axis = 0; axis < 3; ++axis) {
      const auto [lowest, highest] =
          std::minmax_element(coordinates[axis]->begin(), coordinates[axis]->end());
      if (std::abs(corner[axis] + *lowest - brick.lower[axis]) > slack ||
          std::abs(corner[axis] + *highest - brick.upper[axis]) > slack)
        findIn(n, fmt::format("its centres span [{}, {}] along {}, its record has [{}, {}]",
                              corner[axis] + *lowest, corner[axis] + *highest, "xyz"[axis], brick.lower[axis],
                              brick.upper[axis]));
    }
  }

  /// The splats of inner bricks are stored octant by octant. Centres within rounding of a middle plane count
  /// for either side.
  void verifyOctants(uint32_t n) {
    const Brick& brick = bricks_[n];
    const double half = 0.5 * reader_.manifest().root.cellSize(brick.cell.level);
    std::array<uint32_t, 8> found{};
    uint32_t uncertain = 0, misplaced = 0;
    uint32_t stored = 0, end = brick.octant_splats[0];
    for (uint32_t s = 0; s < geometry_.size(); ++s) {
      while (s >= end && stored < 7) end += brick.octant_splats[++stored];
      const std::array<double, 3> at{geometry_.x[s] - half, geometry_.y[s] - half, geometry_.z[s] - half};
      const uint32_t octant = (at[0] >= 0) | (at[1] >= 0) << 1 | (at[2] >= 0) << 2;
      const bool certain = std::min({std::abs(at[0]), std::abs(at[1]), std::abs(at[2])}) > kRounding * half;
      ++found[octant];
      uncertain += !certain;
      misplaced += certain && octant != stored;
    }
    for (int octant = 0; octant < 8; ++octant) {
      const int64_t difference = int64_t{found[octant]} - brick.octant_splats[octant];
      if (std::abs(difference) > uncertain)
        findIn(n, fmt::format("octant {} has {} splats, its record has {}", octant, found[octant],
                              brick.octant_splats[octant]));
    }
    if (!brick.isLeaf() && misplaced > 0)
      findIn(n, fmt::format("{} of its splats are not in the order of octants", misplaced));
  }

  void verifyRadius(uint32_t n) {
    const Brick& brick = bricks_[n];
    std::vector<Splat> splats(geometry_.size());
    for (size_t s = 0; s < splats.size(); ++s) {
      splats[s].axis = {geometry_.axis0[s], geometry_.axis1[s], geometry_.axis2[s]};
      splats[s].shear = {geometry_.shear10[s], geometry_.shear20[s], geometry_.shear21[s]};
    }
    const double radius = largestReach(splats, geometry_.border_code);
    if (std::abs(radius - brick.largest_radius) > kRounding * radius)
      findIn(n, fmt::format("its largest radius is {}, its record has {}", radius, brick.largest_radius));
  }

  void verifyRuns(uint32_t n, const std::vector<NodeRun>& runs) {
    if (!bricks_[n].isLeaf()) {
      if (!runs.empty()) findIn(n, "it has children but also nodes (node runs belong to leaves only)");
      return;
    }
    if (runs.empty()) return findIn(n, "it is a leaf without node runs");
    const auto& blocks = reader_.manifest().blocks;
    for (const NodeRun& run : runs) {
      const bool inside = run.block < blocks.size() && run.i + run.count <= blocks[run.block].ni &&
                          run.j < blocks[run.block].nj && run.k < blocks[run.block].nk;
      if (!inside)
        return findIn(n, fmt::format("its run of {} nodes from block {}, {} {} {} is outside of the grid",
                                     run.count, run.block, run.i, run.j, run.k));
    }
  }

  void verifyValues(uint32_t n, size_t v) {
    SplatVariable& values = values_;
    try {
      reader_.readVariable(n, v, values);
    } catch (const Error& error) {
      all_values_ = false;
      return find("{}", error.what());
    }
    addToHistogram(n, v);
    const BrickVariable& record = reader_.brickVariables(v)[n];
    const auto [lowest, highest] = std::minmax_element(values.mean.begin(), values.mean.end());
    double slope = 0, variance = 0;
    for (size_t s = 0; s < values.size(); ++s) {
      const glm::dvec3 w(values.slope0[s], values.slope1[s], values.slope2[s]);
      slope = std::max(slope, drawnSlope(w, whole_[n] ? geometry_.border_code[s] : kNoBorder));
      variance = std::max(variance, double{values.variance[s]});
    }
    const auto differs = [](double found, double recorded) {
      return std::abs(found - recorded) > kRounding * std::abs(recorded);
    };
    // The reader gives a bound for earlier caches.
    const bool slope_differs = reader_.manifest().hasEarlierSlopes()
                                   ? slope > (1 + kRounding) * record.largest_slope ||
                                         record.largest_slope > (1 + kRounding) * kEarlierSlopes * slope
                                   : differs(slope, record.largest_slope);
    if (*lowest != record.min || *highest != record.max || (whole_[n] && slope_differs) ||
        differs(std::sqrt(variance), record.largest_deviation))
      findIn(n, fmt::format(
                    "'{}' has the range [{}, {}], slope {} and deviation {}, its record has [{}, {}], {} "
                    "and {}",
                    reader_.manifest().variables[v].name, *lowest, *highest, slope, std::sqrt(variance),
                    record.min, record.max, record.largest_slope, record.largest_deviation));
  }

  void addToHistogram(uint32_t n, size_t v) {
    all_values_ &= whole_[n];
    if (!bricks_[n].isLeaf() || !whole_[n]) return;
    const VariableInfo& variable = reader_.manifest().variables[v];
    for (size_t s = 0; s < values_.size(); ++s)
      volumes_[v][histogramBin(double{values_.mean[s]}, variable.min, variable.max)] += geometry_.weight[s];
  }

  void verifyHistograms() {
    for (size_t v = 0; v < volumes_.size(); ++v) {
      try {
        if (const auto histogram = stepHistogram(reader_, v)) verifyHistogram(v, *histogram);
      } catch (const Error& error) {
        find("{}", error.what());
      }
    }
  }

  void verifyHistogram(size_t v, const ValueHistogram& histogram) {
    const VariableInfo& variable = reader_.manifest().variables[v];
    const std::string path = reader_.valuesPath(v).string();
    if (histogram.lower != variable.min || histogram.upper != variable.max)
      return find("{}: its histogram goes from {} to {}, the samples from {} to {}", path, histogram.lower,
                  histogram.upper, variable.min, variable.max);
    if (!all_values_) return;
    double volume = 0;
    for (const double of_bin : volumes_[v]) volume += of_bin;
    if (std::abs(histogram.volume - volume) > kWeightTolerance * volume)
      find("{}: its histogram is of a volume of {}, the leaves' weights sum to {}", path, histogram.volume,
           volume);
    for (size_t bin = 0; bin < kHistogramBins; ++bin) {
      const double share = volumes_[v][bin] / volume;
      if (std::abs(histogram.shares[bin] - share) > kRounding)
        return find("{}: bin {} of its histogram has a share of {}, the leaves' splats have {}", path, bin,
                    histogram.shares[bin], share);
    }
  }

  void verifyWeights() {
    double volume = 0;
    bool all = true;
    for (uint32_t n = 0; n < bricks_.size(); ++n) {
      const Brick& brick = bricks_[n];
      all &= whole_[n];
      if (brick.isLeaf()) {
        volume += weights_[n];
        continue;
      }
      double children = 0;
      bool known = whole_[n];
      for (uint32_t c = brick.first_child; c < brick.first_child + brick.child_count; ++c) {
        children += weights_[c];
        known &= whole_[c];
      }
      if (known && std::abs(weights_[n] - children) > kWeightTolerance * children)
        findIn(n, fmt::format("its weights sum to {}, its children's to {}", weights_[n], children));
    }
    const double recorded = reader_.manifest().volume;
    if (all && std::abs(volume - recorded) > kWeightTolerance * recorded)
      find("{}: the leaves' weights sum to {}, the manifest has {}", reader_.path().string(), volume,
           recorded);
  }

  void verifyGrids() {
    const std::filesystem::path path = reader_.path() / "bricks.vdb";
    try {
      const std::vector<std::byte> bytes =
          readListed(reader_.path(), "bricks.vdb", reader_.manifest(), kMaxGridBytes * (bricks_.size() + 1));
      const auto [difference, not_compared] = compareBrickGrids(bytes, reader_.manifest().root, bricks_);
      if (!difference.empty()) find("{}: {}", path.string(), difference);
      if (!not_compared.empty())
        result_.notes.push_back(
            fmt::format("{}: the checksum is right, but the contents were not compared with bricks.bin: {}",
                        path.string(), not_compared));
    } catch (const Error& error) {
      find("{}", error.what());
    }
  }

  void verifyThinWalls() {
    if (!reader_.manifest().hasFeature(kThinWalls)) return;
    try {
      readListed(reader_.path(), kThinWallsFileName, reader_.manifest(), kMaxThinWallsBytes);
    } catch (const Error& error) {
      find("{}", error.what());
    }
  }

  void verifyFaces() {
    for (const FileInfo& info : reader_.manifest().files) {
      if (!isFacesFile(info.name)) continue;
      try {
        const auto faces = FacesReader::open(reader_.path(), reader_.manifest(), info.name);
        for (uint32_t n = 0; n < faces->patches().size(); ++n) verifyPatch(*faces, n);
      } catch (const Error& error) {
        find("{}", error.what());
      }
    }
  }

  void verifyPatch(const FacesReader& faces, uint32_t n) {
    const FacePatch& patch = faces.patches()[n];
    const auto contains = [&](const glm::dvec3& point) {
      // Nodes are rounded to steps, boxes are of what was rounded.
      const glm::dvec3 slack = faces.box().step;
      return glm::all(glm::greaterThanEqual(point, patch.lower - slack)) &&
             glm::all(glm::lessThanEqual(point, patch.upper + slack));
    };
    const auto wrong = [&](const std::string& what) {
      find("{}: patch {} of the faces: {}", faces.path().string(), n, what);
    };
    for (size_t c = patch.first_child; c < patch.first_child + size_t{patch.child_count}; ++c)
      if (!contains(faces.patches()[c].lower) || !contains(faces.patches()[c].upper))
        return wrong(fmt::format("its box does not hold that of its child {}", c));
    try {
      const PatchNodes nodes = faces.read(n);
      const size_t columns = patch.nodes[0], quads = columns - 1;
      for (size_t q = 0; q < nodes.quads.size(); ++q) {
        if (!nodes.quads[q]) continue;
        const size_t corner = q / quads * columns + q % quads;
        for (const size_t node : {corner, corner + 1, corner + columns, corner + columns + 1})
          if (!contains(nodes.positions[node])) return wrong("a quad extends beyond its box");
      }
    } catch (const Error& error) {
      find("{}", error.what());
    }
  }

  const CacheReader& reader_;
  const std::span<const Brick> bricks_;
  std::vector<double> weights_;                              // [brick]
  std::vector<bool> whole_;                                  // [brick]: whether its geometry could be decoded
  std::vector<std::array<double, kHistogramBins>> volumes_;  // [variable]: of the leaves' splats, by bin
  bool all_values_ = true;                                   // could be decoded
  CacheVerification result_;
  SplatGeometry geometry_;
  SplatVariable values_;
};

}  // namespace

CacheVerification verifyCache(const CacheReader& reader, Progress* progress) {
  return Verifier(reader).verify(progress);
}

}  // namespace curvisplat
