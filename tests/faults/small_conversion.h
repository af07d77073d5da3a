// A conversion of a small grid, structured or not, and the additions of a scalar and of time steps to its
// cache, from files to files: what the disk's failures are tried on (SmallConversion). ConversionSweep makes
// them the jobs of a FaultSweep: each must leave a complete cache or none, and no other file.
#pragma once

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "preprocess/addition/add_scalar.h"
#include "preprocess/addition/add_step.h"
#include "preprocess/convert/convert.h"
#include "preprocess/convert/memory_plan.h"
#include "preprocess/formats/open/open_grid.h"
#include "preprocess/formats/plot3d/plot3d_writer.h"
#include "preprocess/gradients/gradient_mesh.h"
#include "stream/base/error.h"
#include "stream/cache/cache_reader.h"
#include "tests/reference/function_grid.h"
#include "tests/support/fault_sweep.h"
#include "tests/support/faulty_system_calls.h"
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
  /// Begins with the cache of the first scalar.
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
    options.limits.bucket_splats = 9000;
    options.limits.mesh_bytes = mesh_bytes_;
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
    options.limits.bucket_splats = 9000;
    options.memory_bytes = leastMemory(2);
    Progress progress;
    addScalars(*source, options, progress);
  }

  void addStepNow() const {
    const auto source = open();
    AddStepOptions options;
    options.cache = output_;
    options.threads = 1;
    options.limits.bucket_splats = 9000;
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

class ConversionSweep : public SmallConversion {
 protected:
  /// Whether to try the n-th fault with one of two jobs, 0 and 1: usually each with one of them, by turns.
  static bool isTriedWith(int job, size_t n) {
    return n % 2 == static_cast<size_t>(job) || faults::isWholeSweep();
  }
  faults::FaultSweep converting(Words words) {
    faults::FaultSweep sweep;
    sweep.in_message = folder_.path().parent_path().string();
    sweep.to_be_cut = input_.path().string();
    sweep.prepare = [this] { startAnew(); };
    sweep.job = [this, words] { convertNow({first_, first_ + 1}, words); };
    sweep.check = [this](const faults::FaultOutcome& outcome) { expectWholeOrNothing(outcome); };
    sweep.stride = 41;
    return sweep;
  }
  faults::FaultSweep adding() {
    faults::FaultSweep sweep = converting({});
    sweep.prepare = [this] { startWithOne(); };
    sweep.job = [this] { addNow(); };
    sweep.check = [this](const faults::FaultOutcome& outcome) { expectOneOrBoth(outcome); };
    return sweep;
  }

  /// No folder opens as a cache unless it is one of the two.
  void expectNoneWrong() const {
    for (const auto& entry : std::filesystem::directory_iterator(work_)) {
      if (!entry.is_directory()) continue;
      const Files files = filesOf(entry.path());
      if (holdsAllOf(files, one_) || holdsAllOf(files, both_) || holdsAllOf(files, added_)) continue;
      EXPECT_THROW(CacheReader{entry.path()}, Error) << entry.path();
    }
  }
  /// Nothing is there but the output, and it has these files.
  void expectOnly(const Files& expected) const {
    for (const auto& entry : std::filesystem::directory_iterator(work_)) EXPECT_EQ(entry.path(), output_);
    const Files files = filesOf(output_);
    EXPECT_EQ(files.size(), expected.size());
    EXPECT_TRUE(holdsAllOf(files, expected));
  }

  void expectWholeOrNothing(const faults::FaultOutcome& outcome) const {
    expectNoneWrong();
    if (outcome.has_refused_removal) {
      // What is left is in nobody's way.
      if (!std::filesystem::exists(output_)) convertNow({first_, first_ + 1}, {true, false});
      EXPECT_TRUE(holdsAllOf(filesOf(output_), both_));
    } else if (outcome.error.empty()) {
      expectOnly(both_);
    } else {
      EXPECT_TRUE(std::filesystem::is_empty(work_)) << outcome.error;
    }
  }
  void expectOneOrBoth(const faults::FaultOutcome& outcome) const {
    expectNoneWrong();
    const Files files = filesOf(output_);
    const bool is_done = holdsAllOf(files, added_);
    EXPECT_TRUE(is_done || (!outcome.error.empty() && holdsAllOf(files, one_))) << outcome.error;
    if (outcome.has_refused_removal) {
      if (is_done) return;
      addNow();
      expectOnly(added_);
    } else {
      expectOnly(is_done ? added_ : one_);
    }
  }

  /// A second and a third time step: the first addition makes the file of steps, the next appends to it.
  void expectStepsThereOrNot(std::span<const faults::Fault> faults) {
    writeFiles(output_, both_);
    Files before = both_;
    for (int step = 1; step < 3; ++step) {
      addStepNow();
      const Files after = filesOf(output_);
      faults::FaultSweep sweep = converting({});
      sweep.prepare = [&] {
        startAnew();
        writeFiles(output_, before);
      };
      sweep.job = [this] { addStepNow(); };
      bool is_gone = false;
      sweep.check = [&](const faults::FaultOutcome& outcome) {
        Files files = filesOf(output_);
        const bool is_done = holdsAllOf(files, after);
        // On a disk that is gone, what was appended cannot be cut. No manifest lists it.
        if (const auto steps = before.find("steps.bin");
            is_gone && !is_done && steps != before.end() && files["steps.bin"].starts_with(steps->second))
          files["steps.bin"] = steps->second;
        EXPECT_TRUE(is_done || (!outcome.error.empty() && holdsAllOf(files, before))) << outcome.error;
        if (outcome.has_refused_removal) return;
        EXPECT_TRUE(files == (is_done ? after : before));
        for (const auto& entry : std::filesystem::directory_iterator(work_)) EXPECT_EQ(entry.path(), output_);
      };
      for (size_t n = 0; n < faults.size(); ++n) {
        if (!isTriedWith(step - 1, n)) continue;
        const faults::Fault& fault = faults[n];
        is_gone = fault.at == faults::kFailsFromThenOn.at;
        EXPECT_GE(sweep.run(fault), 2) << fault.name;
        if (HasFailure()) return;
      }
      startAnew();
      writeFiles(output_, after);
      before = after;
    }
  }
};

}  // namespace curvisplat
