#include "tools/commands/info_probe.h"

#include <fmt/format.h>

#include <cmath>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <numeric>
#include <optional>
#include <span>
#include <sstream>

#include "stream/base/error.h"
#include "stream/base/file.h"
#include "tools/options/option_parsers.h"
#include "tools/output/results.h"

namespace curvisplat {
namespace {

using Json = nlohmann::ordered_json;

std::optional<glm::dvec3> pointOf(const std::string& line) {
  glm::dvec3 point(0.0);
  const char* at = line.c_str();
  for (int axis = 0; axis < 3; ++axis) {
    at += std::strspn(at, " \t,;");
    char* end = nullptr;
    point[axis] = std::strtod(at, &end);
    if (end == at || !std::isfinite(point[axis])) return std::nullopt;
    at = end;
  }
  return point;
}

Json jsonOf(const CacheReader& reader, const ProbeResult& found) {
  Json json = {{"block", found.block},
               {"i", found.i},
               {"j", found.j},
               {"k", found.k},
               {"centre", {found.centre.x, found.centre.y, found.centre.z}},
               {"distance", found.distance}};
  json["values"] = Json::array();
  for (size_t v = 0; v < found.variables.size(); ++v)
    json["values"].push_back({{"name", reader.manifest().variables[v].name},
                              {"value", found.variables[v].value},
                              {"mean", found.variables[v].mean}});
  return json;
}

void printTable(const CacheReader& reader, const ProbedPoints& asked,
                std::span<const std::optional<ProbeResult>> found) {
  std::string names = "x,y,z";
  for (const VariableInfo& variable : reader.manifest().variables) names += ',' + variable.name;
  printLine("{},block,i,j,k", names);
  for (size_t n = 0; n < found.size(); ++n) {
    const glm::dvec3& point = asked.points[n];
    std::string line = fmt::format("{},{},{}", point.x, point.y, point.z);
    for (size_t v = 0; v < reader.manifest().variables.size(); ++v)
      line += found[n] ? fmt::format(",{}", found[n]->variables[v].value) : ",";
    fmt::print("{}{}\n", line,
               found[n]
                   ? fmt::format(",{},{},{},{}", found[n]->block + 1, found[n]->i, found[n]->j, found[n]->k)
                   : ",,,,");
  }
}

/// In words that need no knowledge of splats.
void printPoint(const CacheReader& reader, const glm::dvec3& at, const std::optional<ProbeResult>& found) {
  const std::string point = fmt::format("{}, {}, {}", at.x, at.y, at.z);
  if (!found) {
    fmt::print("{}: outside of the data\n", point);
    return;
  }
  const Manifest& manifest = reader.manifest();
  const char* const sample = manifest.cells ? "cell" : "node";
  const std::string block = manifest.blocks.size() > 1 ? fmt::format("block {}, ", found->block + 1) : "";
  const char* const of_refined = manifest.refined > 1 ? " in the refined grid" : "";
  fmt::print(
      "{}: nearest {} {}i {}, j {}, k {} (counted from 0{}), the middle of whose cell is at {:.6g}, {:.6g}, "
      "{:.6g}\n",
      point, sample, block, found->i, found->j, found->k, of_refined, found->centre.x, found->centre.y,
      found->centre.z);
  for (size_t v = 0; v < found->variables.size(); ++v) {
    const VariableInfo& variable = manifest.variables[v];
    printLine("  {:<20} {:.6g}{} at the point; {:.6g} in the middle of that cell", variable.name,
              found->variables[v].value, variable.unit.empty() ? "" : " " + variable.unit,
              found->variables[v].mean);
  }
}

}  // namespace

ProbedPoints parseProbe(const std::string& text) {
  std::error_code ignored;
  if (!std::filesystem::is_regular_file(text, ignored)) return {false, {parsePoint("--probe", text)}};
  ProbedPoints asked{true, {}};
  std::istringstream lines(readTextFile(text, uint64_t{1} << 30));
  std::string line;
  for (size_t number = 1; std::getline(lines, line); ++number) {
    if (line.find_first_not_of(" \t\r,;") == std::string::npos) continue;
    const auto point = pointOf(line);
    if (point)
      asked.points.push_back(*point);
    else if (number > 1)
      throw Error("{}: line {} does not begin with three numbers x,y,z", text, number);
  }
  if (asked.points.empty()) throw Error("{}: has no points; expected lines of x,y,z", text);
  return asked;
}

std::vector<std::optional<ProbeResult>> probeAll(const CacheReader& reader,
                                                 std::span<const glm::dvec3> points) {
  std::vector<size_t> variables(reader.manifest().variables.size());
  std::iota(variables.begin(), variables.end(), size_t{0});
  return probeAll(reader, variables, points);
}

Json probeAsJson(const CacheReader& reader, const ProbedPoints& asked,
                 std::span<const std::optional<ProbeResult>> found) {
  Json all = Json::array();
  for (const auto& of_point : found) all.push_back(of_point ? jsonOf(reader, *of_point) : Json(nullptr));
  return asked.of_file ? all : all[0];
}

void printProbe(const CacheReader& reader, const ProbedPoints& asked,
                std::span<const std::optional<ProbeResult>> found) {
  if (asked.of_file) return printTable(reader, asked, found);
  printPoint(reader, asked.points.front(), found.front());
}

}  // namespace curvisplat
