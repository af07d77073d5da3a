#include "render/cpu_painter.h"

#include <hwy/aligned_allocator.h>
#include <hwy/highway.h>
#include <tbb/info.h>
#include <tbb/parallel_for.h>
#include <tbb/partitioner.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <optional>
#include <thread>

#include "render/splat_bins.h"
#include "render/tile.h"
#include "stream/stage_timer.h"

namespace curvisplat {
namespace {

// Of most scenes' splats, one in four touches a second tile. Where they touch more, batches are smaller.
constexpr size_t kEntriesASplat = 4;

size_t tileCount(ImageSize size) {
  const auto along = [](int pixels) { return static_cast<size_t>((pixels + kTileSide - 1) / kTileSide); };
  return along(size.width) * along(size.height);
}

unsigned threadsOf(const PaintResources& resources) {
  return resources.threads ? resources.threads : std::max(1u, std::thread::hardware_concurrency());
}

}  // namespace

struct CpuPainter::State {
  ImageSize size{0, 0};
  unsigned threads = 0;
  size_t batch_splats = 0;
  hwy::AlignedFreeUniquePtr<float[]> tiles;
  std::optional<SplatBins> bins;
  std::optional<ShadingTable> table;
  std::optional<tbb::task_arena> arena;
  bool per_pixel = true;
  double upload_s = 0, draw_s = 0;

  float* tile(size_t number) { return tiles.get() + number * kTileFloats; }
  template <typename Job>
  void forTiles(const Job& job) {
    arena->execute([&] {
      tbb::parallel_for(
          tbb::blocked_range<size_t>(0, tileCount(size), 1),
          [&](const tbb::blocked_range<size_t>& range) {
            for (size_t number = range.begin(); number < range.end(); ++number) job(number);
          },
          tbb::simple_partitioner());
    });
  }
  void allocate(ImageSize wanted, unsigned threads_, size_t batch_splats_);
  void paintBatch();
};

CpuPainter::CpuPainter() : state_(std::make_unique<State>()) {}

CpuPainter::~CpuPainter() = default;

void CpuPainter::begin(ImageSize size, const glm::vec4& background, const ClassificationTable& table,
                       bool per_pixel, const PaintResources& resources) {
  State& state = *state_;
  const unsigned threads = threadsOf(resources);
  state.upload_s = state.draw_s = 0;
  state.per_pixel = per_pixel;
  state.table.emplace(table);
  if (size.width != state.size.width || size.height != state.size.height || threads != state.threads ||
      resources.batch_splats != state.batch_splats)
    state.allocate(size, threads, resources.batch_splats);
  state.bins->clear();  // of a frame that was not ended
  const float clear[4] = {background.r, background.g, background.b, 1 - background.a};
  state.forTiles([&](size_t number) {
    float* at = state.tile(number);
    for (int block = 0; block < kTileBlocks * kTileBlocks; ++block)
      for (const float value : clear) at = std::fill_n(at, kBlockPixels, value);
  });
}

void CpuPainter::State::allocate(ImageSize wanted, unsigned threads_, size_t batch_splats_) {
  size = {0, 0};
  bins.reset();
  tiles.reset();
  tiles = hwy::AllocateAligned<float>(tileCount(wanted) * kTileFloats);
  if (!tiles) throw std::bad_alloc();
  bins.emplace(wanted, batch_splats_, kEntriesASplat * batch_splats_, threads_);
  // TBB warns of more than there are cores.
  arena.emplace(std::min(static_cast<int>(threads_), tbb::info::default_concurrency()));
  size = wanted;
  threads = threads_;
  batch_splats = batch_splats_;
}

void CpuPainter::State::paintBatch() {
  const StageTimer timer(draw_s);
  arena->execute([this] { bins->sort(); });
  forTiles([this](size_t number) {
    const std::span<const uint32_t> order = bins->tile(static_cast<int>(number));
    if (order.empty()) return;
    const auto columns = static_cast<size_t>(bins->columns());
    paintTile({tile(number), static_cast<int>(number % columns) * kTileSide,
               static_cast<int>(number / columns) * kTileSide, bins->splats(), order, *table, per_pixel});
  });
  bins->clear();
}

void CpuPainter::draw(std::span<const ScreenSplat> splats) {
  State& state = *state_;
  while (!splats.empty()) {
    size_t added;
    {
      const StageTimer timer(state.upload_s);
      added = state.bins->add(splats);
    }
    splats = splats.subspan(added);
    if (!splats.empty()) state.paintBatch();
  }
}

Image CpuPainter::end() {
  State& state = *state_;
  if (!state.bins->empty()) state.paintBatch();
  const StageTimer timer(state.draw_s);
  Image image(state.size);
  const auto columns = static_cast<size_t>(state.bins->columns());
  state.forTiles([&](size_t number) {
    const float* tile = state.tile(number);
    const int x0 = static_cast<int>(number % columns) * kTileSide;
    const int y0 = static_cast<int>(number / columns) * kTileSide;
    for (int y = 0; y < std::min(kTileSide, state.size.height - y0); ++y)
      for (int x = 0; x < std::min(kTileSide, state.size.width - x0); ++x) {
        const float* block = tile + (y / kBlockSide * kTileBlocks + x / kBlockSide) * kBlockFloats;
        const float* from = block + y % kBlockSide * kBlockSide + x % kBlockSide;
        float* to = image.pixel(x0 + x, y0 + y);
        for (int c = 0; c < 3; ++c) to[c] = from[c * kBlockPixels];
        to[3] = 1 - from[3 * kBlockPixels];
      }
  });
  return image;
}

double CpuPainter::uploadSeconds() const {
  return state_->upload_s;
}

double CpuPainter::drawSeconds() const {
  return state_->draw_s;
}

uint64_t CpuPainter::frameBytes(ImageSize size) {
  return tileCount(size) * kTileFloats * sizeof(float);
}

uint64_t CpuPainter::batchBytes(ImageSize size, const PaintResources& resources) {
  return SplatBins::bytes(size, resources.batch_splats, kEntriesASplat * resources.batch_splats,
                          threadsOf(resources));
}

std::vector<int64_t> CpuPainter::targets() {
  std::vector<int64_t> found;
  for (int64_t rest = hwy::SupportedTargets() & HWY_TARGETS; rest != 0; rest &= rest - 1)
    found.push_back(rest & -rest);
  return found;
}

bool CpuPainter::fuses(int64_t target) {
  constexpr int64_t kSeparate = HWY_SCALAR | HWY_EMU128 | HWY_SSSE3 | HWY_SSE4;
  return (target & kSeparate) == 0;
}

std::string CpuPainter::name() {
  return std::string("CPU, ") + hwy::TargetName(targets().front());
}

}  // namespace curvisplat
