#include "tools/throughput/rank_simulation.h"

#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "render/frame/frame_plan.h"
#include "render/project/screen_splat.h"
#include "render/ranks/picture_shares.h"
#include "tools/throughput/measurements.h"

namespace curvisplat {
namespace {

SimulatedRanks simulate(const std::vector<PartCost>& parts, ImageSize size, uint32_t ranks) {
  SimulatedRanks result;
  result.ranks = ranks;
  constexpr double kSplatBytes = sizeof(ScreenSplat) + sizeof(uint32_t);  // with its key
  const SharedWork work = workOfRanks(parts, size, ranks);
  result.largest_work = work.longest;
  for (const RankWork& of_rank : work.ranks) {
    result.mean_work += (of_rank.prepare + of_rank.paint) / ranks;
    result.largest_bytes = std::max(result.largest_bytes, of_rank.bytes);
    result.all_bytes += of_rank.bytes;
    result.painted_splats += of_rank.splats;
    result.sent_splats += of_rank.splats_received;
  }
  result.pixel_bytes = 4 * sizeof(float) * (size.pixels() - work.ranks[0].pixels);
  result.splat_bytes = static_cast<uint64_t>(kSplatBytes * result.sent_splats);
  return result;
}

PlotLine lineOf(const RankSimulation& simulation, const std::string& name,
                const std::function<double(const SimulatedRanks&)>& value) {
  PlotLine line{name, {}};
  for (const SimulatedRanks& one : simulation.counts)
    line.points.push_back({static_cast<double>(one.ranks), value(one)});
  std::sort(line.points.begin(), line.points.end(),
            [](const PlotLine::Point& a, const PlotLine::Point& b) { return a.x < b.x; });
  return line;
}

}  // namespace

RankSimulation simulateRanks(const SimulatedPicture& picture, const Camera& camera,
                             const std::vector<uint32_t>& counts) {
  const FramePlanner planner(picture.cache, {picture.variable, picture.function});
  const FramePlan plan = planner.plan(camera, picture.options);
  const std::vector<PartCost> parts = partCosts(
      plan.parts, picture.cache.bricks(), picture.cache.brickVariables(picture.variable), plan.settings.view);
  RankSimulation simulation{plan.cut.splats, plan.parts.size(), {}};
  const ImageSize size = picture.options.size;
  const double alone = simulate(parts, size, 1).largest_work;
  for (const uint32_t count : counts) {
    simulation.counts.push_back(simulate(parts, size, count));
    simulation.counts.back().speed_up = alone / simulation.counts.back().largest_work;
  }
  return simulation;
}

std::string rankTable(const RankSimulation& simulation) {
  TextTable table({"ranks", "work", "mean work", "balance", "speed-up", "efficiency", "read, largest",
                   "read, all", "splats sent", "of all", "pixels sent"});
  for (const SimulatedRanks& one : simulation.counts)
    table.add({std::to_string(one.ranks), shortCount(one.largest_work), shortCount(one.mean_work),
               fmt::format("{:.2f}", one.balance()), fmt::format("{:.1f}", one.speed_up),
               fmt::format("{:.2f}", one.efficiency()), shortBytes(static_cast<double>(one.largest_bytes)),
               shortBytes(static_cast<double>(one.all_bytes)),
               shortBytes(static_cast<double>(one.splat_bytes)),
               fmt::format("{:.2f}", one.exchange(simulation.splats)),
               shortBytes(static_cast<double>(one.pixel_bytes))});
  return table.text();
}

nlohmann::ordered_json toJson(const RankSimulation& simulation) {
  nlohmann::ordered_json json{{"splats", simulation.splats}, {"parts", simulation.parts}};
  for (const SimulatedRanks& one : simulation.counts)
    json["counts"].push_back({{"ranks", one.ranks},
                              {"largest_work", one.largest_work},
                              {"mean_work", one.mean_work},
                              {"balance", one.balance()},
                              {"speed_up", one.speed_up},
                              {"efficiency", one.efficiency()},
                              {"largest_bytes", one.largest_bytes},
                              {"all_bytes", one.all_bytes},
                              {"splat_bytes", one.splat_bytes},
                              {"painted_splats", one.painted_splats},
                              {"pixel_bytes", one.pixel_bytes}});
  return json;
}

Plots rankPlots(const RankSimulation& simulation) {
  const auto label = [](double ranks) { return fmt::format("{:.0f}", ranks); };
  LinePanel shares{
      "Work (simulated)",
      "ranks",
      "",
      {lineOf(simulation, "balance: mean over largest", [](const auto& one) { return one.balance(); }),
       lineOf(simulation, "efficiency: speed-up over ranks",
              [](const auto& one) { return one.efficiency(); })},
      label};
  LinePanel bytes{
      "Bytes (simulated)",
      "ranks",
      "MB",
      {lineOf(simulation, "read by a rank, largest",
              [](const auto& one) { return 1e-6 * static_cast<double>(one.largest_bytes); }),
       lineOf(simulation, "splats sent by a rank, mean",
              [](const auto& one) { return 1e-6 * static_cast<double>(one.splat_bytes) / one.ranks; })},
      label};
  const std::vector<std::byte> png = drawPlot(std::vector<LinePanel>{std::move(shares), std::move(bytes)});
  if (png.empty()) return {};
  return {{"ranks.png", png}};
}

}  // namespace curvisplat
