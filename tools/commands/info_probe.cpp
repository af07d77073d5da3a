#include "tools/commands/info_probe.h"

#include <fmt/format.h>
#include <glm/geometric.hpp>

#include <cmath>
#include <filesystem>
#include <optional>
#include <span>
#include <utility>

#include "preprocess/probe/point_list.h"
#include "render/annotate/plot.h"
#include "stream/base/error.h"
#include "stream/base/file.h"
#include "tools/options/option_parsers.h"
#include "tools/output/results.h"

namespace curvisplat {
namespace {

using ProbeJson = nlohmann::ordered_json;

std::vector<VariableInfo> variablesOf(std::span<const CacheReader> readers) {
  std::vector<VariableInfo> variables;
  for (const CacheReader& reader : readers)
    variables.insert(variables.end(), reader.manifest().variables.begin(), reader.manifest().variables.end());
  return variables;
}

ProbeJson pointAsJson(const std::vector<VariableInfo>& variables, const PointValues& found, bool of_source) {
  const char* const at = of_source ? "place" : "centre";
  ProbeJson json = {{"block", found.block},
                    {"i", found.i},
                    {"j", found.j},
                    {"k", found.k},
                    {at, {found.place.x, found.place.y, found.place.z}},
                    {"distance", found.distance},
                    {"from", of_source ? "source" : "cache"}};
  json["values"] = ProbeJson::array();
  for (size_t v = 0; v < found.values.size(); ++v)
    json["values"].push_back(
        {{"name", variables[v].name}, {"value", found.values[v]}, {"mean", found.sample[v]}});
  return json;
}

/// A number of the cache has the digits of a float. Empty for what has no value.
std::string numberText(double value, bool of_source) {
  if (std::isnan(value)) return "";
  return of_source ? fmt::format("{}", value) : fmt::format("{}", static_cast<float>(value));
}

void printTable(std::span<const CacheReader> readers, const Probe& probe) {
  const std::vector<VariableInfo> variables = variablesOf(readers);
  std::string names = probe.of_steps ? "step,time,x,y,z" : "x,y,z";
  for (const VariableInfo& variable : variables) names += ',' + variable.name;
  names += ",block,i,j,k,sample_x,sample_y,sample_z";
  for (const VariableInfo& variable : variables) names += ",sample_" + variable.name;
  printLine("{}{}", names, probe.asked.along.empty() ? "" : ",along");
  for (const ProbedStep& step : probe.steps)
    for (size_t n = 0; n < step.found.size(); ++n) {
      const auto& found = step.found[n];
      const glm::dvec3& point = probe.asked.points[n];
      std::string line = probe.of_steps ? fmt::format("{},{},", step.step, step.time) : "";
      line += fmt::format("{},{},{}", point.x, point.y, point.z);
      for (size_t v = 0; v < variables.size(); ++v)
        line += found ? ',' + numberText(found->values[v], probe.of_source) : ",";
      line += found ? fmt::format(",{},{},{},{},{},{},{}", found->block + 1, found->i, found->j, found->k,
                                  found->place.x, found->place.y, found->place.z)
                    : ",,,,,,,";
      for (size_t v = 0; v < variables.size(); ++v)
        line += found ? ',' + numberText(found->sample[v], probe.of_source) : ",";
      if (!probe.asked.along.empty()) line += fmt::format(",{}", probe.asked.along[n]);
      fmt::print("{}\n", line);
    }
}

/// Prints a point in words that need no knowledge of splats.
void printPoint(std::span<const CacheReader> readers, const Probe& probe) {
  const glm::dvec3& at = probe.asked.points.front();
  const std::optional<PointValues>& found = probe.steps.front().found.front();
  const std::string point = fmt::format("{}, {}, {}", at.x, at.y, at.z);
  if (!found) {
    fmt::print("{}: outside of the data\n", point);
    return;
  }
  const Manifest& manifest = readers.front().manifest();
  const bool is_cut = !probe.of_source && manifest.refinement.cutsCells();
  const std::string sample = fmt::format("{}{}", manifest.cells ? "cell" : "node",
                                         is_cut && manifest.isMesh() ? " of the cut mesh" : "");
  const std::string block = manifest.blocks.size() > 1 ? fmt::format("block {}, ", found->block + 1) : "";
  const char* const where = is_cut             ? "; the middle of the part of a cell there is"
                            : !probe.of_source ? ", the middle of whose cell is"
                            : manifest.cells   ? ", whose middle is"
                                               : ",";
  fmt::print("{}: {} {} {}i {}, j {}, k {} (counted from 0){} at {:.6g}, {:.6g}, {:.6g}\n", point,
             probe.of_source && manifest.cells ? "in" : "nearest", sample, block, found->i, found->j,
             found->k, where, found->place.x, found->place.y, found->place.z);
  const std::vector<VariableInfo> variables = variablesOf(readers);
  const int digits = probe.of_source ? 9 : 6;
  for (size_t v = 0; v < variables.size(); ++v) {
    const std::string unit = variables[v].unit.empty() ? "" : " " + variables[v].unit;
    const double value = found->values[v], of_sample = found->sample[v];
    std::string text = "no value";
    if (!std::isnan(value)) text = fmt::format("{:.{}g}{}", value, digits, unit);
    text += " at the point";
    if (!std::isnan(of_sample))
      text += fmt::format("; {:.{}g} {}", of_sample, digits,
                          probe.of_source ? "there" : "in the middle of that cell");
    printLine("  {:<20} {}", variables[v].name, text);
  }
}

/// N points from a to b.
ProbedPoints parseLine(const std::vector<std::string>& words) {
  constexpr const char* kOption = "--probe-line";
  constexpr uint64_t kMaxPoints = 10'000'000;
  const glm::dvec3 from = parsePoint(kOption, words[0]), to = parsePoint(kOption, words[1]);
  const uint64_t count = parseCount(kOption, words[2]);
  if (count < 2 || count > kMaxPoints)
    throw UsageError("{}: {} points; expected 2 to {}", kOption, count, kMaxPoints);
  ProbedPoints asked{true, {}, {}};
  for (uint64_t n = 0; n < count; ++n) {
    const double part = static_cast<double>(n) / static_cast<double>(count - 1);
    asked.points.push_back(from + part * (to - from));
    asked.along.push_back(part * glm::length(to - from));
  }
  return asked;
}

}  // namespace

ProbedPoints parseProbe(const ProbeArguments& arguments) {
  if (!arguments.line.empty()) return parseLine(arguments.line);
  const std::string& text = arguments.at;
  std::error_code ignored;
  if (!std::filesystem::is_regular_file(text, ignored)) {
    if (text.find_first_not_of("0123456789.,+-eE ") != std::string::npos &&
        text.find(',') == std::string::npos)
      throw UsageError("--probe {}: {}; expected a point x,y,z, or a file of points", text,
                       std::filesystem::exists(text, ignored) ? "is not a file" : "there is no such file");
    return {false, {parsePoint("--probe", text)}, {}};
  }
  return {true, parsePointList(readTextFile(text, uint64_t{1} << 30), text), {}};
}

ProbeJson probeAsJson(std::span<const CacheReader> readers, const Probe& probe) {
  const std::vector<VariableInfo> variables = variablesOf(readers);
  ProbeJson steps = ProbeJson::array();
  for (const ProbedStep& step : probe.steps) {
    ProbeJson all = ProbeJson::array();
    for (const auto& of_point : step.found)
      all.push_back(of_point ? pointAsJson(variables, *of_point, probe.of_source) : ProbeJson(nullptr));
    ProbeJson of_step = probe.asked.is_table ? all : all[0];
    if (!probe.of_steps) return of_step;
    steps.push_back({{"step", step.step}, {"time", step.time}, {"probe", std::move(of_step)}});
  }
  return steps;
}

Probe joinedProbe(std::span<const CacheReader> readers, std::vector<Probe> probes) {
  Probe joined = std::move(probes.front());
  if (probes.size() == 1) return joined;
  for (size_t step = 0; step < joined.steps.size(); ++step) {
    std::vector<CacheReader> at_step;
    at_step.reserve(probes.size());
    std::vector<SetValues> sets;
    for (size_t n = 0; n < probes.size(); ++n) {
      Probe& of_set = n == 0 ? joined : probes[n];
      const uint64_t number = joined.steps[step].step;
      const bool has_ended = number >= readers[n].series().steps.size();
      at_step.push_back(has_ended ? readers[n].at(readers[n].position()) : readers[n].atStep(number));
      sets.push_back({&at_step[n], of_set.of_source ? &of_set.source : nullptr,
                      std::move(of_set.steps[step].found), has_ended});
    }
    joined.steps[step].found = joinedValues(sets);
  }
  return joined;
}

void printProbe(std::span<const CacheReader> readers, const Probe& probe) {
  if (probe.isTable())
    printTable(readers, probe);
  else
    printPoint(readers, probe);
}

void plotLine(std::span<const CacheReader> readers, const Probe& probe, const std::filesystem::path& file) {
  requirePlots();
  std::vector<LinePanel> panels;
  const std::vector<VariableInfo> variables = variablesOf(readers);
  for (size_t v = 0; v < variables.size(); ++v) {
    const VariableInfo& variable = variables[v];
    LinePanel panel{variable.name, "length along the line", variable.unit, {}, {}, false, true};
    for (const ProbedStep& step : probe.steps) {
      PlotLine line{probe.of_steps ? fmt::format("{:.6g}", step.time) : "", {}};
      for (size_t n = 0; n < step.found.size(); ++n)
        if (step.found[n] && !std::isnan(step.found[n]->values[v]))
          line.points.push_back({probe.asked.along[n], step.found[n]->values[v]});
      if (!line.points.empty()) panel.lines.push_back(std::move(line));
    }
    if (!panel.lines.empty()) panels.push_back(std::move(panel));
  }
  if (panels.empty())
    throw Error("{}: the line is outside of the data", readers.front().cachePath().string());
  writeFileAtomically(file, drawPlot(panels));
}

}  // namespace curvisplat
