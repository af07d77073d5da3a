// Makes the small caches that prove that later programs still read this version of the format:
//
//    make_version_caches tests/data/caches/version_<n>
//
// To be run once for each version, by the program that is the first to write it; never again for an older
// one. Caches of features that came later (octants, own_blanks, set_steps, steep) are added beside the others, which
// stay.
//
//    blocks.splats      three blocks, two of which share a face, and a hole; levels, two scalars
//    cells.splats       a block with a scalar in its cells
//    faces.splats       a block whose faces have levels of detail and a hole
//    octants.splats     a block with a box of blanked nodes, at whose edges cells lose octants
//    own_blanks.splats  two scalars of a block, and two that have no values in a part of it, each in another
//    set_steps.splats   two steps of two scalars of which one has no values in a part of the block
//    steep.splats       two blocks of cells that grow steeply, up to shorter last ones
//    *.json, *.png      what a reader must get out of them (tests/support/cache_summary.h)
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <exception>
#include <limits>
#include <nlohmann/json.hpp>
#include <numbers>

#include "preprocess/convert/convert.h"
#include "render/image/image_file.h"
#include "stream/base/durable_file.h"
#include "stream/cache/series.h"
#include "tests/reference/function_grid.h"
#include "tests/series/step_series.h"
#include "tests/support/cache_summary.h"

namespace curvisplat {
namespace {

/// Enough nodes for several levels, with plain values that take little space, except in the small third block.
FunctionGridSource blocks() {
  std::vector<GridBlock> made{gridBlock(41, 41, 41), gridBlock(4, 41, 41), gridBlock(9, 9, 7)};
  made[0].has_blanking = true;
  return FunctionGridSource(made, 2, [](const GridNode& node) {
    const auto i = static_cast<double>(node.i), j = static_cast<double>(node.j),
               k = static_cast<double>(node.k);
    if (node.block == 2) {
      const double angle = std::numbers::pi * i / 8, radius = 12 * std::exp(0.08 * j);
      const glm::dvec3 at(20 + radius * std::cos(angle), 20 + radius * std::sin(angle), 45 + 3 * k);
      return NodeValues{at, {static_cast<float>(i * j / 2), static_cast<float>(std::sin(0.3 * at.x))}, false};
    }
    const double along = node.block == 0 ? i : 40 + i;
    const bool in_hole = std::hypot(i - 12, j - 12) < 6 && node.block == 0;
    return NodeValues{glm::dvec3(along + 0.25 * j, j + 0.125 * k, k),
                      {static_cast<float>(along), node.block == 0 ? 0.5f : -0.5f},
                      in_hole};
  });
}

/// Writes what must be read from a set of scalars, in files whose names begin with `beside`.
void summariseSet(const CacheReader& reader, const std::string& beside) {
  nlohmann::json json = summaryOf(reader);
  writeFileDurably(beside + ".json", json.dump(1) + "\n");
  for (size_t variable = 0; variable < reader.manifest().variables.size(); ++variable)
    writeImage(smallPictureOf(reader, variable), fmt::format("{}.{}.png", beside, variable));
}

/// Writes what must be read from the cache at its last step, in files beside it.
void summarise(const fs::path& cache) {
  CacheReader reader(cache);
  if (!reader.series().steps.empty()) reader = reader.atStep(reader.series().steps.size() - 1);
  const std::string beside = fs::path(cache).replace_extension().string();
  summariseSet(reader, beside);
  for (size_t n = 0; n < reader.seriesManifest().own_blanks.size(); ++n)
    summariseSet(reader.ownBlanks(n), fmt::format("{}.{}", beside, ownBlanksFolderName(n)));
}

void make(const GridSource& source, std::vector<uint32_t> scalars, const fs::path& cache) {
  ConvertOptions options;
  options.output = cache;
  options.scalars = std::move(scalars);
  options.differing = DifferingScalars::kKeepApart;
  options.title = cache.stem().string();
  Progress progress;
  convert(source, options, progress);
  summarise(cache);
}

/// A block whose second scalar has values in a part of it, which moves from step to step.
class MovingPart : public FunctionStep {
 public:
  explicit MovingPart(uint64_t step)
      : FunctionStep({{gridBlock(8, 7, 6)}, 2, [step](const GridNode& node) {
                        const glm::dvec3 at(static_cast<double>(node.i) + 0.25 * static_cast<double>(node.j),
                                            static_cast<double>(node.j), 0.5 * static_cast<double>(node.k));
                        const auto value = static_cast<float>(at.x * at.y + static_cast<double>(step));
                        const bool has_none = node.i < 3 + step;
                        return NodeValues{
                            at, {value, has_none ? std::numeric_limits<float>::quiet_NaN() : -value}, false};
                      }}) {
    description_.times = {static_cast<double>(step)};
  }
};

void makeSetSteps(const fs::path& cache) {
  SeriesInput input;
  input.count = 2;
  input.name = [](uint64_t step) { return fmt::format("step {}", step); };
  input.open = [](uint64_t step) { return std::make_unique<MovingPart>(step); };
  input.scalars = [](const GridDescription&) { return std::vector<uint32_t>{0, 1}; };
  SeriesOptions options = optionsFor(cache);
  options.convert.differing = DifferingScalars::kKeepApart;
  convertQuietly(input, options);
  summarise(cache);
}

void makeAll(const fs::path& folder) {
  fs::create_directories(folder);
  make(blocks(), {0, 1}, folder / "blocks.splats");
  const FunctionGridSource nodes({gridBlock(9, 8, 7)}, 0, [](const GridNode& node) {
    const double angle = 0.3 * static_cast<double>(node.i), radius = 1 + 0.2 * static_cast<double>(node.j);
    return NodeValues{
        glm::dvec3(radius * std::cos(angle), radius * std::sin(angle), 0.25 * static_cast<double>(node.k)),
        {},
        false};
  });
  make(CellGridSource(nodes, {[](const GridCell& cell) { return cell.centre.x * cell.centre.z; }}), {0},
       folder / "cells.splats");
  GridBlock with_hole = gridBlock(70, 6, 3);
  with_hole.has_blanking = true;
  const FunctionGridSource tube({with_hole}, 1, [](const GridNode& node) {
    const double angle = 0.05 * static_cast<double>(node.i), radius = 1 + 0.1 * static_cast<double>(node.j);
    const glm::dvec3 at(radius * std::cos(angle), radius * std::sin(angle),
                        0.5 * static_cast<double>(node.k));
    return NodeValues{at, {static_cast<float>(angle)}, node.i > 40 && node.i < 46 && node.j > 2};
  });
  make(tube, {0}, folder / "faces.splats");
  GridBlock with_box = gridBlock(10, 9, 8);
  with_box.has_blanking = true;
  const FunctionGridSource around_box({with_box}, 1, [](const GridNode& node) {
    const auto inside = [](uint64_t index) { return index > 2 && index < 6; };
    const glm::dvec3 at(static_cast<double>(node.i) + 0.25 * static_cast<double>(node.j),
                        static_cast<double>(node.j), 0.5 * static_cast<double>(node.k));
    return NodeValues{
        at, {static_cast<float>(at.x * at.y)}, inside(node.i) && inside(node.j) && inside(node.k)};
  });
  make(around_box, {0}, folder / "octants.splats");
  const FunctionGridSource growing({gridBlock(6, 9, 8), gridBlock(5, 9, 8)}, 1, [](const GridNode& node) {
    const auto steep = [](uint64_t index, uint64_t last) {
      return std::pow(1.9, static_cast<double>(std::min(index, last - 1))) + (index == last ? 12.0 : 0.0);
    };
    const glm::dvec3 at(static_cast<double>(node.i + 5 * node.block), steep(node.j, 8), steep(node.k, 7));
    return NodeValues{at, {static_cast<float>(at.x + 0.1 * at.y)}, false};
  });
  make(growing, {0}, folder / "steep.splats");
  const FunctionGridSource parts({gridBlock(8, 7, 6)}, 4, [](const GridNode& node) {
    const glm::dvec3 at(static_cast<double>(node.i) + 0.25 * static_cast<double>(node.j),
                        static_cast<double>(node.j), 0.5 * static_cast<double>(node.k));
    const auto value = static_cast<float>(at.x * at.y);
    const float none = std::numeric_limits<float>::quiet_NaN();
    return NodeValues{at, {node.i < 3 ? none : value, value, node.k > 3 ? none : value, -value}, false};
  });
  make(parts, {0, 1, 2, 3}, folder / "own_blanks.splats");
  makeSetSteps(folder / "set_steps.splats");
}

}  // namespace
}  // namespace curvisplat

int main(int argc, char** argv) {
  if (argc != 2) {
    fmt::print(stderr, "make_version_caches: name a folder\n");
    return 2;
  }
  try {
    curvisplat::makeAll(argv[1]);
    return 0;
  } catch (const std::exception& error) {
    fmt::print(stderr, "make_version_caches: {}\n", error.what());
    return 1;
  }
}
