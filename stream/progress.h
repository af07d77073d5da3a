// Tells a person how long work goes on: a bar on a terminal, nothing in a pipe.
#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

namespace curvisplat {

/// Progress of a job in phases. begin() is for the thread that runs the job; advance() is for any thread and
/// costs an atomic addition. Draws to stderr at most ten times a second, and only if stderr is a terminal.
class Progress {
 public:
  Progress();
  ~Progress();

  /// Ends the phase before and begins `phase`, of `total` steps of `unit` ("nodes", "bricks"). 0 is
  /// "unknown".
  void begin(std::string phase, uint64_t total, std::string unit);
  void advance(uint64_t steps);
  /// Ends the last phase and clears the line.
  void end();

  struct Phase {
    std::string name;
    std::string unit;
    double seconds = 0;
    double cpu_seconds = 0;  // of all threads of the process, in the program and in the system
    uint64_t steps = 0;
  };
  /// The phases that have ended, for --stats.
  const std::vector<Phase>& phases() const { return phases_; }

 private:
  void draw();

  const bool terminal_;
  std::string phase_, unit_;
  uint64_t total_ = 0;
  std::atomic<uint64_t> done_ = 0;
  std::atomic<int64_t> next_draw_ms_ = 0;
  std::chrono::steady_clock::time_point start_;
  double cpu_start_s_ = 0;
  std::mutex drawing_;  // guards the terminal
  std::vector<Phase> phases_;
};

}  // namespace curvisplat
