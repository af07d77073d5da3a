// `info --probe`, `--probe-line`: what is known at a point, at all points of a file or along a line.
#pragma once

#include <glm/vec3.hpp>

#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "stream/cache/cache_reader.h"
#include "tools/options/point_values.h"

namespace curvisplat {

/// The arguments as given.
struct ProbeArguments {
  std::string at;                 // x,y,z or the name of a file of points; empty: no probe
  std::vector<std::string> line;  // from x,y,z, to x,y,z, points
  bool of_source = false;
  std::vector<std::filesystem::path> source;  // none: those that the cache names
  std::filesystem::path plot;                 // of a line

  bool any() const { return !at.empty() || !line.empty(); }
};

/// Lines of a file begin with three numbers; a first line of words is left out.
struct ProbedPoints {
  bool is_table = false;  // of a file, or a line
  std::vector<glm::dvec3> points;
  std::vector<double> along;  // of a line: the length up to each point
};
/// Throws UsageError, or Error if a line of a file has no point.
ProbedPoints parseProbe(const ProbeArguments& arguments);

/// The values found at one step.
struct ProbedStep {
  uint64_t step = 0;
  double time = 0;
  std::vector<std::optional<PointValues>> found;  // [point]
};

/// The probe that is printed.
struct Probe {
  ProbedPoints asked;
  bool of_source = false;
  PointSource source;     // then
  bool of_steps = false;  // of several: a table
  std::vector<ProbedStep> steps;

  bool isTable() const { return asked.is_table || of_steps; }
  bool isOutside() const { return !isTable() && !steps.front().found.front(); }
};

/// Joins the values that several sets of scalars have at the same points, as joinedValues() does. `readers`:
/// of the probes.
Probe joinedProbe(std::span<const CacheReader> readers, std::vector<Probe> probes);
/// A probe as JSON. `probe`: joinedProbe() of the readers, the cache's own first: an object for a point, null outside; of a table an
/// array of them; of several steps an array for each. Values that a set does not have there are null.
nlohmann::ordered_json probeAsJson(std::span<const CacheReader> readers, const Probe& probe);
/// Prints a probe in words, and a table with commas. `probe`: as probeAsJson()'s.
void printProbe(std::span<const CacheReader> readers, const Probe& probe);
/// A PNG file of the values of all scalars along a line. Throws UsageError if the program was built without plots.
void plotLine(std::span<const CacheReader> readers, const Probe& probe, const std::filesystem::path& file);

}  // namespace curvisplat
