#include "tools/commands/info_mesh.h"

#include <fmt/format.h>
#include <tbb/info.h>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <numeric>
#include <optional>

#include "preprocess/convert/memory_plan.h"
#include "preprocess/convert/mesh_origin.h"
#include "preprocess/gather/mesh_reader.h"
#include "preprocess/grid/node_reader.h"
#include "stream/base/calendar.h"
#include "stream/base/text.h"
#include "tools/output/command_run.h"
#include "tools/output/results.h"

namespace curvisplat {

InfoEstimate::InfoEstimate(uint64_t splats, SplatsOf what, std::span<const GridBlock> blocks)
    : splats_(splats),
      threads_(static_cast<unsigned>(tbb::info::default_concurrency())),
      needs_(estimateConversion(splats, threads_, what, blocks)) {}

nlohmann::ordered_json InfoEstimate::toJson() const {
  return {{"splats", splats_},
          {"cache_bytes", needs_.cache_bytes},
          {"cache_bytes_per_further_scalar", needs_.bytes_per_further_scalar},
          {"seconds", needs_.seconds},
          {"threads", threads_}};
}

std::string InfoEstimate::toText() const {
  return fmt::format("a cache of about {} with one scalar, {} more per additional scalar; about {} on {}",
                     estimatedBytes(needs_.cache_bytes), estimatedBytes(needs_.bytes_per_further_scalar),
                     estimatedTime(needs_.seconds), countText(threads_, "thread"));
}

namespace {

std::optional<std::string> dateOfStep(const GridDescription& description, size_t step) {
  if (step >= description.times.size()) return std::nullopt;
  return dateOf(description.times[step], {description.time_unit, description.calendar});
}

/// "36 days since 1950-01-01 (1950-02-06 00:00:00)"
std::string timeText(const GridDescription& description, size_t step) {
  std::string text = numberText(description.times[step], 9);
  if (!description.time_unit.empty()) text += fmt::format(" {}", description.time_unit);
  if (const auto date = dateOfStep(description, step)) text += fmt::format(" ({})", *date);
  return text;
}

constexpr uint64_t kChunk = 65536;
constexpr size_t kPiecesListed = 16;
constexpr std::array<const char*, 6> kKinds{"other",  "tetrahedra", "pyramids",
                                            "wedges", "hexahedra",  "polyhedra"};
constexpr std::array<const char*, 6> kKind{"other", "tetrahedron", "pyramid",
                                           "wedge", "hexahedron",  "polyhedron"};

struct MeshInfo {
  const GridDescription* description = nullptr;
  uint64_t points = 0, cells = 0;
  MeshSurvey survey;
  std::vector<ScalarRange> ranges;   // [scalar]
  std::vector<uint64_t> not_finite;  // [scalar], values
  InfoEstimate estimate;
  std::vector<std::string> warnings;
  std::string series;
};

/// Returns how many of the values of drawn samples are not finite.
uint64_t widen(ScalarRange& range, const std::vector<float>& values, const auto& is_drawn) {
  uint64_t not_finite = 0;
  for (size_t n = 0; n < values.size(); ++n) {
    const float value = values[n];
    if (!is_drawn(n)) continue;
    if (!std::isfinite(value)) {
      ++not_finite;
      continue;
    }
    range.min = std::min<double>(range.min, value);
    range.max = std::max<double>(range.max, value);
  }
  return not_finite;
}

/// Ranges of the scalars of one centring.
void measure(const MeshSource& source, Centring centring, MeshInfo& info) {
  std::vector<uint32_t> scalars;
  for (uint32_t n = 0; n < info.description->scalars.size(); ++n)
    if (info.description->scalars[n].centring == centring) scalars.push_back(n);
  if (scalars.empty()) return;
  const Progress progress;
  source.prepare(scalars, MemoryPlan::ofOptions(0, 1, 0).mesh_bytes, progress);
  MeshPoints points;
  MeshCells cells;
  uint64_t point = 0;  // the first of the piece
  for (uint32_t piece = 0; piece < info.description->pieces.size(); ++piece) {
    const MeshPiece& of = info.description->pieces[piece];
    const bool nodes = centring == Centring::kNode;
    const uint64_t samples = nodes ? of.points : of.cells;
    for (uint64_t first = 0; first < samples; first += kChunk) {
      const uint64_t count = std::min(kChunk, samples - first);
      nodes ? source.readPoints(piece, first, count, scalars, points)
            : source.readCells(piece, first, count, scalars, cells);
      for (size_t n = 0; n < scalars.size(); ++n)
        info.not_finite[scalars[n]] +=
            nodes
                ? widen(info.ranges[scalars[n]], points.scalars[n],
                        [&](size_t at) { return !points.hidden[at] && info.survey.used[point + first + at]; })
                : widen(info.ranges[scalars[n]], cells.scalars[n],
                        [&](size_t at) { return !cells.hidden[at] && cells.shapes[at] != CellKind::kNone; });
    }
    point += of.points;
  }
}

MeshInfo inspectMesh(const MeshSource& source) {
  MeshInfo info;
  info.description = &source.description();
  info.ranges.resize(info.description->scalars.size());
  info.not_finite.resize(info.description->scalars.size());
  const MeshReader reader(source, {}, std::nullopt);
  info.points = reader.points();
  info.cells = reader.cells();
  Progress progress{progressBar()};
  progress.begin("reading", info.points, "points");
  info.survey = surveyMesh(reader, progress);
  measure(source, Centring::kNode, info);
  measure(source, Centring::kCell, info);
  info.warnings = info.description->warnings;
  if (std::string open = warningOfOpenPolyhedra(info.survey); !open.empty())
    info.warnings.push_back(std::move(open));
  std::vector<uint32_t> scalars(info.ranges.size());
  std::iota(scalars.begin(), scalars.end(), 0);
  for (std::string& warning : warningsOfRanges(source, scalars, info.ranges))
    info.warnings.push_back(std::move(warning));
  const bool by_cell =
      !info.description->scalars.empty() && info.description->scalars.front().centring == Centring::kCell;
  info.estimate = by_cell ? InfoEstimate(info.survey.drawn_cells, SplatsOf::kMeshCells)
                          : InfoEstimate(info.points - info.survey.unused_points, SplatsOf::kMeshPoints);
  return info;
}

bool hasNoValue(const ScalarRange& range) {
  return range.min > range.max;
}

nlohmann::ordered_json meshAsJson(const MeshInfo& info) {
  const GridDescription& description = *info.description;
  nlohmann::ordered_json json;
  json["format"] = description.format;
  json["files"] = description.files;
  json["nodes"] = info.points;
  json["unused_nodes"] = info.survey.unused_points;
  json["coordinate_bytes"] = description.coordinate_bytes;
  json["blanked"] = {{"by_grid", info.survey.grid.blanked.by_grid},
                     {"not_finite", info.survey.grid.blanked.not_finite}};
  json["cells"]["count"] = info.cells;
  for (size_t kind = 0; kind < kKinds.size(); ++kind)
    json["cells"][kKinds[kind]] = info.survey.cells_of[kind];
  const glm::dvec3 lower = info.survey.grid.lower, upper = info.survey.grid.upper;
  json["bounds"] = {{"lower", {lower.x, lower.y, lower.z}}, {"upper", {upper.x, upper.y, upper.z}}};
  json["pieces"] = nlohmann::ordered_json::array();
  for (const MeshPiece& piece : description.pieces)
    json["pieces"].push_back({{"name", piece.name}, {"nodes", piece.points}, {"cells", piece.cells}});
  json["scalars"] = nlohmann::ordered_json::array();
  for (size_t n = 0; n < info.ranges.size(); ++n) {
    const GridScalar& of = description.scalars[n];
    const bool empty = hasNoValue(info.ranges[n]);
    nlohmann::ordered_json scalar = {{"name", of.name}, {"min", nullptr}, {"max", nullptr}};
    if (!empty) scalar["min"] = info.ranges[n].min;
    if (!empty) scalar["max"] = info.ranges[n].max;
    if (!of.unit.empty()) scalar["unit"] = of.unit;
    scalar["centring"] = of.centring == Centring::kCell ? "cell" : "node";
    json["scalars"].push_back(std::move(scalar));
  }
  if (!info.series.empty()) json["series"] = info.series;
  addTimes(description, json);
  json["estimate"] = info.estimate.toJson();
  json["notes"] = description.notes;
  json["warnings"] = info.warnings;
  return json;
}

void printMeshAsText(const MeshInfo& info) {
  const GridDescription& description = *info.description;
  printLine("{}", description.format);
  if (!info.series.empty()) printLine("series    {}", info.series);
  for (const std::string& warning : info.warnings) printLine("warning: {}", warning);
  printLine("points    {} in {}; {} in no solid cell, {} blanked by the file, {} at NaN or infinity",
            info.points, countText(description.pieces.size(), "piece"), info.survey.unused_points,
            info.survey.grid.blanked.by_grid, info.survey.grid.blanked.not_finite);
  std::string kinds;
  for (size_t kind = 1; kind < kKinds.size(); ++kind)
    if (const uint64_t count = info.survey.cells_of[kind]; count > 0)
      kinds += fmt::format("{}{} {}", kinds.empty() ? "" : ", ", count, (count == 1 ? kKind : kKinds)[kind]);
  if (const uint64_t others = info.survey.cells_of[0]; others > 0)
    kinds += fmt::format("{}{} not solid or blanked by the file", kinds.empty() ? "" : ", ", others);
  printLine("cells     {}: {}", info.cells, kinds);
  if (description.pieces.size() > 1) {
    for (size_t n = 0; n < std::min(kPiecesListed, description.pieces.size()); ++n)
      printLine("  {:<9} {} points, {} cells", description.pieces[n].name, description.pieces[n].points,
                description.pieces[n].cells);
    if (description.pieces.size() > kPiecesListed)
      printLine("  and {} more", description.pieces.size() - kPiecesListed);
  }
  for (int axis = 0; axis < 3; ++axis)
    printLine("{}         {}", "xyz"[axis],
              info.survey.grid.lower[axis] > info.survey.grid.upper[axis]
                  ? "no point"
                  : rangeText(info.survey.grid.lower[axis], info.survey.grid.upper[axis], 9));
  for (const std::string& note : description.notes) printLine("note      {}", note);
  printLine("stored    coordinates in {} precision", description.coordinate_bytes == 8 ? "double" : "single");
  for (size_t n = 0; n < info.ranges.size(); ++n) {
    const GridScalar& scalar = description.scalars[n];
    const ScalarRange& range = info.ranges[n];
    printLine("scalar    {}{}{}: {}", scalar.name,
              scalar.unit.empty() ? "" : fmt::format(" [{}]", scalar.unit),
              scalar.centring == Centring::kCell ? ", cell-centred" : "",
              hasNoValue(range) ? "no value" : rangeText(range.min, range.max, 6));
    if (info.not_finite[n] > 0)
      printLine("          {} of its values {} {}", info.not_finite[n],
                info.not_finite[n] == 1 ? "is" : "are", notFiniteText(description));
  }
  printTimes(description);
  printLine("estimate  {}", info.estimate.toText());
}

}  // namespace

void printTimes(const GridDescription& description) {
  const size_t steps = description.times.size();
  if (steps == 1 && !description.time_unit.empty()) printLine("time      {}", timeText(description, 0));
  if (steps < 2) return;
  printLine("times     {} steps, {} .. {}", steps, timeText(description, 0),
            timeText(description, steps - 1));
  printLine("time      {}; step {} was read", timeText(description, description.time_step),
            description.time_step);
}

void addTimes(const GridDescription& description, nlohmann::ordered_json& json) {
  json["times"] = description.times;
  json["time_step"] = description.time_step;
  if (!description.time_unit.empty()) json["time_unit"] = description.time_unit;
  if (!description.calendar.empty()) json["calendar"] = description.calendar;
  if (const auto date = dateOfStep(description, description.time_step)) json["date"] = *date;
}

void printMeshInfo(const MeshSource& source, const std::string& series, bool json) {
  MeshInfo info = inspectMesh(source);
  info.series = series;
  if (json)
    fmt::print("{}\n",
               meshAsJson(info).dump(2, ' ', false, nlohmann::ordered_json::error_handler_t::replace));
  else
    printMeshAsText(info);
}

}  // namespace curvisplat
