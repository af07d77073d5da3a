// Runs a job often enough for its time to be worth measuring.
#pragma once

#include <chrono>
#include <functional>
#include <vector>

namespace curvisplat {

/// Seconds a run of `job`, one number a sample: each sample is as many runs as take `sample_s` seconds, one
/// at least. A first run, which fills caches and makes memory, is not counted.
inline std::vector<double> secondsOfRuns(double sample_s, unsigned samples,
                                         const std::function<void()>& job) {
  job();
  std::vector<double> seconds;
  for (unsigned sample = 0; sample < samples; ++sample) {
    const auto start = std::chrono::steady_clock::now();
    double passed = 0;
    unsigned runs = 0;
    do {
      job();
      ++runs;
      passed = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    } while (passed < sample_s);
    seconds.push_back(passed / runs);
  }
  return seconds;
}

}  // namespace curvisplat
