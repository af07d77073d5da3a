// `info --probe`: what is known at a point, or at all points of a file.
#pragma once

#include <glm/vec3.hpp>

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "stream/cache/cache_reader.h"
#include "stream/cache/probe.h"

namespace curvisplat {

/// `text`: x,y,z, or the name of a file of points, whose lines begin with three numbers; a first line of words is left out.
/// Throws UsageError, or Error if a line has no point.
struct ProbedPoints {
  bool of_file = false;
  std::vector<glm::dvec3> points;
};
ProbedPoints parseProbe(const std::string& text);

/// Of all scalars; null for points outside of the data.
std::vector<std::optional<ProbeResult>> probeAll(const CacheReader& reader,
                                                 std::span<const glm::dvec3> points);

/// As JSON: an object for a point, null outside; for a file an array of them.
nlohmann::ordered_json probeAsJson(const CacheReader& reader, const ProbedPoints& asked,
                                   std::span<const std::optional<ProbeResult>> found);
/// In words; of a file as a table with commas.
void printProbe(const CacheReader& reader, const ProbedPoints& asked,
                std::span<const std::optional<ProbeResult>> found);

}  // namespace curvisplat
