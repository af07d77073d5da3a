// Jobs of a FaultSweep: conversion, and the addition of a scalar and of time steps. Each must leave a complete cache or none, and
// no other file.
#pragma once

#include <gtest/gtest.h>

#include <filesystem>
#include <span>

#include "stream/base/error.h"
#include "stream/cache/cache_reader.h"
#include "tests/faults/small_conversion.h"
#include "tests/support/fault_sweep.h"

namespace curvisplat {

class ConversionSweep : public SmallConversion {
 protected:
  faults::FaultSweep converting(Words words) {
    faults::FaultSweep sweep;
    sweep.in_message = folder_.path().parent_path().string();
    sweep.to_be_cut = input_.path().string();
    sweep.prepare = [this] { startAnew(); };
    sweep.job = [this, words] { convertNow({first_, first_ + 1}, words); };
    sweep.check = [this](const faults::FaultOutcome& outcome) { expectWholeOrNothing(outcome); };
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
      for (const faults::Fault& fault : faults) {
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
