// Conversion of structured grids, and the addition of a scalar and of a time step, on a disk that fails, at every call they
// make: they say so in a line, or have done their work. What is there afterwards is whole or no cache, and nothing else is
// left.
#include <gtest/gtest.h>

#include "stream/cache/cache_reader.h"
#include "tests/faults/conversion_sweep.h"

namespace curvisplat {
namespace {

namespace fs = std::filesystem;
using faults::Fault;
using faults::FaultOutcome;
using faults::kFaults;

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

TEST_F(ConversionSweep, AStepIsThereOrNot) {
  setUp(twoBlocks(10));
  expectStepsThereOrNot(kFaults);
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
