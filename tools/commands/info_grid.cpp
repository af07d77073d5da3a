#include "tools/commands/info_grid.h"

#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <optional>
#include <vector>

#include "preprocess/formats/open/series_files.h"
#include "preprocess/grid/grid_source.h"
#include "preprocess/survey/block_overlap.h"
#include "preprocess/survey/grid_statistics.h"
#include "stream/base/progress.h"
#include "stream/base/text.h"
#include "tools/commands/info_mesh.h"
#include "tools/options/convert_arguments.h"
#include "tools/output/command_run.h"
#include "tools/output/results.h"

namespace curvisplat {
namespace {

constexpr uint64_t kSlabBytes = uint64_t{32} << 20, kPointBytes = uint64_t{128} << 20;
constexpr size_t kBlocksListed = 16;

/// The grid's description and what was measured.
struct GridInfo {
  const GridDescription* description = nullptr;
  std::vector<uint32_t> stored, derived;  // positions in description->scalars
  GridStatistics statistics;              // ranges are those of `stored`
  std::vector<BlockOverlap> overlaps;
  uint64_t nodes = 0;
  InfoEstimate estimate;  // of a conversion of the first scalar
  std::vector<std::string> warnings;
  std::string series;  // what the files are steps of; empty: a single one

  const GridScalar& scalar(uint32_t position) const { return description->scalars[position]; }
};

GridInfo inspectGrid(const GridSource& source) {
  GridInfo info;
  const GridDescription& description = source.description();
  info.description = &description;
  for (uint32_t n = 0; n < description.scalars.size(); ++n)
    (description.scalars[n].derived ? info.derived : info.stored).push_back(n);
  for (const GridBlock& block : description.blocks) info.nodes += block.nodes();
  Progress progress{progressBar()};
  progress.begin("reading", 2 * info.nodes, "nodes");
  info.statistics = measureGrid(source, info.stored, kSlabBytes, progress);
  info.warnings = description.warnings;
  for (std::string& warning : warningsOfRanges(source, info.stored, info.statistics.scalars))
    info.warnings.push_back(std::move(warning));
  info.overlaps = findOverlaps(source, {kSlabBytes, kPointBytes}, progress);
  const bool by_cell = !info.stored.empty() && info.scalar(info.stored.front()).centring == Centring::kCell;
  info.estimate =
      InfoEstimate(by_cell ? info.statistics.cells() : info.nodes - info.statistics.blank().total(),
                   SplatsOf::kGrid, description.blocks);
  return info;
}

/// Whether the scalar has no value at all.
bool isEmpty(const ScalarRange& range) {
  return range.min > range.max;
}

nlohmann::ordered_json limitAsJson(const ScalarRange& range, bool lower) {
  if (isEmpty(range)) return nullptr;
  return lower ? range.min : range.max;
}

/// Describes what blanks nodes; empty if nothing does.
std::string blankingRule(const GridDescription& description) {
  if (!description.blanking.empty()) return description.blanking;
  const bool any = std::any_of(description.blocks.begin(), description.blocks.end(),
                               [](const GridBlock& block) { return block.has_blanking; });
  return any ? "iblank is 0" : "";
}

nlohmann::ordered_json blocksAsJson(const GridInfo& info) {
  auto blocks = nlohmann::ordered_json::array();
  for (size_t b = 0; b < info.description->blocks.size(); ++b) {
    const GridBlock& block = info.description->blocks[b];
    const BlockStatistics& statistics = info.statistics.blocks[b];
    blocks.push_back({{"name", block.name},
                      {"ni", block.ni},
                      {"nj", block.nj},
                      {"nk", block.nk},
                      {"iblank", block.has_blanking},
                      {"blanked", statistics.blank.total()},
                      {"cells", statistics.cells},
                      {"degenerate", statistics.degenerate},
                      {"inverted", statistics.inverted},
                      {"volume", statistics.volume}});
  }
  return blocks;
}

nlohmann::ordered_json scalarsAsJson(const GridInfo& info) {
  auto scalars = nlohmann::ordered_json::array();
  for (size_t s = 0; s < info.stored.size(); ++s) {
    const GridScalar& of = info.scalar(info.stored[s]);
    const ScalarRange& range = info.statistics.scalars[s];
    nlohmann::ordered_json scalar = {
        {"name", of.name}, {"min", limitAsJson(range, true)}, {"max", limitAsJson(range, false)}};
    if (of.number > 0) scalar["number"] = of.number;
    if (of.function > 0) scalar["function"] = of.function;
    if (!of.unit.empty()) scalar["unit"] = of.unit;
    scalar["centring"] = of.centring == Centring::kCell ? "cell" : "node";
    if (info.statistics.missing[s] > 0) scalar["missing"] = info.statistics.missing[s];
    scalars.push_back(std::move(scalar));
  }
  return scalars;
}

nlohmann::ordered_json gridAsJson(const GridInfo& info) {
  const GridDescription& description = *info.description;
  nlohmann::ordered_json json;
  json["format"] = description.format;
  json["files"] = description.files;
  json["nodes"] = info.nodes;
  json["coordinate_bytes"] = description.coordinate_bytes;
  const BlankCounts blank = info.statistics.blank();
  json["blanked"] = {{"by_grid", blank.by_grid}, {"not_finite", blank.not_finite}};
  json["blanking"] = blankingRule(description);
  json["cells"] = {{"count", info.statistics.cells()},
                   {"degenerate", info.statistics.degenerate()},
                   {"inverted", info.statistics.inverted()}};
  for (const ScalarRange& range : info.statistics.bounds) {
    json["bounds"]["lower"].push_back(limitAsJson(range, true));
    json["bounds"]["upper"].push_back(limitAsJson(range, false));
  }
  json["blocks"] = blocksAsJson(info);
  json["scalars"] = scalarsAsJson(info);
  json["derived"] = nlohmann::ordered_json::array();
  for (const uint32_t position : info.derived) json["derived"].push_back(info.scalar(position).name);
  json["flow"] = nlohmann::ordered_json::array();
  for (const FlowConditions& flow : description.flow)
    json["flow"].push_back({{"file", flow.file},
                            {"block", flow.block + 1},
                            {"mach", flow.mach},
                            {"alpha", flow.alpha},
                            {"reynolds", flow.reynolds},
                            {"time", flow.time}});
  if (!info.series.empty()) json["series"] = info.series;
  addTimes(description, json);
  json["overlaps"] = nlohmann::ordered_json::array();
  for (const BlockOverlap& overlap : info.overlaps)
    json["overlaps"].push_back(
        {{"blocks", {description.blocks[overlap.first].name, description.blocks[overlap.second].name}},
         {"volume", overlap.volume},
         {"share_of_smaller", overlap.share}});
  json["estimate"] = info.estimate.toJson();
  json["notes"] = description.notes;
  json["warnings"] = info.warnings;
  return json;
}

void printBlocks(const GridInfo& info) {
  const GridDescription& description = *info.description;
  for (size_t b = 0; b < std::min(kBlocksListed, description.blocks.size()); ++b) {
    const GridBlock& block = description.blocks[b];
    const BlockStatistics& statistics = info.statistics.blocks[b];
    std::string remarks;
    if (statistics.blank.by_grid > 0) remarks += fmt::format(", {} blanked", statistics.blank.by_grid);
    if (statistics.degenerate > 0) remarks += fmt::format(", {} degenerate cells", statistics.degenerate);
    if (statistics.inverted > 0) remarks += fmt::format(", {} inverted cells", statistics.inverted);
    printLine("  {:<9} {}x{}x{}{}", block.name, block.ni, block.nj, block.nk, remarks);
  }
  if (description.blocks.size() > kBlocksListed)
    printLine("  and {} more", description.blocks.size() - kBlocksListed);
}

void printScalars(const GridInfo& info) {
  for (size_t s = 0; s < info.stored.size(); ++s) {
    const GridScalar& scalar = info.scalar(info.stored[s]);
    const uint32_t number = scalar.number > 0 ? scalar.number : scalar.function;
    const bool named = number > 0 && scalar.name != std::to_string(number);
    const ScalarRange& range = info.statistics.scalars[s];
    printLine("scalar    {}{}{}{}: {}", scalar.name, named ? fmt::format(" ({})", number) : "",
              scalar.unit.empty() ? "" : fmt::format(" [{}]", scalar.unit),
              scalar.centring == Centring::kCell ? ", cell-centred" : "",
              isEmpty(range) ? "no value" : rangeText(range.min, range.max, 6));
    if (const uint64_t missing = info.statistics.missing[s]; missing > 0)
      printLine(
          "          {} more of its values {} not finite or missing; `convert` keeps the scalars that differ "
          "so apart (of a series it leaves them out)",
          missing, missing == 1 ? "is" : "are");
  }
  std::string names;
  for (const uint32_t position : info.derived) {
    const GridScalar& scalar = info.scalar(position);
    if (!names.empty()) names += ", ";
    names += scalar.name;
    if (scalar.function > 0) names += fmt::format(" ({})", scalar.function);
  }
  printLine("derived   {}", names);
}

void printGridAsText(const GridInfo& info) {
  const GridDescription& description = *info.description;
  printLine("{}", description.format);
  if (!info.series.empty()) printLine("series    {}", info.series);
  for (const std::string& warning : info.warnings) printLine("warning: {}", warning);
  if (!info.overlaps.empty()) printLine("note: {}", overlapNote(description, info.overlaps));
  const BlankCounts blank = info.statistics.blank();
  printLine("nodes     {} in {}; {} blanked by the grid, {} {}", info.nodes,
            countText(description.blocks.size(), "block"), blank.by_grid, blank.not_finite,
            blank.not_finite > 0 ? notFiniteText(description) : "not finite");
  if (const std::string rule = blankingRule(description); !rule.empty()) printLine("blanking  {}", rule);
  printBlocks(info);
  const uint64_t cell_values = info.statistics.cell_values_not_finite;
  printLine(
      "cells     {}; {} degenerate, {} inverted{}", info.statistics.cells(), info.statistics.degenerate(),
      info.statistics.inverted(),
      cell_values > 0 ? fmt::format(", {} with values {}", cell_values, notFiniteText(description)) : "");
  for (size_t axis = 0; axis < 3; ++axis)
    printLine("{}         {}", "xyz"[axis],
              isEmpty(info.statistics.bounds[axis])
                  ? "no node"
                  : rangeText(info.statistics.bounds[axis].min, info.statistics.bounds[axis].max, 9));
  for (const std::string& note : description.notes) printLine("note      {}", note);
  printLine("stored    coordinates in {} precision", description.coordinate_bytes == 8 ? "double" : "single");
  printScalars(info);
  for (size_t n = 0; n < std::min(kBlocksListed, description.flow.size()); ++n) {
    const FlowConditions& flow = description.flow[n];
    printLine("flow      block {}: Mach {}, alpha {}, Reynolds {}, time {}", flow.block + 1,
              numberText(flow.mach), numberText(flow.alpha), numberText(flow.reynolds),
              numberText(flow.time));
  }
  printTimes(description);
  printLine("estimate  {}", info.estimate.toText());
}

}  // namespace

void printGridInfo(const OpenGridOptions& options, const DerivedOptions& derived, bool json) {
  // `convert` takes the same files in this way.
  OpenGridOptions files = options;
  expandPatterns(files);
  std::vector<StepFiles> steps;
  if (hasSeveralStepFiles(files)) steps = stepsOf(files);
  std::string series;
  if (steps.size() > 1) {
    files = steps.front().options;
    series = fmt::format("{} steps, {} .. {}; the first is described", steps.size(), steps.front().name,
                         steps.back().name);
  }
  const std::unique_ptr<DataSource> source = openWithDerived(files, derived);
  const GridDescription& description = source->description();
  OpenGridOptions last = steps.size() > 1 ? steps.back().options : files;
  if (steps.size() < 2 && description.times.size() > 1)
    last.time_step = static_cast<uint32_t>(description.times.size() - 1);
  if (steps.size() > 1 || (description.times.size() > 1 && !files.time_step))
    if (const std::string note = noteOnLaterScalars(description, last); !note.empty())
      series += (series.empty() ? "" : "; ") + note;
  if (const auto* const mesh = dynamic_cast<const MeshSource*>(source.get()))
    return printMeshInfo(*mesh, series, json);
  GridInfo info = inspectGrid(dynamic_cast<const GridSource&>(*source));
  info.series = series;
  if (json)
    fmt::print("{}\n",
               gridAsJson(info).dump(2, ' ', false, nlohmann::ordered_json::error_handler_t::replace));
  else
    printGridAsText(info);
}

}  // namespace curvisplat
