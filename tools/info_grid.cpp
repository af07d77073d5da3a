#include "tools/info_grid.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>
#include <vector>

#include "preprocess/node_reader.h"
#include "preprocess/time_steps.h"
#include "stream/progress.h"

namespace curvisplat {
namespace {

constexpr uint64_t kSlabNodes = 1 << 18;
constexpr size_t kBlocksListed = 16;

struct Range {
  double min = std::numeric_limits<double>::infinity();
  double max = -std::numeric_limits<double>::infinity();

  template <typename Value>
  void add(const std::vector<Value>& values, const std::vector<uint8_t>& blank) {
    for (size_t n = 0; n < values.size(); ++n) {
      if (blank[n]) continue;
      min = std::min<double>(min, values[n]);
      max = std::max<double>(max, values[n]);
    }
  }
  void addFinite(const std::vector<float>& values) {
    for (const float value : values) {
      if (!std::isfinite(value)) continue;
      min = std::min<double>(min, value);
      max = std::max<double>(max, value);
    }
  }
};

/// Of the nodes that are drawn; of scalars in cells, of all that are finite.
struct GridStatistics {
  std::vector<BlankCounts> blank;  // of each block
  std::array<Range, 3> bounds;
  std::vector<Range> scalars;

  BlankCounts totalBlank() const {
    BlankCounts total;
    for (const BlankCounts& counts : blank) total += counts;
    return total;
  }
};

uint64_t nodesOf(const GridDescription& description) {
  uint64_t nodes = 0;
  for (const GridBlock& block : description.blocks) nodes += block.nodes();
  return nodes;
}

GridStatistics measure(const GridSource& source) {
  const GridDescription& description = source.description();
  std::vector<uint32_t> of_nodes, of_cells;
  for (uint32_t n = 0; n < description.scalars.size(); ++n)
    (description.scalars[n].centring == Centring::node ? of_nodes : of_cells).push_back(n);
  const NodeReader reader(source, of_nodes, std::nullopt);

  GridStatistics statistics;
  statistics.scalars.resize(description.scalars.size());
  NodeArrays nodes, cells;
  Progress progress;
  progress.begin("reading", nodesOf(description), "nodes");
  const auto addBox = [&](uint32_t block, const NodeBox& box) {
    statistics.blank.back() += reader.read(block, box, nodes);
    const std::vector<double>* const axes[] = {&nodes.x, &nodes.y, &nodes.z};
    for (size_t axis = 0; axis < 3; ++axis) statistics.bounds[axis].add(*axes[axis], nodes.blank);
    for (size_t s = 0; s < of_nodes.size(); ++s)
      statistics.scalars[of_nodes[s]].add(nodes.scalars[s], nodes.blank);
    if (!of_cells.empty()) source.read(block, box, of_cells, cells);
    for (size_t s = 0; s < of_cells.size(); ++s) statistics.scalars[of_cells[s]].addFinite(cells.scalars[s]);
    progress.advance(nodes.x.size());
  };
  for (uint32_t b = 0; b < description.blocks.size(); ++b) {
    const GridBlock& block = description.blocks[b];
    statistics.blank.emplace_back();
    const uint64_t rows = std::max<uint64_t>(1, kSlabNodes / block.ni);
    if (rows >= block.nj) {
      const uint64_t planes = rows / block.nj;
      for (uint64_t k = 0; k < block.nk; k += planes)
        addBox(b, {0, block.nj, k, std::min(k + planes, block.nk)});
    } else {
      for (uint64_t k = 0; k < block.nk; ++k)
        for (uint64_t j = 0; j < block.nj; j += rows) addBox(b, {j, std::min(j + rows, block.nj), k, k + 1});
    }
  }
  return statistics;
}

nlohmann::ordered_json asJson(const GridDescription& description, const GridStatistics& statistics) {
  nlohmann::ordered_json json;
  json["format"] = description.format;
  json["files"] = description.files;
  json["nodes"] = nodesOf(description);
  json["coordinate_bytes"] = description.coordinate_bytes;
  const BlankCounts blank = statistics.totalBlank();
  json["blanked"] = {{"iblank", blank.by_grid}, {"not_finite", blank.not_finite}};
  for (const Range& range : statistics.bounds) {
    json["bounds"]["lower"].push_back(range.min);
    json["bounds"]["upper"].push_back(range.max);
  }
  json["blocks"] = nlohmann::ordered_json::array();
  for (size_t b = 0; b < description.blocks.size(); ++b) {
    const GridBlock& block = description.blocks[b];
    json["blocks"].push_back({{"name", block.name},
                              {"ni", block.ni},
                              {"nj", block.nj},
                              {"nk", block.nk},
                              {"iblank", block.has_blanking},
                              {"blanked", statistics.blank[b].total()}});
  }
  json["scalars"] = nlohmann::ordered_json::array();
  for (size_t s = 0; s < description.scalars.size(); ++s) {
    nlohmann::ordered_json scalar = {
        {"name", description.scalars[s].name},
        {"min", statistics.scalars[s].min},
        {"max", statistics.scalars[s].max},
        {"of", description.scalars[s].centring == Centring::cell ? "cells" : "nodes"}};
    if (description.scalars[s].number > 0) scalar["number"] = description.scalars[s].number;
    json["scalars"].push_back(std::move(scalar));
  }
  json["flow"] = nlohmann::ordered_json::array();
  for (const FlowConditions& flow : description.flow)
    json["flow"].push_back({{"file", flow.file},
                            {"block", flow.block + 1},
                            {"mach", flow.mach},
                            {"alpha", flow.alpha},
                            {"reynolds", flow.reynolds},
                            {"time", flow.time}});
  if (!description.times.empty()) {
    json["times"] = description.times;
    json["time_step"] = description.time_step;
  }
  json["warnings"] = description.warnings;
  return json;
}

void printAsText(const GridDescription& description, std::optional<uint32_t> time_step,
                 const GridStatistics& statistics) {
  fmt::print("{}\n", description.format);
  for (const std::string& warning : description.warnings) fmt::print("warning: {}\n", warning);
  if (const auto note = timeStepNote(description, time_step)) fmt::print("note: {}\n", *note);
  if (!description.times.empty())
    fmt::print("time      {:g}, step {} of 0..{}\n", description.times[description.time_step],
               description.time_step, description.times.size() - 1);
  const BlankCounts blank = statistics.totalBlank();
  fmt::print("nodes     {} in {} block{}; {} blanked by iblank, {} not finite\n", nodesOf(description),
             description.blocks.size(), description.blocks.size() == 1 ? "" : "s", blank.by_grid,
             blank.not_finite);
  for (size_t b = 0; b < std::min(kBlocksListed, description.blocks.size()); ++b) {
    const GridBlock& block = description.blocks[b];
    fmt::print("  {:<9} {}x{}x{}{}\n", block.name, block.ni, block.nj, block.nk,
               block.has_blanking ? fmt::format(", iblank blanks {}", statistics.blank[b].by_grid) : "");
  }
  if (description.blocks.size() > kBlocksListed)
    fmt::print("  and {} more\n", description.blocks.size() - kBlocksListed);
  for (size_t axis = 0; axis < 3; ++axis)
    fmt::print("{}         {:.9g} .. {:.9g}\n", "xyz"[axis], statistics.bounds[axis].min,
               statistics.bounds[axis].max);
  for (size_t s = 0; s < description.scalars.size(); ++s) {
    const GridScalar& scalar = description.scalars[s];
    const bool named = scalar.number > 0 && scalar.name != std::to_string(scalar.number);
    fmt::print("scalar    {}{}: {:.6g} .. {:.6g}{}\n", scalar.name,
               named ? fmt::format(" ({})", scalar.number) : "", statistics.scalars[s].min,
               statistics.scalars[s].max, scalar.centring == Centring::cell ? ", in cells" : "");
  }
  for (size_t n = 0; n < std::min(kBlocksListed, description.flow.size()); ++n) {
    const FlowConditions& flow = description.flow[n];
    fmt::print("flow      block {}: Mach {:.6g}, alpha {:.6g}, Reynolds {:.6g}, time {:.6g}\n",
               flow.block + 1, flow.mach, flow.alpha, flow.reynolds, flow.time);
  }
}

}  // namespace

void printGridInfo(const OpenGridOptions& options, bool json) {
  const std::unique_ptr<GridSource> source = openGrid(options);
  const GridStatistics statistics = measure(*source);
  if (json)
    fmt::print("{}\n", asJson(source->description(), statistics).dump(2));
  else
    printAsText(source->description(), options.time_step, statistics);
}

}  // namespace curvisplat
