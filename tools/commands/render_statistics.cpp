#include "tools/commands/render_statistics.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <type_traits>
#include <variant>

#include "tools/output/results.h"

namespace curvisplat {
namespace {

using StatisticsJson = nlohmann::json;
using FrameField = StatisticsField<FrameStatistics>;

StatisticsJson& placeOf(StatisticsJson& json, const FrameField& field) {
  return (field.seconds ? json["seconds"] : json)[field.name];
}

StatisticsJson jsonOf(uint64_t number) {
  return number;
}
/// An error on the screen is infinite near a perspective camera.
StatisticsJson jsonOf(double number) {
  return std::isfinite(number) ? StatisticsJson(number) : StatisticsJson();
}

StatisticsJson toJson(const glm::dvec3& v) {
  return {v.x, v.y, v.z};
}

StatisticsJson toJson(const Camera& camera) {
  StatisticsJson json{{"position", toJson(camera.position)},
                      {"focal_point", toJson(camera.focal_point)},
                      {"view_up", toJson(camera.view_up)}};
  if (camera.projection == Projection::kOrthographic) {
    json["projection"] = "orthographic";
    json["parallel_scale"] = camera.parallel_scale;
  } else {
    json["projection"] = "perspective";
    json["view_angle_deg"] = camera.view_angle_deg;
  }
  return json;
}

StatisticsJson toJson(const TransferFunction& function) {
  return {{"name", function.name()},
          {"range", {function.range().first, function.range().second}},
          {"log_scale", function.logScale()},
          {"opacity_unit", function.opacityUnit()}};
}

StatisticsJson toJson(const FrameStatistics& statistics) {
  StatisticsJson json;
  for (const FrameField& field : statisticsFields())
    field.visit(statistics, [&](auto number) { placeOf(json, field) = jsonOf(number); });
  json["read_by"] = statistics.read_by;
  json["bricks_unreadable"] = StatisticsJson::array();
  for (const BrickFailure& failure : statistics.bricks_unreadable)
    json["bricks_unreadable"].push_back({{"brick", failure.brick}, {"reason", failure.reason}});
  return json;
}

FrameStatistics statisticsFrom(const StatisticsJson& json) {
  FrameStatistics statistics;
  for (const FrameField& field : statisticsFields())
    field.visit(statistics, [&](auto& number) {
      const StatisticsJson& stored = (field.seconds ? json["seconds"] : json)[field.name];
      if constexpr (std::is_same_v<decltype(number), double&>)
        number = stored.is_null() ? INFINITY : stored.get<double>();
      else
        number = stored;
    });
  statistics.read_by = json["read_by"];
  for (const StatisticsJson& failure : json["bricks_unreadable"])
    statistics.bricks_unreadable.push_back({failure["brick"], failure["reason"]});
  return statistics;
}

/// Percentiles by the nearest-rank method: always a value of some frame.
template <typename T>
StatisticsJson spread(const std::vector<FrameReport>& frames, T FrameStatistics::*value) {
  std::vector<T> values;
  for (const FrameReport& frame : frames) values.push_back(frame.statistics.*value);
  std::sort(values.begin(), values.end());
  const auto percentile = [&](size_t percent) {
    return jsonOf(values[(values.size() * percent + 99) / 100 - 1]);
  };
  return {{"p50", percentile(50)}, {"p95", percentile(95)}, {"max", jsonOf(values.back())}};
}

StatisticsJson overFrames(const std::vector<FrameReport>& frames) {
  StatisticsJson json{{"frames", frames.size()}};
  for (const FrameField& field : statisticsFields())
    std::visit([&](auto member) { placeOf(json, field) = spread(frames, member); }, field.value);
  return json;
}

}  // namespace

Ranks::Bytes packStatistics(const std::vector<FrameReport>& frames) {
  StatisticsJson json = StatisticsJson::array();
  for (const FrameReport& frame : frames) {
    json.push_back(toJson(frame.statistics));
    json.back()["frame"] = frame.number;
    json.back()["time"] = frame.time;
  }
  const std::vector<uint8_t> bytes = StatisticsJson::to_cbor(json);
  return fromBytes<std::byte>(toBytes(bytes));
}

std::vector<FrameReport> unpackStatistics(const Ranks::Bytes& bytes) {
  std::vector<FrameReport> frames;
  for (const StatisticsJson& json : StatisticsJson::from_cbor(fromBytes<uint8_t>(bytes)))
    frames.push_back({json["frame"], json["time"], {}, statisticsFrom(json)});
  return frames;
}

FrameStatistics combined(const std::vector<FrameStatistics>& ranks) {
  FrameStatistics whole = ranks.front();
  for (size_t n = 1; n < ranks.size(); ++n) combine(whole, ranks[n]);
  return whole;
}

nlohmann::json statisticsOf(const RenderReport& report) {
  const FrameOptions& options = report.options;
  StatisticsJson json = runStatistics();
  json["cache"] = report.cache.string();
  json["scalar"] = {{"name", report.variable.name}, {"range", {report.variable.min, report.variable.max}}};
  json["image"] = {
      {"file", report.output.string()}, {"width", report.picture.width}, {"height", report.picture.height}};
  json["backend"] = report.backend;
  json["ranks"] = report.ranks;
  json["threads"] = options.threads;
  json["memory_bytes"] = options.memory_bytes;
  json["lod_pixels"] = options.lod_pixels;
  json["max_splats"] = nullptr;
  if (options.max_splats) json["max_splats"] = *options.max_splats;
  json["classify"] = options.classification == Classification::kPixel ? "pixel" : "flat";
  json["scale"] = toJson(options.scale);
  json["clip_box"] = nullptr;
  if (options.clip_box)
    json["clip_box"] = {{"lower", toJson(options.clip_box->lower)},
                        {"upper", toJson(options.clip_box->upper)}};
  json["clip_planes"] = StatisticsJson::array();
  for (const ClipPlane& plane : options.clip_planes)
    json["clip_planes"].push_back({{"point", toJson(plane.point)}, {"normal", toJson(plane.normal)}});
  json["light"] = nullptr;
  if (const auto& light = options.light) {
    json["light"] = {{"ambient", light->ambient}, {"diffuse", light->diffuse}, {"specular", light->specular}};
    json["light"]["direction"] = light->towards ? toJson(*light->towards) : StatisticsJson();
    json["light"]["shadow"] = light->shadow;
    json["light"]["ambient_occlusion"] = light->ambient_occlusion;
  }
  const glm::vec4& background = report.background;
  json["background"] = {background.r, background.g, background.b, background.a};
  json["transfer_function"] = toJson(report.function());
  if (report.colour_variable) {
    const VariableInfo& info = *report.colour_variable;
    json["colour_scalar"] = {{"name", info.name}, {"range", {info.min, info.max}}};
    json["colour_function"] = toJson(report.scalars.colour->function);
  }
  json["time_to_first_image_s"] = nullptr;
  if (report.time_to_first_image_s) json["time_to_first_image_s"] = *report.time_to_first_image_s;
  if (report.first_image) json["first_image"] = toJson(*report.first_image);
  json["frames"] = StatisticsJson::array();
  for (const FrameReport& frame : report.frames) {
    StatisticsJson one = toJson(frame.statistics);
    one["time"] = frame.time;
    one["frame"] = frame.number;
    for (const FrameStatistics& of_rank : frame.of_ranks) one["of_ranks"].push_back(toJson(of_rank));
    one["camera"] = toJson(frame.camera);
    json["frames"].push_back(std::move(one));
  }
  if (!report.frames.empty()) json["summary"] = overFrames(report.frames);
  return json;
}

}  // namespace curvisplat
