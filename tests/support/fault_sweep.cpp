#include "tests/support/fault_sweep.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <regex>

#include "stream/base/error.h"

namespace curvisplat::faults {
namespace {

/// Whether the line gives the system's reason. There are many things to say about a file that is cut off.
bool tellsWhy(const std::string& line, const Fault& fault) {
  return fault.error == 0 || line.find(std::strerror(fault.error)) != std::string::npos;
}

}  // namespace

bool namesTemporaryFile(const std::string& message) {
  static const std::regex temporary(
      R"(\.(part|partial|tmp|unpacked)\b|\.add-[0-9a-f]{16}|\.rank\d|dry-run\.)");
  return std::regex_search(message, temporary);
}

int64_t FaultSweep::run(const Fault& fault) const {
  constexpr int64_t kFirstOnes = 6;  // fewer than of bytes: jobs are tried with several faults
  int64_t tried = 0;
  for (int64_t at = 0;; at = nextInSweep(at, stride, kFirstOnes), ++tried) {
    const ::testing::ScopedTrace trace(__FILE__, __LINE__, fmt::format("{} at {}", fault.name, at));
    prepare();
    const size_t descriptors = openDescriptors();
    FaultySystemCalls faulty;
    faulty.*fault.at = at;
    faulty.error = fault.error;
    faulty.to_be_cut = to_be_cut;
    faulty.is_unsynced = true;
    FaultOutcome outcome;
    try {
      const ScopedSystemCalls scope(faulty);
      job();
    } catch (const Error& error) {
      outcome.error = error.what();
      EXPECT_EQ(std::count(outcome.error.begin(), outcome.error.end(), '\n'), 0) << outcome.error;
      EXPECT_NE(outcome.error.find(in_message), std::string::npos) << outcome.error;
      EXPECT_TRUE(tellsWhy(outcome.error, fault)) << outcome.error;
      EXPECT_FALSE(fault.error == ENOSPC && namesTemporaryFile(outcome.error)) << outcome.error;
    }
    EXPECT_EQ(openDescriptors(), descriptors) << outcome.error;
    outcome.has_refused_removal = faulty.has_refused_removal;
    outcome.has_struck = faulty.has_failed;
    EXPECT_TRUE(outcome.has_struck || outcome.error.empty()) << outcome.error;
    check(outcome);
    if (!outcome.has_struck || ::testing::Test::HasFailure()) return tried;
  }
}

}  // namespace curvisplat::faults
