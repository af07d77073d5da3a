#include "tools/render_statistics.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "tools/run_statistics.h"

namespace curvisplat {
namespace {

using Json = nlohmann::json;

template <typename T>
struct Named {
  const char* name;
  T (*value)(const FrameStatistics&);
};

constexpr Named<double> kSeconds[] = {
    {"plan", [](const FrameStatistics& s) { return s.plan_s; }},
    {"read", [](const FrameStatistics& s) { return s.read_s; }},
    {"verify", [](const FrameStatistics& s) { return s.fetch.verify_s; }},
    {"decode", [](const FrameStatistics& s) { return s.decode_s; }},
    {"project", [](const FrameStatistics& s) { return s.project_s; }},
    {"sort", [](const FrameStatistics& s) { return s.sort_s; }},
    {"upload", [](const FrameStatistics& s) { return s.upload_s; }},
    {"draw", [](const FrameStatistics& s) { return s.draw_s; }},
    {"total", [](const FrameStatistics& s) { return s.total_s; }},
    {"workers_waited_for_reads", [](const FrameStatistics& s) { return s.fetch.waited_s; }},
    {"workers_waited", [](const FrameStatistics& s) { return s.workers_waited_s; }},
    {"painter_waited", [](const FrameStatistics& s) { return s.painter_waited_s; }},
};

constexpr Named<uint64_t> kCounts[] = {
    {"bricks_drawn", [](const FrameStatistics& s) { return s.bricks_drawn; }},
    {"bricks_cached", [](const FrameStatistics& s) { return s.fetch.bricks_cached; }},
    {"bricks_read", [](const FrameStatistics& s) { return s.fetch.bricks_read; }},
    {"bricks_culled", [](const FrameStatistics& s) { return s.bricks_culled; }},
    {"bricks_out_of_image", [](const FrameStatistics& s) { return s.bricks_out_of_image; }},
    {"bricks_transparent", [](const FrameStatistics& s) { return s.bricks_transparent; }},
    {"splats_read", [](const FrameStatistics& s) { return s.splats_read; }},
    {"splats_clipped", [](const FrameStatistics& s) { return s.splats_clipped; }},
    {"splats_off_screen", [](const FrameStatistics& s) { return s.splats_off_screen; }},
    {"splats_transparent", [](const FrameStatistics& s) { return s.splats_transparent; }},
    {"splats_drawn", [](const FrameStatistics& s) { return s.splats_drawn; }},
    {"bytes_read", [](const FrameStatistics& s) { return s.bytes_read; }},
    {"read_requests", [](const FrameStatistics& s) { return s.fetch.read_requests; }},
    {"cache_peak_bytes", [](const FrameStatistics& s) { return s.fetch.cache_peak_bytes; }},
    {"pager_peak_bytes", [](const FrameStatistics& s) { return s.fetch.pager_peak_bytes; }},
    {"ring_peak_bytes", [](const FrameStatistics& s) { return s.ring_peak_bytes; }},
};

constexpr Named<double> kQueueDepth{"mean_queue_depth",
                                    [](const FrameStatistics& s) { return s.fetch.mean_queue_depth; }};

Json toJson(const glm::dvec3& v) {
  return {v.x, v.y, v.z};
}

Json toJson(const Camera& camera) {
  Json json{{"position", toJson(camera.position)},
            {"focal_point", toJson(camera.focal_point)},
            {"view_up", toJson(camera.view_up)}};
  if (camera.projection == Projection::orthographic) {
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
  for (const auto& seconds : kSeconds) json["seconds"][seconds.name] = seconds.value(statistics);
  for (const auto& count : kCounts) json[count.name] = count.value(statistics);
  json[kQueueDepth.name] = kQueueDepth.value(statistics);
  json["read_by"] = statistics.fetch.way;
  json["largest_level"] = statistics.largest_level;
  json["largest_error_px"] = nullptr;  // around a perspective eye
  if (std::isfinite(statistics.largest_error_px)) json["largest_error_px"] = statistics.largest_error_px;
  json["workers"] = statistics.workers;
  json["bricks_unreadable"] = Json::array();
  for (const BrickFailure& failure : statistics.bricks_unreadable)
    json["bricks_unreadable"].push_back({{"brick", failure.brick}, {"reason", failure.reason}});
  return json;
}

/// Percentiles are values that occur: the smallest that as many frames do not exceed.
template <typename T>
Json spread(const std::vector<FrameReport>& frames, const Named<T>& of) {
  std::vector<T> values;
  for (const FrameReport& frame : frames) values.push_back(of.value(frame.statistics));
  std::sort(values.begin(), values.end());
  const auto percentile = [&](size_t percent) { return values[(values.size() * percent + 99) / 100 - 1]; };
  return {{"p50", percentile(50)}, {"p95", percentile(95)}, {"max", values.back()}};
}

Json overFrames(const std::vector<FrameReport>& frames) {
  Json json{{"frames", frames.size()}};
  for (const auto& seconds : kSeconds) json["seconds"][seconds.name] = spread(frames, seconds);
  for (const auto& count : kCounts) json[count.name] = spread(frames, count);
  json[kQueueDepth.name] = spread(frames, kQueueDepth);
  return json;
}

}  // namespace

nlohmann::json statisticsOf(const RenderReport& report) {
  const FrameOptions& options = report.options;
  Json json = runStatistics();
  json["cache"] = report.cache.string();
  json["scalar"] = {{"name", report.variable.name}, {"range", {report.variable.min, report.variable.max}}};
  json["image"] = {
      {"file", report.output.string()}, {"width", options.size.width}, {"height", options.size.height}};
  json["backend"] = report.backend;
  json["threads"] = options.threads;
  json["memory_bytes"] = options.memory_bytes;
  json["lod_pixels"] = options.lod_pixels;
  json["max_splats"] = nullptr;
  if (options.max_splats) json["max_splats"] = *options.max_splats;
  json["classify"] = options.classification == Classification::pixel ? "pixel" : "flat";
  json["scale"] = toJson(options.scale);
  json["clip_box"] = nullptr;
  if (options.clip_box)
    json["clip_box"] = {{"lower", toJson(options.clip_box->lower)},
                        {"upper", toJson(options.clip_box->upper)}};
  const glm::vec4& background = options.background;
  json["background"] = {background.r, background.g, background.b, background.a};
  json["transfer_function"] = toJson(report.transfer_function);
  json["time_to_first_image_s"] = report.time_to_first_image_s;
  if (report.first_image) json["first_image"] = toJson(*report.first_image);
  json["frames"] = Json::array();
  for (const FrameReport& frame : report.frames) {
    Json one = toJson(frame.statistics);
    one["camera"] = toJson(frame.camera);
    json["frames"].push_back(std::move(one));
  }
  json["summary"] = overFrames(report.frames);
  return json;
}

}  // namespace curvisplat
