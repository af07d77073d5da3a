#include "tools/commands/info_steps.h"

#include <fmt/format.h>

#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>

#include "stream/base/calendar.h"
#include "stream/base/error.h"
#include "stream/cache/faces_file.h"
#include "tools/output/results.h"

namespace curvisplat {
namespace {

constexpr uint64_t kMaxLines = 24;

std::string unitOf(const Manifest& manifest) {
  std::string unit = manifest.time_unit;
  if (!manifest.calendar.empty()) unit += (unit.empty() ? "" : ", ") + manifest.calendar + " calendar";
  return unit.empty() ? "" : " [" + unit + "]";
}

std::optional<std::string> dateOfStep(const CacheReader& reader, uint64_t step) {
  const Manifest& manifest = reader.seriesManifest();
  return dateOf(reader.series().steps[step].time, {manifest.time_unit, manifest.calendar});
}

void printStep(const CacheReader& reader, uint64_t number, bool has_dates) {
  const SeriesStep& step = reader.series().steps[number];
  fmt::print("  {:>6} {:>14.8g}", number, step.time);
  if (has_dates) fmt::print(" {:>20}", dateOfStep(reader, number).value_or(""));
  fmt::print(" {:>9}", step.geometry);
  for (const StepValues& values : step.values) fmt::print("   {:.6g} .. {:.6g}", values.min, values.max);
  fmt::print("\n");
}

}  // namespace

void printSteps(const CacheReader& reader) {
  const Series& series = reader.series();
  const Manifest& manifest = reader.seriesManifest();
  const uint64_t steps = series.steps.size();
  if (steps == 1) {
    fmt::print("steps      1\n");
    return;
  }
  printLine("steps      {}, times {:g} to {:g}{}, {} {}", steps, series.steps.front().time,
            series.steps.back().time, unitOf(manifest), series.geometries(),
            series.geometries() == 1 ? "geometry" : "geometries");
  const bool has_dates = dateOfStep(reader, 0).has_value();
  std::string names;
  for (const VariableInfo& variable : manifest.variables) names += " " + variable.name;
  printLine("    step           time{}  geometry   range of{}", has_dates ? "                 date" : "",
            names);
  for (uint64_t step = 0; step < steps; ++step) {
    if (steps > kMaxLines && step == kMaxLines / 2) {
      fmt::print("     ...\n");
      step = steps - kMaxLines / 2;
    }
    printStep(reader, step, has_dates);
  }
}

nlohmann::ordered_json stepsAsJson(const CacheReader& reader) {
  auto json = nlohmann::ordered_json::array();
  const Manifest& manifest = reader.seriesManifest();
  for (uint64_t number = 0; number < reader.series().steps.size(); ++number) {
    const SeriesStep& step = reader.series().steps[number];
    nlohmann::ordered_json entry = {{"time", step.time}, {"geometry", step.geometry}};
    if (const auto date = dateOfStep(reader, number)) entry["date"] = *date;
    for (size_t v = 0; v < step.values.size(); ++v)
      entry["variables"].push_back({{"number", manifest.variables[v].number},
                                    {"name", manifest.variables[v].name},
                                    {"min", step.values[v].min},
                                    {"max", step.values[v].max},
                                    {"bytes", step.values[v].size}});
    json.push_back(std::move(entry));
  }
  return json;
}

bool isOfAnotherStep(const std::string& file, uint64_t step) {
  return isFacesFile(file) && file.starts_with("faces.step") && file != facesFileOfStep(step);
}

uint64_t seriesBytes(const CacheReader& reader) {
  const Series& series = reader.series();
  uint64_t bytes = 0;
  for (const SeriesStep& step : series.steps)
    for (const StepValues& values : step.values) bytes += values.size;
  for (const FileInfo& file : reader.seriesManifest().files)
    if (!file.name.starts_with("var.")) bytes += file.size;
  for (uint32_t geometry = 1; geometry < series.geometries(); ++geometry) {
    const std::filesystem::path folder = reader.cachePath() / geometryFolderName(geometry);
    for (const char* name : {"manifest.json", "bricks.bin", "geometry.bin", "bricks.vdb", "faces.bin"}) {
      std::error_code error;
      const uint64_t size = std::filesystem::file_size(folder / name, error);
      if (!error) bytes += size;
    }
  }
  return bytes;
}

CacheVerification verifySteps(const CacheReader& reader, Progress& progress) {
  const uint64_t steps = reader.series().steps.size();
  if (steps == 1) return verifyCache(reader, &progress);
  CacheVerification all;
  for (uint64_t step = 0; step < steps; ++step) {
    try {
      CacheVerification found = verifyCache(reader.atStep(step), &progress);
      for (const std::string& finding : found.findings)
        all.findings.push_back(fmt::format("step {}: {}", step, finding));
      all.notes = std::move(found.notes);
    } catch (const Interrupted&) {
      throw;
    } catch (const Error& error) {
      all.findings.push_back(fmt::format("step {}: {}", step, error.what()));
    }
  }
  return all;
}

}  // namespace curvisplat
