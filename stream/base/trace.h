// Writes what each thread does, and when, to a file (`--trace`) that chrome://tracing and Perfetto open:
// Chrome's trace event format, an array of complete events ("ph": "X").
//
// A scope that is named here is of one of three kinds. bench/threads.py reads them:
//   stage   what the whole program is at: a pass of a conversion, a frame. Work lies within
//   work    this thread computes, reads or writes
//   wait    this thread waits for another one
//
// While no trace is written a scope costs one relaxed load. While one is, two clocks are read at both ends (0.5 us),
// so scopes are bricks, slabs and tiles, never splats. A thread keeps 1024 events (56 KiB), then writes them.
#pragma once

#include <atomic>
#include <cstdint>
#include <filesystem>

namespace curvisplat {

enum class TraceKind { kStage, kWork, kWait };

/// Numbers of what a scope works on; bench/replay_frame.py needs it. Negative: not written.
struct TraceNumbers {
  int64_t number = -1;  // of a brick or a batch
  int64_t splats = -1;
};

/// The process's one trace.
class Trace {
 public:
  /// Creates `path` and begins. `process`: the rank, under which events are shown. Throws Error if it cannot be written.
  /// Only while no trace is written.
  static void begin(const std::filesystem::path& path, unsigned process = 0);
  /// Writes what threads have kept, and closes the file. No scope of another thread may be open. Throws Error if
  /// the file could not be written whole. Nothing if none is written.
  static void end();
  static bool isOn() { return on_.load(std::memory_order_relaxed); }

 private:
  static inline std::atomic<bool> on_ = false;
};

/// Traces the time from here to the end of the scope. `name` has to live as long as the program.
class TraceScope {
 public:
  explicit TraceScope(const char* name, TraceKind kind = TraceKind::kWork, TraceNumbers numbers = {})
      : name_(Trace::isOn() ? name : nullptr), kind_(kind), numbers_(numbers) {
    if (name_) start();
  }
  ~TraceScope() {
    if (name_) record();
  }
  TraceScope(const TraceScope&) = delete;
  TraceScope& operator=(const TraceScope&) = delete;

 private:
  void start();
  void record() const;

  const char* const name_;  // null: not traced
  const TraceKind kind_;
  const TraceNumbers numbers_;
  int64_t wall_ns_ = 0, processor_ns_ = 0;  // when it began, by the clocks of the system and of the thread
};

}  // namespace curvisplat
