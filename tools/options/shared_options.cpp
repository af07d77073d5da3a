#include "tools/options/shared_options.h"

#include "tools/options/option_parsers.h"

namespace curvisplat {
namespace {

/// The help of --memory.
std::string memoryHelp(const std::string& note) {
  return "Memory limit, such as 512M or 2G" + note;
}

}  // namespace

CLI::Option* addSizeOption(CLI::App& command, std::string& size) {
  return command.add_option("--size", size, "Size of the picture, WIDTHxHEIGHT in pixels")
      ->capture_default_str();
}

CLI::Option* addLodPixelsOption(CLI::App& command, std::string& pixels, const std::string& note) {
  return command
      .add_option("--lod-pixels", pixels,
                  "Largest screen error of merged splats, in pixels, but up to 4 where the transfer function "
                  "hides it; 0 draws the finest level, against which 1 held 50 dB in nearly every picture "
                  "tried" +
                      note)
      ->capture_default_str();
}

CLI::Option* addMaxSplatsOption(CLI::App& command, std::optional<std::string>& splats,
                                const std::string& note) {
  return command.add_option("--max-splats", splats,
                            "Splat limit, such as 8M or 500K; the largest error is refined first" + note);
}

CLI::Option* addBackendOption(CLI::App& command, std::string& backend) {
  return command
      .add_option("--backend", backend,
                  "Drawing back end: auto, osmesa, egl, egl-quads or cpu; see info --system")
      ->capture_default_str();
}

CLI::Option* addMemoryOption(CLI::App& command, std::string& bytes, const std::string& note) {
  return command.add_option("--memory", bytes, memoryHelp(note))->capture_default_str();
}

CLI::Option* addMemoryOption(CLI::App& command, std::optional<std::string>& bytes, const std::string& note) {
  return command.add_option("--memory", bytes, memoryHelp(note));
}

CLI::Option* addThreadsOption(CLI::App& command, unsigned& threads) {
  return command
      .add_option("--threads", threads, "Number of threads that compute at a time; 0: one per core")
      ->check(CLI::Range(0u, kMaxThreads))
      ->capture_default_str();
}

CLI::Option* addValuePrecisionOption(CLI::App& command, std::string& precision) {
  return command
      .add_option("--value-precision", precision,
                  "Precision of the values stored when a grid is given: auto, normal or fine, as for convert")
      ->capture_default_str();
}

CLI::Option* addFrameTimeOption(CLI::App& command, std::optional<std::string>& milliseconds,
                                const std::string& note) {
  return command.add_option("--frame-time", milliseconds,
                            "Time budget of a picture while the camera moves, in ms" + note);
}

CLI::Option* addStepsOption(CLI::App& command, std::optional<std::string>& steps, const std::string& note) {
  return command.add_option(
      "--steps", steps, "Time steps to take: all, FIRST:LAST or FIRST:LAST:STRIDE, counted from 0" + note);
}

CLI::Option* addSourceOption(CLI::App& command, std::vector<std::filesystem::path>& files,
                             const std::string& note) {
  return command
      .add_option("--source", files,
                  "Take the values from the grid's own cells: from these files, or without any from those "
                  "that the cache names. Exact but within cells of high order, where the cache has "
                  "rounded means" +
                      note)
      ->expected(0, -1);
}

CLI::Option* addStatsOption(CLI::App& command, std::filesystem::path& file) {
  return command.add_option("--stats", file, "Write times, bytes and counts to this JSON file");
}

CLI::Option* addTraceOption(CLI::App& command, std::filesystem::path& file) {
  return command.add_option(
      "--trace", file,
      "Write what each thread does, and when, to this JSON file, for Perfetto and bench/threads.py; with "
      "several ranks FILE.json becomes FILE.0.json, FILE.1.json, ...");
}

}  // namespace curvisplat
