// Repeats a job until its run time can be measured reliably.
#pragma once

#include <chrono>
#include <functional>
#include <vector>

namespace curvisplat {

/// Seconds per run of `job`, one number per sample. A sample repeats the job until `sample_s` seconds have
/// passed, at least once. A first run, which warms caches and allocates memory, is not counted.
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
