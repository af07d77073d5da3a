#include "preprocess/coincidence/record_sorter.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <functional>
#include <limits>
#include <map>
#include <numeric>
#include <random>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "tests/support/temporary_folder.h"

namespace curvisplat {
namespace {

constexpr size_t kRecordDoubles = 5;  // of a record: the last two are made of its number
constexpr size_t kCount = 5000;

std::array<double, kRecordDoubles> recordOf(double along, uint64_t number) {
  const auto n = static_cast<double>(number);
  return {along, -along, std::bit_cast<double>(number), n + 0.5, n * 3};
}

class RecordSorterTest : public testing::Test {
 protected:
  /// Adds records at these positions, in an order without order, and expects them in the right one.
  void expectSorted(const std::vector<double>& along, uint64_t memory_bytes) const {
    std::vector<std::pair<double, uint64_t>> expected;
    for (size_t n = 0; n < along.size(); ++n) expected.emplace_back(along[n], n);
    std::vector<std::pair<double, uint64_t>> added = expected;
    std::shuffle(added.begin(), added.end(), std::mt19937(1));
    std::sort(expected.begin(), expected.end());

    RecordSorter sorter(kRecordDoubles, memory_bytes, folder_.path());
    for (const auto& [position, number] : added) {
      sorter.add(recordOf(position, number));
    }
    size_t next = 0;
    sorter.drain([&](const double* record) {
      ASSERT_LT(next, expected.size());
      const auto& [position, number] = expected[next++];
      ASSERT_EQ(RecordSorter::alongOf(record), position);
      ASSERT_EQ(RecordSorter::acrossOf(record), -position);
      ASSERT_EQ(RecordSorter::numberOf(record), number);
      ASSERT_EQ(record[3], static_cast<double>(number) + 0.5);
      ASSERT_EQ(record[4], static_cast<double>(number) * 3);
    });
    EXPECT_EQ(next, expected.size());
    sorter.drain([](const double*) { FAIL() << "a record that was forgotten"; });
  }

  const TemporaryFolder folder_;
};

/// Positions by what is unusual about them.
std::map<std::string, std::vector<double>> positions() {
  std::map<std::string, std::vector<double>> all;
  const auto add = [&](const char* name, const std::function<double(double)>& at) {
    std::vector<double>& made = all[name];
    for (size_t n = 0; n < kCount; ++n) made.push_back(at(static_cast<double>(n)));
  };
  add("evenly spread", [](double n) { return 0.37 * std::fmod(n * 377, kCount) - 100; });
  add("equal", [](double) { return 2.5; });
  add("few different", [](double n) { return std::fmod(n, 3); });
  add("at one end", [](double n) { return n == 0 ? -1e9 : 1e-3 * n; });
  add("growing", [](double n) { return std::exp(0.2 * n - 500); });
  add("nearly equal", [](double n) { return 1 + n * 0x1p-52; });
  add("subnormal", [](double n) { return n * 0x1p-1070; });
  add("as far apart as can be", [](double n) { return std::fmod(n, 2) == 0 ? -1.7e308 : 1.7e308; });
  return all;
}

TEST_F(RecordSorterTest, SortsInMemory) {
  for (const auto& [name, along] : positions()) {
    SCOPED_TRACE(name);
    expectSorted(along, 1 << 20);
  }
}

TEST_F(RecordSorterTest, SortsInRunsOnDisk) {
  for (const auto& [name, along] : positions()) {
    SCOPED_TRACE(name);
    expectSorted(along, 100'000);
    expectSorted(along, 3000);
  }
}

TEST_F(RecordSorterTest, VisitsRangesThatAreAllTogether) {
  for (const auto& [name, along] : positions())
    for (const uint64_t memory_bytes : {1 << 20, 3000}) {
      SCOPED_TRACE(fmt::format("{}, {} bytes", name, memory_bytes));
      RecordSorter sorter(kRecordDoubles, memory_bytes, folder_.path());
      for (size_t n = 0; n < along.size(); ++n) sorter.add(recordOf(along[n], n));
      sorter.sort(3);
      std::vector<double> ends = sorter.cutsInto(7);
      EXPECT_EQ(ends.size(), 6u);
      EXPECT_TRUE(std::is_sorted(ends.begin(), ends.end()));
      ends.push_back(std::numeric_limits<double>::infinity());
      double from = -ends.back();
      std::vector<std::pair<double, uint64_t>> found, expected;
      for (const double to : ends) {
        sorter.visit(from, to, [&](const double* record) {
          EXPECT_TRUE(RecordSorter::alongOf(record) >= from && RecordSorter::alongOf(record) < to);
          found.emplace_back(RecordSorter::alongOf(record), RecordSorter::numberOf(record));
          return true;
        });
        from = to;
      }
      for (size_t n = 0; n < along.size(); ++n) expected.emplace_back(along[n], n);
      std::sort(expected.begin(), expected.end());
      EXPECT_EQ(found, expected);
    }
}

TEST_F(RecordSorterTest, TakesRecordsFromSeveralThreads) {
  constexpr size_t kThreads = 8, kOfThread = 4000;
  // All stay in memory; some runs; two records a run.
  for (const uint64_t memory_bytes : {4 << 20, 1'500'000, 100'000, 1}) {
    RecordSorter sorter(kRecordDoubles, memory_bytes, folder_.path());
    const size_t of_thread = memory_bytes == 1 ? 20 : kOfThread;
    std::vector<std::thread> threads;
    for (size_t thread = 0; thread < kThreads; ++thread)
      threads.emplace_back([&, thread] {
        std::vector<double> records;
        for (size_t n = 0; n < of_thread; ++n) {
          const uint64_t number = n * kThreads + thread;
          const std::array record = recordOf(static_cast<double>(number * 37 % 1000), number);
          records.insert(records.end(), record.begin(), record.end());
          if (n % 7 != 0 && n + 1 < of_thread) continue;
          sorter.add(records);
          records.clear();
        }
      });
    for (std::thread& thread : threads) thread.join();
    std::vector<std::pair<double, uint64_t>> expected, found;
    for (uint64_t n = 0; n < kThreads * of_thread; ++n)
      expected.emplace_back(static_cast<double>(n * 37 % 1000), n);
    std::sort(expected.begin(), expected.end());
    sorter.drain([&](const double* record) {
      const uint64_t number = RecordSorter::numberOf(record);
      found.emplace_back(RecordSorter::alongOf(record), number);
      EXPECT_EQ(record[4], static_cast<double>(number) * 3);
    });
    EXPECT_EQ(found, expected) << memory_bytes;
  }
}

TEST_F(RecordSorterTest, EndsAVisitWhenItIsToldTo) {
  for (const uint64_t memory_bytes : {1 << 20, 3000}) {
    RecordSorter sorter(kRecordDoubles, memory_bytes, folder_.path());
    for (size_t n = 0; n < kCount; ++n) sorter.add(recordOf(static_cast<double>(n), n));
    sorter.sort();
    uint64_t last = 0;
    sorter.visit(10.5, 4000,
                 [&](const double* record) { return (last = RecordSorter::numberOf(record)) < 100; });
    EXPECT_EQ(last, 100u);
  }
}

TEST_F(RecordSorterTest, SortsFewAndNone) {
  expectSorted({}, 1 << 20);
  expectSorted({1}, 1 << 20);
  expectSorted({3, 1, 2, 1, 3}, 1);
}

}  // namespace
}  // namespace curvisplat
