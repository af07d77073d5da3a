// Dumps what the program decodes from a cache, for tests/stream/read_cache_test.py to compare with.
//
//    dump_cache CACHE           writes every brick to standard output, little-endian:
//
//      u64 splats, u64 runs
//      u64 x 5 for each run: block, k, j, i, count
//      f32 x splats for each of x y z a0 a1 a2 l10 l20 l21 weight; u32 x splats: border codes; the same: growth codes
//      f32 x splats for each variable and each of mean, slope 0 1 2, variance
//
//    dump_cache --faces CACHE   writes every patch of the cache's faces:
//
//      u64 nodes, u64 quads, u64 scalars
//      f64 x 3 x nodes: positions; u8 x quads: drawn; f32 x nodes for each scalar
//
//    dump_cache --make FOLDER   makes caches that use rare parts of the format:
//
//      random.splats            a tree of three levels with random splats, runs and weights
//      odd.splats               leaves that share the root cell: smooth rows with holes and border codes, raw shapes
//                               and weights, runs that are not in grid order or overlap
#include <fmt/format.h>

#include <cmath>
#include <cstdio>
#include <exception>
#include <string_view>

#include "stream/cache/cache_reader.h"
#include "stream/cache/cache_writer.h"
#include "stream/cache/faces_file.h"
#include "stream/model/border_code.h"
#include "stream/model/growth_code.h"
#include "tests/support/test_caches.h"

namespace curvisplat {
namespace {

namespace fs = std::filesystem;

template <typename T>
void write(const std::vector<T>& values) {
  std::fwrite(values.data(), sizeof(T), values.size(), stdout);
}

void dump(const fs::path& cache, uint64_t step) {
  const CacheReader reader(cache, step);
  SplatGeometry g;
  SplatVariable v;
  std::vector<NodeRun> runs;
  for (uint32_t n = 0; n < reader.bricks().size(); ++n) {
    reader.readGeometry(n, g, &runs);
    write<uint64_t>({g.size(), runs.size()});
    for (const NodeRun& run : runs) write<uint64_t>({run.block, run.k, run.j, run.i, run.count});
    forEachArrayOfGeometry(g, [](const auto& array) { write(array); });
    for (size_t variable = 0; variable < reader.manifest().variables.size(); ++variable) {
      reader.readVariable(n, variable, v);
      forEachArrayOfVariable(v, [](const auto& array) { write(array); });
    }
  }
}

void dumpFaces(const fs::path& cache) {
  const CacheReader reader(cache);
  const auto faces = FacesReader::open(reader.path(), reader.manifest());
  if (!faces) return;
  for (uint32_t n = 0; n < faces->patches().size(); ++n) {
    const PatchNodes nodes = faces->read(n);
    write<uint64_t>({nodes.positions.size(), nodes.quads.size(), nodes.scalars.size()});
    write(nodes.positions);
    write(nodes.quads);
    for (const std::vector<float>& scalar : nodes.scalars) write(scalar);
  }
}

const RootCube kRoot{{-1, 2, 3}, 4};

/// Appends the splat of sample (i, j, k), whose numbers are smooth in i, j and k.
void addSample(double i, double j, double k, BrickSplats& brick) {
  const double along = std::exp(0.02 * j) * std::cos(0.03 * i),
               across = std::exp(0.02 * j) * std::sin(0.03 * i);
  const glm::dvec3 world =
      kRoot.min + kRoot.size * glm::dvec3(0.2 + 0.2 * along, 0.2 + 0.2 * across, 0.1 + 0.03 * k);
  Splat splat;
  splat.axis = {0.02 * std::exp(0.02 * j), 1e-4 * std::exp(0.3 * j), 0.05};
  splat.shear = {0.1 * i, -0.02 * j * j, 0.3 * k};
  splat.weight = splat.axis[0] * splat.axis[1] * splat.axis[2];
  if (i == 3) splat.weight *= 0.25;
  brick.positions.push_back(kRoot.fromWorld(world));
  brick.splats.push_back(splat);
  const glm::dvec3 inward(std::cos(0.1 * i), std::sin(0.1 * i), 0);
  brick.border_codes.push_back(j == 0 ? packBorderCode({&inward, 1}) : kNoBorder);
  const glm::dvec3 across_inward(-inward.y, inward.x, 0);
  brick.growth_codes.push_back(packGrowthCode({inward, across_inward, {0, 0, 1}}, {0.1 * j, -0.02 * i, 0}));
  brick.variables[0].push_back({0.01 * (i * i + j * j) + k, {0.02 * i, 0.02 * j, 1}, 0});
  brick.variables[1].push_back({along * across, {along, across, 0}, 0.01 * i});
}

BrickSplats emptyBrick() {
  BrickSplats brick;
  brick.variables.resize(2);
  return brick;
}

/// Rows of different lengths, some of them in two runs; planes without their first rows.
BrickSplats smoothLeaf() {
  BrickSplats brick = emptyBrick();
  for (uint64_t k = 0; k < 5; ++k)
    for (uint64_t j = k % 3; j < 9; ++j)
      for (const auto& [from, to] : {std::pair(j % 4, 20 + j), std::pair(24 + j, 40 + 2 * k)}) {
        if (j % 5 == 2 && from > 20) continue;
        brick.runs.push_back({0, from, j, k, to - from});
        for (uint64_t i = from; i < to; ++i)
          addSample(static_cast<double>(i), static_cast<double>(j), static_cast<double>(k), brick);
      }
  return brick;
}

/// Axes and weights over more orders of magnitude than codes can express.
BrickSplats rawLeaf() {
  BrickSplats brick = emptyBrick();
  for (uint64_t i = 0; i < 50; ++i) {
    addSample(static_cast<double>(i), 0, 0, brick);
    for (double& axis : brick.splats.back().axis) axis = std::pow(10.0, 0.4 * static_cast<double>(i) - 10);
    brick.splats.back().weight = i % 3 == 0 ? 1e-30 : 1e30;
  }
  brick.runs.push_back({1, 0, 0, 0, 50});
  return brick;
}

/// Coded shapes, but weights over more orders of magnitude than codes can express; runs backwards.
BrickSplats backwardLeaf() {
  BrickSplats brick = emptyBrick();
  for (uint64_t j = 9; j > 0; --j) {
    brick.runs.push_back({1, 60, j, 2, 8});
    for (uint64_t i = 60; i < 68; ++i) {
      addSample(static_cast<double>(i), static_cast<double>(j), 2, brick);
      if (i % 4 == 1) brick.splats.back().weight *= 1e-100;
    }
  }
  return brick;
}

/// The other leaves have weights that no histogram takes. Its values are coded by their own scale: of one variable the slopes,
/// of the other the means as well.
void makeWithHistogram(const fs::path& path) {
  CacheWriter writer(path, false, kRoot, {{0, "f", "", 1, 20}, {3, "g", "K", -1, 1}});
  Manifest manifest;
  manifest.lower = kRoot.min;
  manifest.upper = kRoot.min + kRoot.size;
  manifest.blocks = {{"a", 60, 10, 5}};
  manifest.requirements = {kScaledValues};
  BrickSplats leaf = smoothLeaf();
  manifest.nodes = leaf.size();
  const std::vector<ValueCoding> codings{{ValuePrecision::kAuto, {5, 0.5}},
                                         {ValuePrecision::kAuto, {0.1, 1e-4}}};
  writer.append(encodeBrick(kRoot, leaf, codings), 0);
  writer.histograms().divide(0, {{2, 5, 7}, {0.1, 0.4, 0.2, 0.3}, {}});
  writer.histograms().add(leaf);
  writer.finish(manifest);
}

void make(const fs::path& folder) {
  writeRandomCache(folder / "random.splats");
  makeWithHistogram(folder / "histogram.splats");
  CacheWriter writer(folder / "odd.splats", false, kRoot, {{0, "f", "", -1, 1}, {3, "g", "K", -1, 1}});
  Manifest manifest;
  manifest.title = "odd \"names\" \\ and, blanks : {ü}";
  manifest.variables = {{0, "f", "", -1, 1}, {3, "g", "K", -1, 1}};
  manifest.lower = kRoot.min;
  manifest.upper = kRoot.min + kRoot.size;
  manifest.blocks = {{"a", 60, 10, 5}, {"b", 70, 10, 5}};
  BrickSplats overlapping = smoothLeaf();
  overlapping.runs[1].i = overlapping.runs[0].i + 1;
  for (BrickSplats leaf : {smoothLeaf(), rawLeaf(), backwardLeaf(), overlapping}) {
    manifest.nodes += leaf.size();
    writer.append(encodeBrick(kRoot, leaf), 0);
  }
  writer.finish(manifest);
}

}  // namespace
}  // namespace curvisplat

int main(int argc, char** argv) {
  const bool is_making = argc == 3 && std::string_view(argv[1]) == "--make";
  const bool of_faces = argc == 3 && std::string_view(argv[1]) == "--faces";
  if (!is_making && argc != 2 && argc != 3) {
    fmt::print(stderr,
               "usage: dump_cache CACHE [STEP] | dump_cache --faces CACHE | dump_cache --make FOLDER\n");
    return 2;
  }
  try {
    if (is_making)
      curvisplat::make(argv[2]);
    else if (of_faces)
      curvisplat::dumpFaces(argv[2]);
    else
      curvisplat::dump(argv[1], argc == 3 ? std::stoull(argv[2]) : 0);
    return std::fflush(stdout) == 0 ? 0 : 1;
  } catch (const std::exception& error) {
    fmt::print(stderr, "dump_cache: {}\n", error.what());
    return 1;
  }
}
