// Conversion and the addition of a scalar on a disk that fails, at every call they make: they say so in a
// line, or have done their work. What is there afterwards is whole or no cache, and nothing else is left.
#include <gtest/gtest.h>

#include <algorithm>

#include "stream/base/error.h"
#include "stream/cache/cache_reader.h"
#include "tests/faults/small_conversion.h"
#include "tests/support/fault_sweep.h"

namespace curvisplat {
namespace {

namespace fs = std::filesystem;
using faults::Fault;
using faults::FaultOutcome;
using faults::kFaults;

class ConversionSweep : public SmallConversion {
 protected:
  faults::FaultSweep converting(Words words) {
    faults::FaultSweep sweep;
    sweep.in_message = folder_.path().parent_path().string();
    sweep.to_be_cut = input_.path().string();
    sweep.prepare = [this] { startAnew(); };
    sweep.job = [this, words] { convertNow({0, 1}, words); };
    sweep.check = [this](const FaultOutcome& outcome) { expectWholeOrNothing(outcome); };
    return sweep;
  }
  faults::FaultSweep adding() {
    faults::FaultSweep sweep = converting({});
    sweep.prepare = [this] { startWithOne(); };
    sweep.job = [this] { addNow(); };
    sweep.check = [this](const FaultOutcome& outcome) { expectOneOrBoth(outcome); };
    return sweep;
  }

  /// No folder opens as a cache unless it is one of the two.
  void expectNoneWrong() const {
    for (const auto& entry : fs::directory_iterator(work_)) {
      if (!entry.is_directory()) continue;
      const Files files = filesOf(entry.path());
      if (holdsAllOf(files, one_) || holdsAllOf(files, both_) || holdsAllOf(files, added_)) continue;
      EXPECT_THROW(CacheReader{entry.path()}, Error) << entry.path();
    }
  }
  /// Nothing is there but the output, and it has these files.
  void expectOnly(const Files& expected) const {
    for (const auto& entry : fs::directory_iterator(work_)) EXPECT_EQ(entry.path(), output_);
    const Files files = filesOf(output_);
    EXPECT_EQ(files.size(), expected.size());
    EXPECT_TRUE(holdsAllOf(files, expected));
  }

  void expectWholeOrNothing(const FaultOutcome& outcome) const {
    expectNoneWrong();
    if (outcome.has_refused_removal) {
      // What is left is in nobody's way.
      if (!fs::exists(output_)) convertNow({0, 1}, {true, false});
      EXPECT_TRUE(holdsAllOf(filesOf(output_), both_));
    } else if (outcome.error.empty()) {
      expectOnly(both_);
    } else {
      EXPECT_TRUE(fs::is_empty(work_)) << outcome.error;
    }
  }
  void expectOneOrBoth(const FaultOutcome& outcome) const {
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
};

TEST_F(ConversionSweep, AConversionIsWholeOrNothing) {
  setUp(twoBlocks(10));
  for (const Fault& fault : kFaults) {
    EXPECT_GE(converting({}).run(fault), 4) << fault.name;
    if (HasFailure()) return;
  }
}

TEST_F(ConversionSweep, AnOldCacheIsReplacedOrAsItWas) {
  setUp(twoBlocks(10));
  faults::FaultSweep sweep = converting({true, false});
  sweep.prepare = [this] { startWithOne(); };
  sweep.check = [this](const FaultOutcome& outcome) {
    expectNoneWrong();
    const Files files = filesOf(output_);
    const bool is_done = holdsAllOf(files, both_);
    EXPECT_TRUE(is_done || (!outcome.error.empty() && holdsAllOf(files, one_))) << outcome.error;
    if (!outcome.has_refused_removal) expectOnly(outcome.error.empty() ? both_ : one_);
  };
  for (const Fault& fault : {faults::kFailsOnce, faults::kFailsToSync, faults::kFailsToRename}) {
    sweep.run(fault);
    if (HasFailure()) return;
  }
}

TEST_F(ConversionSweep, AnAdditionIsThereOrNot) {
  setUp(twoBlocks(10));
  for (const Fault& fault : kFaults) {
    EXPECT_GE(adding().run(fault), 2) << fault.name;
    if (HasFailure()) return;
  }
}

/// A second and a third time step: the first addition makes the file of steps, the next appends to it.
TEST_F(ConversionSweep, AStepIsThereOrNot) {
  setUp(twoBlocks(10));
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
    sweep.check = [&](const FaultOutcome& outcome) {
      Files files = filesOf(output_);
      const bool is_done = holdsAllOf(files, after);
      // On a disk that is gone, what was appended cannot be cut. No manifest lists it.
      if (const auto steps = before.find("steps.bin");
          is_gone && !is_done && steps != before.end() && files["steps.bin"].starts_with(steps->second))
        files["steps.bin"] = steps->second;
      EXPECT_TRUE(is_done || (!outcome.error.empty() && holdsAllOf(files, before))) << outcome.error;
      if (outcome.has_refused_removal) return;
      EXPECT_TRUE(files == (is_done ? after : before));
      for (const auto& entry : fs::directory_iterator(work_)) EXPECT_EQ(entry.path(), output_);
    };
    for (const Fault& fault : kFaults) {
      is_gone = fault.at == faults::kFailsFromThenOn.at;
      EXPECT_GE(sweep.run(fault), 2) << fault.name;
      if (HasFailure()) return;
    }
    startAnew();
    writeFiles(output_, after);
    before = after;
  }
}

/// A text goes through a temporary file.
TEST_F(ConversionSweep, ATextIsConvertedOrNot) {
  const FunctionGridSource grid = twoBlocks(6);
  std::string text = "2\n6 6 6 6 6 6\n";
  for (uint32_t block = 0; block < 2; ++block) {
    NodeArrays nodes;
    grid.read(block, {0, 6, 0, 6}, {}, nodes);
    for (const auto* axis : {&nodes.x, &nodes.y, &nodes.z})
      for (const double number : *axis) text += fmt::format("{}\n", number);
  }
  grid_ = input_ / "text.xyz";
  writeFileAtomically(grid_, text);
  setUp(grid);
  for (const Fault& fault : {faults::kFailsOnce, faults::kIsFull, faults::kIsCutOff}) {
    converting({}).run(fault);
    if (HasFailure()) return;
  }
}

/// Several buckets, and levels.
TEST_F(ConversionSweep, ALargerOneIsWholeOrNothing) {
  setUp(twoBlocks(33));
  writeFiles(output_, both_);
  ASSERT_GT(CacheReader(output_).manifest().levels, 1u);
  faults::FaultSweep conversion = converting({}), addition = adding();
  conversion.stride = addition.stride = 37;
  EXPECT_GE(conversion.run(faults::kFailsOnce), 20);
  ASSERT_FALSE(HasFailure());
  EXPECT_GE(addition.run(faults::kFailsOnce), 14);
}

TEST_F(ConversionSweep, ShortInterruptedAndSlowTransfersChangeNothing) {
  setUp(twoBlocks(10));
  for (const bool is_slow : {false, true}) {
    startAnew();
    faults::FaultySystemCalls faulty;
    faulty.is_unsynced = true;
    faulty.is_slow = is_slow;
    faulty.largest_transfer = 777;
    faulty.interrupt_every = 3;
    const ScopedSystemCalls scope(faulty);
    convertNow({0}, {});
    expectOnly(one_);
    addNow();
    expectOnly(added_);
  }
}

}  // namespace
}  // namespace curvisplat
