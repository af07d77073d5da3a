// Bricks and caches for tests, all from a seed or a formula. Random bricks; SmallCache, of two levels, with
// its bricks as they are decoded; a random cache, of three levels, that does not compress; a lattice, whose
// pictures can be worked out by hand; and a sparse cache with as many bricks as that of a very large grid,
// and hardly any bytes.
#pragma once

#include <glm/vec3.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <functional>
#include <random>
#include <string>
#include <vector>

#include "stream/cache/cache_writer.h"
#include "stream/codec/brick_codec.h"
#include "stream/model/octree.h"
#include "tests/support/temporary_folder.h"

namespace curvisplat {

/// The properties of random bricks.
struct RandomBrick {
  size_t splats = 1000;
  double unit = 1;     // size of the root cube
  double axis = 1e-3;  // largest axis of a splat, of the unit
  double aspect = 10;  // between a splat's axes, at most
  size_t variables = 1;
  double value = 1;  // size of the scalar
  bool leaf = true;  // with node runs
};

/// A brick of `cell` without any order in it: the worst that a codec can get.
inline BrickSplats randomBrick(const RandomBrick& like, const Cell& cell, uint64_t seed) {
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> unit(0, 1);
  const auto symmetric = [&] { return 2 * unit(random) - 1; };
  BrickSplats brick;
  brick.cell = cell;
  const int lattice_bits = kPositionBits - static_cast<int>(cell.level);
  for (size_t n = 0; n < like.splats; ++n) {
    RootPosition position;
    for (int axis = 0; axis < 3; ++axis)
      position.at[axis] = uint64_t{cell.at[axis]} << lattice_bits | random() >> (64 - lattice_bits);
    brick.positions.push_back(position);
    Splat splat;
    for (int c = 0; c < 3; ++c) {
      splat.axis[c] = like.unit * like.axis * std::pow(like.aspect, -unit(random));
      splat.shear[c] = symmetric();
    }
    splat.weight = splat.axis[0] * splat.axis[1] * splat.axis[2];
    if (n % 7 == 1) splat.weight *= 1 + unit(random);
    if (n % 7 == 2) splat.weight = 0;
    brick.splats.push_back(splat);
  }
  for (size_t v = 0; v < like.variables; ++v) {
    auto& values = brick.variables.emplace_back();
    for (size_t n = 0; n < like.splats; ++n)
      values.push_back({static_cast<float>(like.value * symmetric()),
                        like.value * 0.1 * glm::dvec3(symmetric(), symmetric(), symmetric()),
                        n % 3 == 0 ? like.value * like.value * 0.01 * unit(random) : 0.0});
  }
  if (like.leaf)
    for (size_t from = 0, row = 0; from < like.splats; ++row) {
      const size_t count = std::min<size_t>(like.splats - from, 1 + random() % 40);
      brick.runs.push_back({0, random() % 5, row % 30, row / 30, count});
      from += count;
    }
  return brick;
}

/// A cache of two levels: eight leaves (one cell has two) under one root of merged splats.
struct SmallCache {
  RootCube root{{-1, 2, 3}, 4};
  std::vector<BrickSplats> leaves;  // as decoded
  BrickSplats inner;

  SmallCache() = default;

  void write(const std::filesystem::path& path, bool overwrite = false, uint64_t seed = 1) {
    CacheWriter writer(path, overwrite, root, {{0, "density", "kg/m3", -1, 1}, {1, "mach", "", -1, 1}});
    append(writer, seed);
    writer.finish(manifest());
  }

  Manifest manifest() const {
    Manifest manifest;
    manifest.title = "small";
    manifest.program = "test";
    manifest.sources = {"a.xyz"};
    manifest.reader = "none";
    manifest.lower = root.min;
    manifest.upper = root.min + root.size;
    manifest.blocks = {{"block 1", 50, 30, 40}};
    manifest.nodes = 6000;
    return manifest;
  }

  void append(CacheWriter& writer, uint64_t seed) {
    leaves.clear();
    RandomBrick like;
    like.variables = 2;
    like.unit = root.size;
    double weight = 0;
    for (int octant = 0; octant < 8; ++octant) {
      for (int part = 0; part < (octant == 3 ? 2 : 1); ++part) {
        like.splats = 100 + 37 * static_cast<size_t>(octant);
        BrickSplats leaf =
            randomBrick(like, Cell{}.child(octant), seed * 100 + static_cast<uint64_t>(2 * octant + part));
        writer.append(encodeBrick(root, leaf), 0);
        for (const Splat& splat : leaf.splats) weight += splat.weight;
        leaves.push_back(std::move(leaf));
      }
    }
    like.leaf = false;
    like.splats = 64;
    inner = randomBrick(like, Cell{}, seed * 100 + 50);
    std::vector<size_t> order(inner.size());
    for (size_t n = 0; n < order.size(); ++n) order[n] = n;
    std::stable_sort(order.begin(), order.end(), [&](size_t a, size_t b) {
      return octantOf(inner.positions[a], inner.cell) < octantOf(inner.positions[b], inner.cell);
    });
    BrickSplats sorted = inner;
    for (size_t n = 0; n < order.size(); ++n) {
      sorted.positions[n] = inner.positions[order[n]];
      sorted.splats[n] = inner.splats[order[n]];
      sorted.splats[n].weight = weight / static_cast<double>(inner.size());
      for (size_t v = 0; v < 2; ++v) sorted.variables[v][n] = inner.variables[v][order[n]];
    }
    inner = std::move(sorted);
    writer.append(encodeBrick(root, inner), 0.5f);
  }
};

/// Writes a cache that does not compress, with bricks of very different sizes: a root, eight cells below it,
/// and under each of them two to eight leaves, one of them in two bricks. One scalar. Inner bricks hold
/// splats by octant and of their children's weight.
void writeRandomCache(const std::filesystem::path& path, uint64_t seed = 1, size_t most_splats = 3000);
/// The same, and a third of the splats lie at borders, with codes of all forms. `cells`: they are cells, drawn in pairs.
/// `variables`: 1, or 2 scalars.
void writeRandomCacheWithBorders(const std::filesystem::path& path, uint64_t seed, bool cells,
                                 size_t variables = 1);

inline constexpr int kLatticeSide = 32;  // cells along an axis: the data is the cube [0, 32]³
inline constexpr int kLatticeBricks = 1 + 8 + 64;

/// Writes a small cache whose pictures can be worked out by hand: 32³ unit cells as an octree of three
/// levels. The scalar "f" at x is constant + gradient · x. Every brick has 8³ splats; the inner ones are
/// merged exactly.
void writeLatticeCache(const std::filesystem::path& path, double constant, const glm::dvec3& gradient);

struct LatticeBrick {
  double constant = 0;
  glm::dvec3 gradient{0.0};
  bool leaf = false;
};
/// 8³ splats in a cell of writeLatticeCache(), of level 2 at most.
BrickSplats latticeBrick(const RootCube& root, const Cell& cell, const LatticeBrick& of);

/// Writes a cache of one brick: plates beside one another, of unit length and width, that fill the square [0, 32]² and are
/// `thickness` thick, about z = 16. Two scalars "f" and "g", which rise by 1 through each from 0 and -1.
void writePlatesCache(const std::filesystem::path& path, double thickness);

/// The levels of writeSparseCache() whose bricks hold splats: those of writeLatticeCache().
inline constexpr uint32_t kRealLevels = 3;

/// Writes a cache with as many bricks as that of a very large grid. Its streams are holes in sparse files,
/// but those of its coarsest kRealLevels levels, which can be drawn. It is a full octree of `bricks` bricks,
/// whose deepest level is there in part, with some 11,000 splats a leaf: a million bricks stand for 10^10
/// nodes. `bricks`: above 73. The scalar "f" is x. Takes 700 bytes of memory a brick meanwhile, and on disk
/// 190.
void writeSparseCache(const std::filesystem::path& path, uint64_t bricks);

}  // namespace curvisplat
