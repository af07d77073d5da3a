// The trace of a command (--trace FILE): stream/base/trace.h says what is in it.
#pragma once

#include <filesystem>
#include <vector>

namespace curvisplat {

inline constexpr const char* kTraceHelp =
    "Write what each thread does, and when, to this JSON file, for Perfetto and bench/threads.py; with "
    "several "
    "ranks FILE.json becomes FILE.0.json, FILE.1.json, ...";

class TraceOfRun {
 public:
  /// Begins the trace, unless `path` is empty. `others`: what the command reads and writes. Throws Error if it cannot be
  /// written, or is one of them.
  TraceOfRun(const std::filesystem::path& path, const std::vector<std::filesystem::path>& others);
  /// Ends it, for a command that has failed: what was traced until then stays.
  ~TraceOfRun();
  TraceOfRun(const TraceOfRun&) = delete;
  TraceOfRun& operator=(const TraceOfRun&) = delete;

  /// Ends it. Throws Error if it could not be written whole.
  void end();
};

}  // namespace curvisplat
