#include "tools/throughput/frame_throughput.h"

#include <algorithm>
#include <chrono>
#include <nlohmann/json.hpp>

#include "render/frame/frame_plan.h"
#include "stream/base/error.h"
#include "tools/throughput/machine.h"

namespace curvisplat {
namespace {

using FramesJson = nlohmann::ordered_json;
using Clock = std::chrono::steady_clock;

double secondsSince(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

std::string memoryInName(uint64_t bytes) {
  return bytes % (1 << 20) ? fmt::format("{}B", bytes) : fmt::format("{}MiB", bytes >> 20);
}

class Frames {
 public:
  Frames(const ThroughputScene& scene, const FrameEffort& effort, Measurements& to, Progress& progress)
      : scene_(scene),
        effort_(effort),
        to_(to),
        progress_(progress),
        planner_(scene.cache, {scene.variable, scene.transfer_function}) {}

  void measure(const FrameConfiguration& configuration) {
    const Cut cut = planner_.plan(scene_.orbit(1).front(), optionsOf(configuration)).cut;
    const double left = effort_.total_s - secondsSince(start_);
    const double expected = 2 * expectedSeconds(configuration, cut.splats);
    if (left <= 0 || expected > left)
      return to_.leaveOut(
          configuration.name(),
          fmt::format("two frames would exceed the {:g} s allowed for all frames", effort_.total_s));
    try {
      draw(configuration, cut.bytes);
    } catch (const UsageError& error) {
      to_.leaveOut(configuration.name(), error.what());  // too little memory
    }
  }

  std::vector<FramesOfConfiguration> take() { return std::move(done_); }

 private:
  FrameOptions optionsOf(const FrameConfiguration& configuration) const {
    FrameOptions options = scene_.options;
    options.lod_pixels = configuration.lod_pixels;
    options.threads = configuration.threads;
    options.memory_bytes = configuration.memory_bytes;
    return options;
  }

  /// Predicts the time from the splats, at the time per splat and thread of the last configuration.
  double expectedSeconds(const FrameConfiguration& configuration, uint64_t splats) const {
    if (done_.empty()) return 0;
    const FramesOfConfiguration& last = done_.back();
    const FrameStatistics& frame = last.cold ? *last.cold : last.warm.front();
    return frame.total_s * static_cast<double>(splats) /
           static_cast<double>(std::max<uint64_t>(frame.splats_read, 1)) * last.configuration.threads /
           configuration.threads;
  }

  FrameStatistics drawOne(FrameRenderer& renderer, const Camera& camera, const FrameOptions& options) {
    progress_.throwIfStopped();
    FrameStatistics statistics;
    renderer.render(camera, options, statistics);
    return statistics;
  }

  void draw(const FrameConfiguration& configuration, uint64_t bytes) {
    const FrameOptions options = optionsOf(configuration);
    const std::filesystem::path files[] = {scene_.cache.geometryPath(),
                                           scene_.cache.valuesPath(scene_.variable)};
    FramesOfConfiguration frames{configuration, bytes, std::nullopt, {}};
    FrameRenderer renderer(scene_.cache, scene_.variable, scene_.transfer_function, scene_.backend);
    const auto warm_files = dropPages(files);
    const FrameStatistics first = drawOne(renderer, scene_.orbit(1).front(), options);
    const bool direct = first.read_by.find("direct") != std::string::npos;
    if (!warm_files || direct) {
      to_.add(configuration.name() + "/cold", "s", {first.total_s});
      frames.cold = first;
    } else {
      to_.leaveOut(configuration.name() + "/cold", *warm_files);
    }
    // As many frames as the time allows, judged by the first one, spread evenly over the orbit.
    const double fit = effort_.configuration_s / std::max(first.total_s, 1e-4);
    const auto count = static_cast<unsigned>(std::clamp(fit, 1.0, static_cast<double>(effort_.max_frames)));
    std::vector<double> seconds;
    for (const Camera& camera : scene_.orbit(count)) {
      frames.warm.push_back(drawOne(renderer, camera, options));
      seconds.push_back(frames.warm.back().total_s);
    }
    to_.add(configuration.name(), "s", std::move(seconds));
    done_.push_back(std::move(frames));
  }

  const ThroughputScene& scene_;
  const FrameEffort effort_;
  Measurements& to_;
  Progress& progress_;
  const FramePlanner planner_;
  const Clock::time_point start_ = Clock::now();
  std::vector<FramesOfConfiguration> done_;
};

FramesJson toJson(const FrameStatistics& frame) {
  return {{"total_s", frame.total_s},
          {"plan_s", frame.plan_s},
          {"read_s", frame.read_s},
          {"verify_s", frame.verify_s},
          {"decode_s", frame.decode_s},
          {"project_s", frame.project_s},
          {"sort_s", frame.sort_s},
          {"upload_s", frame.upload_s},
          {"draw_s", frame.draw_s},
          {"painter_waited_s", frame.painter_waited_s},
          {"workers_waited_s", frame.workers_waited_s},
          {"read_waited_s", frame.read_waited_s},
          {"splats_read", frame.splats_read},
          {"splats_drawn", frame.splats_drawn},
          {"bytes_read", frame.bytes_read},
          {"bricks_read", frame.bricks_read},
          {"bricks_cached", frame.bricks_cached},
          {"read_by", frame.read_by}};
}

}  // namespace

std::string FrameConfiguration::name() const {
  return fmt::format("frames/lod:{}/threads:{}/memory:{}", lod_pixels, threads, memoryInName(memory_bytes));
}

std::vector<FrameConfiguration> frameConfigurations(std::span<const double> lod_pixels, unsigned threads,
                                                    uint64_t memory_bytes, uint64_t available_bytes) {
  std::vector<double> errors(lod_pixels.begin(), lod_pixels.end());
  std::sort(errors.rbegin(), errors.rend());
  std::vector<FrameConfiguration> all;
  const auto add = [&](const FrameConfiguration& one) {
    if (std::find(all.begin(), all.end(), one) == all.end()) all.push_back(one);
  };
  for (const double error : errors) add({error, threads, memory_bytes});
  const double middle = errors[errors.size() / 2];
  for (unsigned fewer = 1; fewer < threads; fewer *= 2) add({middle, fewer, memory_bytes});
  add({middle, threads, memory_bytes / 4});
  if (4 * memory_bytes <= available_bytes / 2) add({middle, threads, 4 * memory_bytes});
  return all;
}

std::vector<FramesOfConfiguration> measureFrames(const ThroughputScene& scene,
                                                 std::span<const FrameConfiguration> configurations,
                                                 const FrameEffort& effort, Measurements& to,
                                                 Progress& progress) {
  progress.begin("drawing frames", configurations.size(), "configurations");
  Frames frames(scene, effort, to, progress);
  for (const FrameConfiguration& configuration : configurations) {
    frames.measure(configuration);
    progress.advance(1);
  }
  return frames.take();
}

FramesJson toJson(std::span<const FramesOfConfiguration> frames) {
  FramesJson json = FramesJson::array();
  for (const FramesOfConfiguration& one : frames) {
    FramesJson entry{{"lod_pixels", one.configuration.lod_pixels},
                     {"threads", one.configuration.threads},
                     {"memory_bytes", one.configuration.memory_bytes},
                     {"stream_bytes", one.bytes},
                     {"frames", one.warm.size()},
                     {"median", toJson(medianFrame(one.warm))}};
    if (one.cold) entry["cold"] = toJson(*one.cold);
    json.push_back(std::move(entry));
  }
  return json;
}

const FrameStatistics& medianFrame(const std::vector<FrameStatistics>& frames) {
  std::vector<const FrameStatistics*> by_time;
  for (const FrameStatistics& frame : frames) by_time.push_back(&frame);
  std::sort(by_time.begin(), by_time.end(),
            [](const auto* a, const auto* b) { return a->total_s < b->total_s; });
  return *by_time[(by_time.size() - 1) / 2];
}

}  // namespace curvisplat
