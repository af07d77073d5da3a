// A conversion of a small grid, structured or not, and the addition of a scalar to its cache, from files to files: what
// the disk's failures are tried on.
#pragma once

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "preprocess/addition/add_scalar.h"
#include "preprocess/addition/add_step.h"
#include "preprocess/convert/convert.h"
#include "preprocess/convert/memory_plan.h"
#include "preprocess/formats/open/open_grid.h"
#include "preprocess/formats/plot3d/plot3d_writer.h"
#include "preprocess/gather/gradient_mesh.h"
#include "tests/reference/function_grid.h"
#include "tests/support/faulty_system_calls.h"
#include "tests/support/folder_files.h"
#include "tests/support/temporary_folder.h"

namespace curvisplat {

/// Two curved blocks of `side`³ nodes that share a face; two scalars.
inline FunctionGridSource twoBlocks(uint64_t side) {
  return FunctionGridSource(
      {gridBlock(side, side, side), gridBlock(side, side, side)}, 2, [side](const GridNode& node) {
        const double n = static_cast<double>(side - 1);
        const double u = static_cast<double>(node.i) / n + node.block, v = static_cast<double>(node.j) / n,
                     w = static_cast<double>(node.k) / n;
        const double r = 1 + 0.5 * v * (1 + v);
        const glm::dvec3 at(r * std::cos(u), r * std::sin(u), w + 0.1 * std::sin(3 * u));
        return NodeValues{at, {static_cast<float>(at.x * at.y), static_cast<float>(std::sin(5 * w))}, false};
      });
}

class SmallConversion : public ::testing::Test {
 protected:
  SmallConversion() { std::filesystem::create_directory(work_); }

  /// Writes the grid, and makes the two caches that are expected of it.
  void setUp(const GridSource& grid) {
    Progress progress;
    writePlot3d(grid, input_.path() / "in", progress);
    setUp();
  }
  void setUp() {
    inputs_ = filesOf(input_.path());
    faults::FaultySystemCalls unsynced;
    unsynced.is_unsynced = true;
    const ScopedSystemCalls scope(unsynced);
    convertNow({first_}, {});
    one_ = filesOf(output_);
    std::filesystem::remove_all(output_);
    convertNow({first_, first_ + 1}, {});
    both_ = filesOf(output_);
    startWithOne();
    addNow();
    added_ = filesOf(output_);
    startAnew();
  }

  /// Inputs as they were, and nothing else.
  void startAnew() const {
    writeFiles(input_.path(), inputs_);
    writeFiles(work_, {});
  }
  /// Beside the cache of the first scalar.
  void startWithOne() const {
    startAnew();
    writeFiles(output_, one_);
  }

  struct Words {
    bool overwrite = false, resume = false;
  };
  void convertNow(std::vector<uint32_t> scalars, Words words) const {
    const auto source = open();
    ConvertOptions options;
    options.output = output_;
    options.scalars = std::move(scalars);
    options.overwrite = words.overwrite;
    options.resume = words.resume;
    options.title = "small";
    options.threads = 1;
    options.bucket_splats = 9000;
    options.mesh_bytes = mesh_bytes_;
    options.memory_bytes = leastMemory(2);
    Progress progress;
    convert(*source, options, progress);
  }

  void addNow() const {
    const auto source = open();
    AddScalarOptions options;
    options.cache = output_;
    options.scalars = {first_ + 1};
    options.threads = 1;
    options.bucket_splats = 9000;
    options.memory_bytes = leastMemory(2);
    Progress progress;
    addScalars(*source, options, progress);
  }

  void addStepNow() const {
    const auto source = open();
    AddStepOptions options;
    options.cache = output_;
    options.threads = 1;
    options.bucket_splats = 9000;
    options.memory_bytes = leastMemory(2);
    Progress progress;
    addStep(*source, options, progress);
  }

  std::unique_ptr<DataSource> open() const {
    OpenGridOptions options;
    options.grid = grid_;
    if (const auto solution = input_ / "in.fun"; std::filesystem::exists(solution))
      options.solutions = {solution};
    options.temporary_folder = work_;
    std::unique_ptr<DataSource> source = openData(options);
    if (!with_gradients_) return source;
    return std::make_unique<GradientMesh>(
        std::unique_ptr<MeshSource>(dynamic_cast<MeshSource*>(source.release())), DerivedOptions{}, work_);
  }

  const TemporaryFolder input_, folder_;
  std::filesystem::path grid_ = input_ / "in.xyz";
  const std::filesystem::path work_ = folder_ / "work";
  const std::filesystem::path output_ = work_ / "a.splats";
  uint32_t first_ = 0;                  // of the two scalars
  bool with_gradients_ = false;         // scalars derived from them; of an unstructured grid
  std::optional<uint64_t> mesh_bytes_;  // of an unstructured grid; nullopt: all fits in memory
  Files inputs_;
  Files one_, both_;  // the cache of the first scalar, and of both
  Files added_;       // of both, one after the other: its manifest lists the files in another order
};

}  // namespace curvisplat
