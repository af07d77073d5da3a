#include "tools/throughput/stage_throughput.h"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <functional>
#include <memory>
#include <optional>
#include <set>
#include <vector>

#include "render/frame/frame_plan.h"
#include "stream/base/checksum.h"
#include "stream/base/error.h"
#include "stream/base/file.h"
#include "stream/base/threads.h"
#include "stream/codec/brick_codec.h"
#include "stream/paging/pager.h"
#include "tools/throughput/machine.h"

namespace curvisplat {

BrickSample sampleOf(std::span<const BrickPart> parts, std::span<const Brick> bricks, uint64_t max_splats,
                     uint32_t runs) {
  const auto splatsOf = [&](const BrickPart& part) {
    return uint64_t{SplatRanges(bricks[part.brick], part.octants).splats()};
  };
  uint64_t all = 0;
  for (const BrickPart& part : parts) all += splatsOf(part);
  BrickSample sample;
  if (all <= max_splats) {
    sample.parts.assign(parts.begin(), parts.end());
    sample.splats = all;
    return sample;
  }
  // Run r begins after a fraction r / runs of all splats, and holds 1 / runs of the sample.
  uint64_t behind = 0;
  uint32_t run = 0;
  uint64_t wanted = 0;
  for (const BrickPart& part : parts) {
    const uint64_t splats = splatsOf(part);
    while (run < runs && static_cast<double>(behind) >= static_cast<double>(all) / runs * run) {
      ++run;
      wanted = max_splats / runs * run;
    }
    if (sample.splats < wanted || sample.parts.empty()) {
      sample.parts.push_back(part);
      sample.splats += splats;
    }
    behind += splats;
  }
  return sample;
}

namespace {

void sortInto(DepthSorter& sorter, const std::vector<uint32_t>& keys, const std::vector<ScreenSplat>& splats,
              std::vector<ScreenSplat>& sorted) {
  const auto order = sorter.sort(keys);
  sorted.resize(std::max(sorted.size(), splats.size()));
  for (size_t n = 0; n < order.size(); ++n) sorted[n] = splats[order[n].splat];
}

}  // namespace

PreparedSample::PreparedSample(const CacheReader& cache, size_t variable, const FramePlanner& planner,
                               const FramePlan& plan, const BrickSample& sample)
    : cache_(cache), variable_(variable), planner_(planner), plan_(plan), splats_(sample.splats) {
  const InputFile geometry(cache.geometryPath()), values(cache.valuesPath(variable));
  Scratch scratch;
  for (const BrickPart& part : sample.parts) {
    const Brick& brick = cache.bricks()[part.brick];
    const Extent& of_values = cache.brickVariables(variable)[part.brick].values;
    SampledBrick& read = bricks_.emplace_back();
    read.part = part;
    read.geometry_bytes.resize(brick.geometry.length);
    read.values_bytes.resize(of_values.length);
    geometry.readAt(brick.geometry.offset, std::span(read.geometry_bytes));
    values.readAt(of_values.offset, std::span(read.values_bytes));
    bytes_ += brick.geometry.length + of_values.length;
    decoded_ += brick.splats;

    verifyAndDecode(bricks_.size() - 1, scratch);
    read.geometry = scratch.geometry;
    read.values = scratch.values;
    project(read, read.geometry, read.values, scratch.projector);
    read.projected = scratch.projector.splats();
    read.keys = keysOf(read, scratch);
    sortInto(scratch.sorter, read.keys, read.projected, scratch.sorted);
    const auto count = static_cast<ptrdiff_t>(read.projected.size());
    to_draw_.insert(to_draw_.end(), scratch.sorted.begin(), scratch.sorted.begin() + count);
    segments_.push_back(static_cast<uint32_t>(count));
    on_screen_ += read.projected.size();
  }
}

void PreparedSample::project(const SampledBrick& brick, const SplatGeometry& geometry,
                             const SplatVariable& values, BrickProjector& projector) const {
  const Brick& of_index = cache_.bricks()[brick.part.brick];
  const SplatRanges ranges(of_index, brick.part.octants);
  projector.project(plan_.settings, planner_.table(), cache_.manifest().root.cellMin(of_index.cell),
                    arraysOf(geometry), arraysOf(values), std::span(ranges.begin(), ranges.size()));
}

const std::vector<uint32_t>& PreparedSample::keysOf(const SampledBrick& brick, Scratch& scratch) const {
  const Brick& of_index = cache_.bricks()[brick.part.brick];
  scratch.keys.resize(scratch.projector.depths().size());
  plan_.keys.setKeys(scratch.projector.mutableSplats(), scratch.projector.depths(),
                     cache_.manifest().root.cellMin(of_index.cell), plan_.keys.rangeOf(of_index),
                     scratch.keys);
  return scratch.keys;
}

void PreparedSample::verify(size_t n) const {
  const SampledBrick& brick = bricks_[n];
  const uint64_t expected = cache_.bricks()[brick.part.brick].geometry.checksum ^
                            cache_.brickVariables(variable_)[brick.part.brick].values.checksum;
  CURVISPLAT_CHECK_OP(checksumOf(brick.geometry_bytes) ^ checksumOf(brick.values_bytes), ==, expected);
}

void PreparedSample::decode(size_t n, Scratch& scratch) const {
  const SampledBrick& brick = bricks_[n];
  const Brick& of_index = cache_.bricks()[brick.part.brick];
  decodeGeometry(cache_.manifest().root, of_index, brick.geometry_bytes, scratch.geometry);
  decodeVariable(of_index, cache_.brickVariables(variable_)[brick.part.brick], brick.values_bytes,
                 scratch.values);
}

void PreparedSample::verifyAndDecode(size_t n, Scratch& scratch) const {
  const SampledBrick& brick = bricks_[n];
  const uint32_t splats = cache_.bricks()[brick.part.brick].splats;
  scratch.geometry.resize(splats);
  scratch.values.resize(splats);
  cache_.decode(brick.part.brick, brick.geometry_bytes, arraysOf(scratch.geometry), scratch.times);
  cache_.decode(brick.part.brick, variable_, brick.values_bytes, arraysOf(scratch.values), scratch.times);
}

void PreparedSample::project(size_t n, Scratch& scratch) const {
  project(bricks_[n], bricks_[n].geometry, bricks_[n].values, scratch.projector);
}

void PreparedSample::sort(size_t n, Scratch& scratch) const {
  sortInto(scratch.sorter, bricks_[n].keys, bricks_[n].projected, scratch.sorted);
}

void PreparedSample::prepare(size_t n, Scratch& scratch) const {
  verifyAndDecode(n, scratch);
  project(bricks_[n], scratch.geometry, scratch.values, scratch.projector);
  sortInto(scratch.sorter, keysOf(bricks_[n], scratch), scratch.projector.splats(), scratch.sorted);
}

namespace {

/// Seconds per run of `job`, one number per sample. A sample repeats the job until `sample_s` seconds have
/// passed, so that its time can be measured reliably, but at least once. A first run, which warms caches and
/// allocates memory, is not counted.
std::vector<double> secondsOfRuns(double sample_s, unsigned samples, const std::function<void()>& job) {
  job();
  std::vector<double> seconds;
  for (unsigned sample = 0; sample < samples; ++sample) {
    const auto start = std::chrono::steady_clock::now();
    double passed = 0;
    unsigned runs = 0;
    do {
      job();
      ++runs;
      passed = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    } while (passed < sample_s);
    seconds.push_back(passed / runs);
  }
  return seconds;
}

constexpr uint64_t kPagerBufferBytes = 32 << 20;  // what a frame gives the pager at most

std::vector<double> ratesOf(const std::vector<double>& seconds, uint64_t count) {
  std::vector<double> rates;
  for (const double each : seconds) rates.push_back(static_cast<double>(count) / each);
  return rates;
}

uint64_t streamBytes(const CacheReader& cache, size_t variable, uint32_t brick) {
  return uint64_t{cache.bricks()[brick].geometry.length} +
         cache.brickVariables(variable)[brick].values.length;
}

/// The bricks of `parts` in their order, without duplicates.
std::vector<uint32_t> bricksOf(std::span<const BrickPart> parts) {
  std::set<uint32_t> seen;
  std::vector<uint32_t> bricks;
  for (const BrickPart& part : parts)
    if (seen.insert(part.brick).second) bricks.push_back(part.brick);
  return bricks;
}

class Stages {
 public:
  Stages(const ThroughputScene& scene, unsigned threads, const StageEffort& effort, Measurements& to,
         Progress& progress)
      : scene_(scene),
        threads_(threads),
        effort_(effort),
        to_(to),
        progress_(progress),
        planner_(scene.cache, {scene.variable, scene.transfer_function}),
        plan_(planner_.plan(scene.orbit(1).front(), scene.options)) {
    report_.frame_splats = plan_.cut.splats;
  }

  StageReport measure() {
    const SystemReport system = examineBackends();
    report_.backends = system.backends;
    report_.card_draws = system.automatic.starts_with("egl");
    progress_.begin("measuring the stages", 6 + system.backends.size(), "stages");
    read();
    progress_.advance(1);
    if (plan_.cut.parts.empty()) {
      to_.leaveOut("stages", "no data is in view, or all of it is transparent");
      return report_;
    }
    const BrickSample chosen = sampleOf(plan_.cut.parts, scene_.cache.bricks(), effort_.max_splats);
    const PreparedSample sample(scene_.cache, scene_.variable, planner_, plan_, chosen);
    report_.sampled_splats = sample.splats();
    using Scratch = PreparedSample::Scratch;
    onWorkers("verify", sample, sample.decoded(), sample.bytes(),
              [&](size_t n, Scratch&) { sample.verify(n); });
    onWorkers("decode", sample, sample.decoded(), sample.bytes(),
              [&](size_t n, Scratch& scratch) { sample.decode(n, scratch); });
    onWorkers("project", sample, sample.splats(), 0,
              [&](size_t n, Scratch& scratch) { sample.project(n, scratch); });
    onWorkers("sort", sample, sample.screenSplats(), 0,
              [&](size_t n, Scratch& scratch) { sample.sort(n, scratch); });
    onWorkers("prepare", sample, sample.splats(), sample.bytes(),
              [&](size_t n, Scratch& scratch) { sample.prepare(n, scratch); });
    for (const BackendReport& backend : system.backends) {
      draw(backend, sample);
      progress_.advance(1);
    }
    return report_;
  }

 private:
  /// Measures the pager alone, cold: direct reads bypass the page cache, for others the files are evicted
  /// from it.
  void read() {
    const std::vector<uint32_t> all = bricksOf(plan_.cut.parts);
    uint64_t bytes = 0;
    std::vector<uint32_t> bricks;
    for (const uint32_t brick : all) {
      if (bytes > 0 && bytes + streamBytes(scene_.cache, scene_.variable, brick) > effort_.max_read_bytes)
        break;
      bytes += streamBytes(scene_.cache, scene_.variable, brick);
      bricks.push_back(brick);
    }
    PagerOptions options;
    options.buffer_bytes =
        std::max(kPagerBufferBytes, BrickPager::leastBufferBytes(scene_.cache, scene_.variable));
    BrickPager pager(scene_.cache, scene_.variable, options);
    report_.read_by = pager.way();
    if (bricks.empty()) return to_.leaveOut("stages/read", "no brick is in view");
    const std::filesystem::path files[] = {scene_.cache.geometryPath(),
                                           scene_.cache.valuesPath(scene_.variable)};
    std::vector<double> rates;
    for (unsigned sample = 0; sample < effort_.samples; ++sample) {
      // Direct reads are cold anyway; for them a failure to evict does not matter.
      const auto reason = dropPages(files);
      if (reason && report_.read_by.find("direct") == std::string::npos)
        return to_.leaveOut("stages/read", *reason);
      const auto start = std::chrono::steady_clock::now();
      pager.start(bricks);
      for (size_t n = 0; n < bricks.size(); ++n) {
        const auto brick = pager.fetch(n);
        if (!brick || !brick->readable())
          throw Error("{}: cannot read brick {}; `curvisplat info --verify` lists the damage",
                      scene_.cache.path().string(), bricks[n]);
      }
      const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
      rates.push_back(static_cast<double>(bytes) / seconds);
    }
    to_.add("stages/read", "B/s", std::move(rates));
  }

  using BrickJob = std::function<void(size_t brick, PreparedSample::Scratch&)>;

  /// Measures `job` on every brick of the sample, on one thread and on all.
  void onWorkers(const std::string& stage, const PreparedSample& sample, uint64_t splats, uint64_t bytes,
                 const BrickJob& job) {
    std::set<unsigned> counts{1, threads_};
    for (const unsigned count : counts) {
      WorkerTeam team(count, "bench");
      std::vector<std::unique_ptr<PreparedSample::Scratch>> scratch(count);
      for (auto& each : scratch) each = std::make_unique<PreparedSample::Scratch>();
      const auto seconds = secondsOfRuns(effort_.sample_s, effort_.samples, [&] {
        std::atomic<size_t> next = 0;
        team.start([&](unsigned worker) {
          for (size_t n = next++; n < sample.size(); n = next++) job(n, *scratch[worker]);
        });
        team.wait();
        progress_.throwIfStopped();
      });
      const std::string name = stageName(stage, count);
      if (splats > 0) to_.add(name, "splats/s", ratesOf(seconds, splats));
      if (bytes > 0) to_.add(name + "/bytes", "B/s", ratesOf(seconds, bytes));
      if (splats == 0) to_.leaveOut(name, "no splat of the sample reaches the screen");
    }
    progress_.advance(1);
  }

  void draw(const BackendReport& found, const PreparedSample& sample) {
    const std::string stage = "draw/" + found.word;
    if (!found.works) return to_.leaveOut("stages/" + stage, found.found);
    if (sample.toDraw().empty())
      return to_.leaveOut("stages/" + stage, "no splat of the sample reaches the screen");
    const auto backend = makeBackend(parsedBackend(found.word));
    // OpenGL uses its own threads; only the processor's painter takes a thread count.
    std::set<unsigned> counts{0};
    if (found.word == "cpu") counts = {1, threads_};
    for (const unsigned count : counts) {
      const auto seconds = secondsOfDrawing(*backend, sample, count);
      to_.add(count ? stageName(stage, count) : "stages/" + stage, "splats/s",
              ratesOf(seconds, sample.screenSplats()));
    }
  }

  std::vector<double> secondsOfDrawing(PaintingBackend& backend, const PreparedSample& sample,
                                       unsigned threads) const {
    const std::vector<ScreenSplat>& splats = sample.toDraw();
    return secondsOfRuns(effort_.sample_s, effort_.samples, [&] {
      backend.run([&](Painter& painter) {
        painter.begin(plan_.settings.view.size, scene_.options.background, planner_.table(),
                      {plan_.settings.per_pixel}, {.threads = threads});
        size_t begin = 0;
        for (const uint32_t count : sample.segments()) {
          painter.draw(std::span(splats).subspan(begin, count));
          begin += count;
        }
        painter.end();
      });
      progress_.throwIfStopped();
    });
  }

  static Backend parsedBackend(const std::string& word) {
    return word == "cpu"         ? Backend::kCpu
           : word == "egl"       ? Backend::kEgl
           : word == "egl-quads" ? Backend::kEglQuads
                                 : Backend::kOsmesa;
  }

  const ThroughputScene& scene_;
  const unsigned threads_;
  const StageEffort effort_;
  Measurements& to_;
  Progress& progress_;
  const FramePlanner planner_;
  const FramePlan plan_;
  StageReport report_;
};

}  // namespace

std::string stageName(const std::string& stage, unsigned threads) {
  return fmt::format("stages/{}/threads:{}", stage, threads);
}

StageReport measureStages(const ThroughputScene& scene, unsigned threads, const StageEffort& effort,
                          Measurements& to, Progress& progress) {
  return Stages(scene, threads, effort, to, progress).measure();
}

}  // namespace curvisplat
