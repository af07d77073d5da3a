#include "tools/commands/render_statistics.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <nlohmann/json.hpp>

#include "tools/output/run_statistics.h"

namespace curvisplat {
namespace {

using Json = nlohmann::json;

struct Seconds {
  const char* name;
  double FrameStatistics::*value;
};
constexpr std::array<Seconds, 13> kSeconds{{{"plan", &FrameStatistics::plan_s},
                                            {"read", &FrameStatistics::read_s},
                                            {"verify", &FrameStatistics::verify_s},
                                            {"decode", &FrameStatistics::decode_s},
                                            {"project", &FrameStatistics::project_s},
                                            {"sort", &FrameStatistics::sort_s},
                                            {"upload", &FrameStatistics::upload_s},
                                            {"draw", &FrameStatistics::draw_s},
                                            {"gl_draw", &FrameStatistics::gl_draw_s},
                                            {"total", &FrameStatistics::total_s},
                                            {"workers_waited", &FrameStatistics::workers_waited_s},
                                            {"workers_waited_for_reads", &FrameStatistics::read_waited_s},
                                            {"painter_waited", &FrameStatistics::painter_waited_s}}};

struct Count {
  const char* name;
  uint64_t FrameStatistics::*value;
};
constexpr std::array<Count, 28> kCounts{{{"bricks_drawn", &FrameStatistics::bricks_drawn},
                                         {"bricks_culled", &FrameStatistics::bricks_culled},
                                         {"bricks_out_of_image", &FrameStatistics::bricks_out_of_image},
                                         {"bricks_transparent", &FrameStatistics::bricks_transparent},
                                         {"bricks_hidden", &FrameStatistics::bricks_hidden},
                                         {"splats_read", &FrameStatistics::splats_read},
                                         {"splats_clipped", &FrameStatistics::splats_clipped},
                                         {"splats_behind", &FrameStatistics::splats_behind},
                                         {"splats_off_screen", &FrameStatistics::splats_off_screen},
                                         {"splats_transparent", &FrameStatistics::splats_transparent},
                                         {"splats_drawn", &FrameStatistics::splats_drawn},
                                         {"splats_hidden", &FrameStatistics::splats_hidden},
                                         {"bytes_read", &FrameStatistics::bytes_read},
                                         {"read_requests", &FrameStatistics::read_requests},
                                         {"bricks_read", &FrameStatistics::bricks_read},
                                         {"bricks_left_out", &FrameStatistics::bricks_left_out},
                                         {"bytes_left_out", &FrameStatistics::bytes_left_out},
                                         {"bricks_cached", &FrameStatistics::bricks_cached},
                                         {"bricks_resident", &FrameStatistics::bricks_resident},
                                         {"cache_bytes", &FrameStatistics::cache_bytes},
                                         {"kept_bytes", &FrameStatistics::kept_bytes},
                                         {"memory_used_bytes", &FrameStatistics::memory_used_bytes},
                                         {"ring_peak_bytes", &FrameStatistics::ring_peak_bytes},
                                         {"sweep_peak_bytes", &FrameStatistics::sweep_peak_bytes},
                                         {"slabs", &FrameStatistics::slabs},
                                         {"bricks_again", &FrameStatistics::bricks_again},
                                         {"pager_peak_bytes", &FrameStatistics::pager_peak_bytes},
                                         {"cache_peak_bytes", &FrameStatistics::cache_peak_bytes}}};

constexpr const char* kQueueDepth = "mean_queue_depth";

Json toJson(const glm::dvec3& v) {
  return {v.x, v.y, v.z};
}

Json toJson(const Camera& camera) {
  Json json{{"position", toJson(camera.position)},
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

Json toJson(const TransferFunction& function) {
  return {{"name", function.name()},
          {"range", {function.range().first, function.range().second}},
          {"log_scale", function.logScale()},
          {"opacity_unit", function.opacityUnit()}};
}

Json toJson(const FrameStatistics& statistics) {
  Json json;
  for (const Seconds& seconds : kSeconds) json["seconds"][seconds.name] = statistics.*seconds.value;
  for (const Count& count : kCounts) json[count.name] = statistics.*count.value;
  json["largest_level"] = statistics.largest_level;
  json["largest_error_px"] = nullptr;  // infinite near a perspective camera
  if (std::isfinite(statistics.largest_error_px)) json["largest_error_px"] = statistics.largest_error_px;
  json["workers"] = statistics.workers;
  json["read_by"] = statistics.read_by;
  json[kQueueDepth] = statistics.mean_queue_depth;
  json["bricks_unreadable"] = Json::array();
  for (const BrickFailure& failure : statistics.bricks_unreadable)
    json["bricks_unreadable"].push_back({{"brick", failure.brick}, {"reason", failure.reason}});
  return json;
}

FrameStatistics statisticsFrom(const Json& json) {
  FrameStatistics statistics;
  for (const Seconds& seconds : kSeconds) statistics.*seconds.value = json["seconds"][seconds.name];
  for (const Count& count : kCounts) statistics.*count.value = json[count.name];
  statistics.largest_level = json["largest_level"];
  const Json& error = json["largest_error_px"];
  statistics.largest_error_px = error.is_null() ? INFINITY : error.get<double>();
  statistics.workers = json["workers"];
  statistics.read_by = json["read_by"];
  statistics.mean_queue_depth = json[kQueueDepth];
  for (const Json& failure : json["bricks_unreadable"])
    statistics.bricks_unreadable.push_back({failure["brick"], failure["reason"]});
  return statistics;
}

/// What is the same for all ranks, or is not to be added up.
bool isLargestOf(uint64_t FrameStatistics::*value) {
  const std::array alike{&FrameStatistics::bricks_culled, &FrameStatistics::bricks_out_of_image,
                         &FrameStatistics::bricks_transparent, &FrameStatistics::slabs,
                         &FrameStatistics::memory_used_bytes};
  return std::find(alike.begin(), alike.end(), value) != alike.end();
}

/// Percentiles by the nearest-rank method: always a value of some frame.
template <typename T>
Json spread(const std::vector<FrameReport>& frames, T FrameStatistics::*value) {
  std::vector<T> values;
  for (const FrameReport& frame : frames) values.push_back(frame.statistics.*value);
  std::sort(values.begin(), values.end());
  const auto percentile = [&](size_t percent) { return values[(values.size() * percent + 99) / 100 - 1]; };
  return {{"p50", percentile(50)}, {"p95", percentile(95)}, {"max", values.back()}};
}

Json overFrames(const std::vector<FrameReport>& frames) {
  Json json{{"frames", frames.size()}};
  for (const Seconds& seconds : kSeconds) json["seconds"][seconds.name] = spread(frames, seconds.value);
  for (const Count& count : kCounts) json[count.name] = spread(frames, count.value);
  json[kQueueDepth] = spread<double>(frames, &FrameStatistics::mean_queue_depth);
  return json;
}

}  // namespace

Ranks::Bytes packStatistics(const std::vector<FrameReport>& frames) {
  Json json = Json::array();
  for (const FrameReport& frame : frames) {
    json.push_back(toJson(frame.statistics));
    json.back()["frame"] = frame.number;
    json.back()["time"] = frame.time;
  }
  const std::vector<uint8_t> bytes = Json::to_cbor(json);
  return fromBytes<std::byte>(toBytes(bytes));
}

std::vector<FrameReport> unpackStatistics(const Ranks::Bytes& bytes) {
  std::vector<FrameReport> frames;
  for (const Json& json : Json::from_cbor(fromBytes<uint8_t>(bytes)))
    frames.push_back({json["frame"], json["time"], {}, statisticsFrom(json)});
  return frames;
}

FrameStatistics combined(const std::vector<FrameStatistics>& ranks) {
  FrameStatistics whole = ranks.front();
  for (size_t n = 1; n < ranks.size(); ++n) {
    const FrameStatistics& one = ranks[n];
    for (const Seconds& seconds : kSeconds) {
      const bool largest =
          seconds.value == &FrameStatistics::total_s || seconds.value == &FrameStatistics::plan_s;
      double& value = whole.*seconds.value;
      value = largest ? std::max(value, one.*seconds.value) : value + one.*seconds.value;
    }
    for (const Count& count : kCounts) {
      uint64_t& value = whole.*count.value;
      value = isLargestOf(count.value) ? std::max(value, one.*count.value) : value + one.*count.value;
    }
    whole.workers += one.workers;
    for (const BrickFailure& failure : one.bricks_unreadable) {
      const auto is_same = [&](const BrickFailure& other) { return other.brick == failure.brick; };
      if (std::none_of(whole.bricks_unreadable.begin(), whole.bricks_unreadable.end(), is_same))
        whole.bricks_unreadable.push_back(failure);
    }
  }
  return whole;
}

nlohmann::json statisticsOf(const RenderReport& report) {
  const FrameOptions& options = report.options;
  Json json = runStatistics();
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
  json["clip_planes"] = Json::array();
  for (const ClipPlane& plane : options.clip_planes)
    json["clip_planes"].push_back({{"point", toJson(plane.point)}, {"normal", toJson(plane.normal)}});
  json["light"] = nullptr;
  if (const auto& light = options.light) {
    json["light"] = {{"ambient", light->ambient}, {"diffuse", light->diffuse}, {"specular", light->specular}};
    json["light"]["direction"] = light->towards ? toJson(*light->towards) : Json();
  }
  const glm::vec4& background = options.background;
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
  json["frames"] = Json::array();
  for (const FrameReport& frame : report.frames) {
    Json one = toJson(frame.statistics);
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
