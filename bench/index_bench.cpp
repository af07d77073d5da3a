// Opens, plans and orders the index of a cache of a million bricks, as 10^10 nodes have
// (tests/support/test_caches.h). It is made in CURVISPLAT_BENCH_FOLDER, or else in the folder of temporary
// files, and removed at the end: 190 MB.
#include <benchmark/benchmark.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <string>

#include "render/camera/camera.h"
#include "render/frame/frame_memory.h"
#include "render/frame/frame_plan.h"
#include "stream/cache/cache_reader.h"
#include "tests/support/test_caches.h"

namespace curvisplat {
namespace {

namespace fs = std::filesystem;

constexpr uint64_t kBricks = 1'000'001;

class SparseFolder {
 public:
  SparseFolder() {
    const char* const folder = std::getenv("CURVISPLAT_BENCH_FOLDER");
    path_ = (folder ? fs::path(folder) : fs::temp_directory_path()) /
            ("curvisplat-index-" + std::to_string(::getpid()) + ".splats");
    writeSparseCache(path_, kBricks);
  }
  ~SparseFolder() {
    std::error_code ignored;
    fs::remove_all(path_, ignored);
  }
  const fs::path& path() const { return path_; }

  static const SparseFolder& get() {
    static const SparseFolder folder;
    return folder;
  }

 private:
  fs::path path_;
};

const CacheReader& reader() {
  static const CacheReader opened(SparseFolder::get().path());
  return opened;
}

FramePlanner planner() {
  return FramePlanner(reader(), DrawnScalars(0, TransferFunction::preset("viridis", 0, 32, 1)));
}

/// All of it, from a corner.
Camera camera() {
  Camera camera;
  camera.position = {48, 47, 46};
  camera.focal_point = {16, 16, 16};
  camera.view_up = {0, 0, 1};
  camera.parallel_scale = 27;
  return camera;
}

void openIndex(benchmark::State& state) {
  SparseFolder::get();
  for (auto _ : state) benchmark::DoNotOptimize(CacheReader(SparseFolder::get().path()).bricks().data());
}
BENCHMARK(openIndex)->Unit(benchmark::kMillisecond);

void makePlanner(benchmark::State& state) {
  reader();
  for (auto _ : state) benchmark::DoNotOptimize(planner().bytes({}));
}
BENCHMARK(makePlanner)->Unit(benchmark::kMillisecond);

/// The cut and the order of its parts, down to this error on the screen; 0: of all leaves.
void planFrame(benchmark::State& state) {
  const FramePlanner planned = planner();
  FrameOptions options;
  options.size = {1024, 1024};
  options.lod_pixels = static_cast<double>(state.range(0));
  double parts = 0;
  for (auto _ : state) parts = static_cast<double>(planned.plan(camera(), options).parts.size());
  state.counters["parts"] = parts;
}
BENCHMARK(planFrame)->ArgName("lod_pixels")->Arg(0)->Arg(1)->Arg(4)->Unit(benchmark::kMillisecond);

/// How a picture of all leaves is divided where the memory holds this many million splats of it.
void chooseRegions(benchmark::State& state) {
  const FramePlanner planned = planner();
  FrameOptions options;
  options.size = {1024, 1024};
  options.lod_pixels = 0;
  const FramePlan plan = planned.plan(camera(), options);
  const auto splats = static_cast<size_t>(state.range(0)) * 1'000'000;
  double regions = 0;
  for (auto _ : state) regions = static_cast<double>(frameRegions(plan, reader(), 0, splats).size());
  state.counters["regions"] = regions;
}
BENCHMARK(chooseRegions)->ArgName("million")->Arg(3)->Arg(30)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace curvisplat
