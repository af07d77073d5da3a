#include "render/cpu/cpu_painter.h"

#include <hwy/aligned_allocator.h>
#include <hwy/highway.h>

#include <algorithm>
#include <atomic>
#include <bit>
#include <optional>
#include <utility>
#include <vector>

#include "render/cpu/tile.h"
#include "render/cpu/tile_windows.h"
#include "render/tiles/splat_bins.h"
#include "render/tiles/tile_queues.h"
#include "stream/base/compute_permits.h"
#include "stream/base/threads.h"
#include "stream/base/trace.h"

namespace curvisplat {
namespace {

static_assert(kSharedTileSide % kBlockSide == 0);
static_assert(kOrderSide == kBlockSide);  // blocks are the order tiles, and have their numbers

// One splat in four of most scenes touches a second tile. Where they touch more, batches are smaller.
constexpr size_t kEntriesASplat = 4;

size_t tileCount(ImageSize size) {
  return TileSet::tilesOf(size);
}

/// Blocks along one side of the image; none where first > last.
struct BlockRange {
  int first, last;

  /// Bit n: block n of those along a tile's side.
  BlockMask inTile(int tile) const {
    const int from = std::max(first - tile * kTileBlocks, 0);
    const int to = std::min(last - tile * kTileBlocks, kTileBlocks - 1);
    return from > to ? 0 : (2u << to) - (1u << from);
  }
};

BlockRange blocksAlong(float from, float to, int pixels) {
  const auto end = static_cast<float>(pixels);
  if (to < 0 || from >= end) return {0, -1};
  return {static_cast<int>(std::max(from, 0.0f)) / kBlockSide,
          static_cast<int>(std::min(to, end - 1)) / kBlockSide};
}

BlockMask blocksOf(BlockMask columns, BlockMask rows) {
  BlockMask blocks = 0;
  for (int row = 0; row < kTileBlocks; ++row)
    if (rows >> row & 1) blocks |= columns << row * kTileBlocks;
  return blocks;
}

Image blackImage(ImageSize size) {
  const TraceScope trace("make image");
  return Image(size);
}

}  // namespace

struct CpuPainter::State {
  struct Touched {
    uint32_t queue, work;  // as TileQueues::workOf()
  };
  struct Divided {
    uint32_t queue, first_part;
  };

  ImageSize size{0, 0};
  glm::vec4 background{0};
  size_t batch_splats = 0, waiting_splats = 0;
  uint64_t prepared_bytes = kMinPreparedBytes;  // of a thread
  hwy::AlignedFreeUniquePtr<float[]> tiles;
  std::unique_ptr<std::atomic<BlockMask>[]> open;  // [tile]: written by who paints it, read by anyone
  std::vector<Touched> touched;                    // queues that a batch touches
  std::vector<Divided> divided;                    // queues, for a batch
  std::vector<uint32_t> range_ends;                // of `touched`, for one thread at a time
  Image image;                                     // black until end()
  WindowTiles windows;
  std::optional<SplatBins> bins;
  std::optional<TileQueues> queues;
  std::optional<ShadingTable> table, colours;
  std::optional<PaintLoop> loop;
  PixelShading shading;
  std::stop_token stop;
  double upload_s = 0, draw_s = 0;

  float* tile(size_t number) { return tiles.get() + number * kTileFloats; }
  template <typename Job>
  void forRanges(const char* name, size_t count, const Job& job);
  BlockMask inImage(size_t number) const;
  BlockMask blocksIn(const TileSet& wanted, size_t number) const;
  void clear(size_t number);
  void allocate(ImageSize wanted, unsigned threads, const PaintResources& resources);
  void paintBatch();
  void paintBorrowed(std::span<const ScreenSplat>& splats);
  void listTiles(bool last);
  void divideHeavy(uint64_t work);
  void listRanges(uint64_t work);
  void paintTiles(bool last);
  void paintQueue(size_t queue, uint32_t front, bool last);
  void paintLast();
  BlockMask paintOrdered(size_t number, BlockMask blocks, const OrderedTile& ordered);
};

CpuPainter::CpuPainter() : state_(std::make_unique<State>()) {}

CpuPainter::~CpuPainter() = default;

void CpuPainter::begin(ImageSize size, const glm::vec4& background, const ClassificationTable& table,
                       PixelShading shading, const PaintResources& resources) {
  State& state = *state_;
  const Computing computing(resources.permits);
  const TraceScope trace("begin picture", TraceKind::kStage);
  const unsigned threads = threadsOrCores(resources.threads),
                 threads_before = state.loop ? state.loop->threads() : 0;
  state.upload_s = state.draw_s = 0;
  state.shading = shading;
  state.stop = resources.stop;
  state.table.emplace(table);
  state.colours.reset();
  if (shading.colours) state.colours.emplace(*shading.colours);
  if (size != state.size || threads != threads_before || resources.batch_splats != state.batch_splats ||
      resources.waiting_splats != state.waiting_splats)
    state.allocate(size, threads, resources);
  if (threads != threads_before || resources.permits != state.loop->permits())
    state.loop.emplace(threads, resources.permits);
  state.background = background;
  state.bins->clear();  // of a frame that was not ended
  state.bins->open();
  state.queues->clear();
  state.windows.begin(shading.layers, *state.loop);
  state.forRanges("clear tiles", tileCount(size), [&](size_t number) { state.clear(number); });
  // One thread fills it. Now the others prepare the first splats; at the end they would wait.
  if (state.image.size != size) state.image = blackImage(size);
}

void CpuPainter::drawOnly(const TileSet& tiles) {
  State& state = *state_;
  state.paintLast();
  for (size_t number = 0; number < tileCount(state.size); ++number) {
    const BlockMask open = state.inImage(number) & state.blocksIn(tiles, number);
    state.open[number].store(open, std::memory_order_relaxed);
    if (open != 0)
      state.bins->open(static_cast<int>(number));
    else
      state.bins->close(static_cast<int>(number));
  }
}

/// The blocks of a tile that lie in the image at least in part.
BlockMask CpuPainter::State::inImage(size_t number) const {
  const auto columns = static_cast<size_t>(bins->columns());
  const int x0 = static_cast<int>(number % columns) * kTileSide,
            y0 = static_cast<int>(number / columns) * kTileSide;
  return blocksOf(blocksAlong(0, static_cast<float>(size.width - 1 - x0), kTileSide).inTile(0),
                  blocksAlong(0, static_cast<float>(size.height - 1 - y0), kTileSide).inTile(0));
}

/// The blocks of a tile that lie in shared tiles of the set.
BlockMask CpuPainter::State::blocksIn(const TileSet& wanted, size_t number) const {
  const auto columns = static_cast<size_t>(bins->columns());
  const int x0 = static_cast<int>(number % columns) * kTileSide,
            y0 = static_cast<int>(number / columns) * kTileSide;
  BlockMask blocks = 0;
  for (int block = 0; block < kTileBlocks * kTileBlocks; ++block)
    if (wanted.hasPixel(x0 + block % kTileBlocks * kBlockSide, y0 + block / kTileBlocks * kBlockSide))
      blocks |= BlockMask{1} << block;
  return blocks;
}

/// Nothing in it; what lies outside of the image is saturated from the beginning.
void CpuPainter::State::clear(size_t number) {
  const auto columns = static_cast<size_t>(bins->columns());
  const int columns_left = size.width - static_cast<int>(number % columns) * kTileSide;
  const int rows_left = size.height - static_cast<int>(number / columns) * kTileSide;
  float* at = tile(number);
  for (int block = 0; block < kTileBlocks * kTileBlocks; ++block) {
    const int x = block % kTileBlocks * kBlockSide, y = block / kTileBlocks * kBlockSide;
    at = std::fill_n(at, 3 * kBlockPixels, 0.0f);
    for (int pixel = 0; pixel < kBlockPixels; ++pixel)
      *at++ = x + pixel % kBlockSide < columns_left && y + pixel / kBlockSide < rows_left;
  }
  open[number].store(inImage(number), std::memory_order_relaxed);
}

void CpuPainter::State::allocate(ImageSize wanted, unsigned threads, const PaintResources& resources) {
  size = {0, 0};
  bins.reset();
  queues.reset();
  tiles.reset();
  tiles = hwy::AllocateAligned<float>(tileCount(wanted) * kTileFloats);
  if (!tiles) throw std::bad_alloc();
  open = std::make_unique<std::atomic<BlockMask>[]>(tileCount(wanted));
  bins.emplace(wanted, resources.batch_splats, kEntriesASplat * resources.batch_splats, threads);
  queues.emplace(wanted, resources.waiting_splats, threads);
  size = wanted;
  batch_splats = resources.batch_splats;
  waiting_splats = resources.waiting_splats;
  prepared_bytes = std::clamp(resources.preparedBytes() / threads, kMinPreparedBytes, kMaxPreparedBytes);
}

void CpuPainter::State::paintBatch() {
  const StageTimer timer(draw_s, "paint batch", TraceKind::kStage);
  bins->sort(*loop);
  paintTiles(false);
}

/// Paints as many splats as fit into a batch of their own, and takes them off the span's beginning.
void CpuPainter::State::paintBorrowed(std::span<const ScreenSplat>& splats) {
  const StageTimer timer(draw_s, "paint batch", TraceKind::kStage);
  splats = splats.subspan(bins->sortBorrowed(splats, *loop));
  paintTiles(false);
}

/// job(n), for n below `count`. A few neighbours at a time: of 2,040 tiles a batch may touch 400, with some microseconds of
/// work each.
template <typename Job>
void CpuPainter::State::forRanges(const char* name, size_t count, const Job& job) {
  constexpr size_t kRangesAThread = 32;
  loop->forAll(name, count, std::max<size_t>(1, count / (kRangesAThread * loop->threads())), job);
}

/// The queues that have splats, or in which some wait. Those that have many come first: a thread that took one last would
/// keep all others waiting.
void CpuPainter::State::listTiles(bool last) {
  const TraceScope trace("list tiles");
  touched.clear();
  divided.clear();
  uint64_t work = 0;
  for (size_t queue = 0; queue < queues->size(); ++queue) {
    const size_t number = queues->tileOf(queue);
    const size_t of_queue = queues->workOf(queue, bins->tile(static_cast<int>(number)).size(), last);
    if (of_queue == 0) continue;
    touched.push_back({static_cast<uint32_t>(queue), static_cast<uint32_t>(of_queue)});
    work += of_queue;
  }
  if (loop->threads() > 1) divideHeavy(work);
  std::stable_partition(touched.begin(), touched.end(),
                        [&](const Touched& of) { return of.work * touched.size() > 2 * work; });
  listRanges(work);
}

/// Divides those queues that would keep a thread busy for longer than half of the batch takes.
void CpuPainter::State::divideHeavy(uint64_t work) {
  constexpr uint64_t kPartsAThread = 2, kMinWork = 1024;
  const uint64_t most = std::max(kMinWork, work / (kPartsAThread * loop->threads()));
  for (size_t n = 0, count = touched.size(); n < count; ++n) {
    const auto [queue, of_queue] = touched[n];
    if (of_queue <= most || !queues->divide(queue)) continue;
    const auto first = static_cast<uint32_t>(queues->size() - TileQueues::kParts);
    divided.push_back({queue, first});
    constexpr auto kParts = uint32_t{TileQueues::kParts};
    touched[n] = {first, of_queue / kParts};
    for (uint32_t part = first + 1; part < first + kParts; ++part)
      touched.push_back({part, of_queue / kParts});
  }
}

/// Neighbours that are about as much work.
void CpuPainter::State::listRanges(uint64_t work) {
  constexpr uint64_t kRangesAThread = 32;
  range_ends.clear();
  uint64_t of_range = 0;
  for (size_t n = 0; n < touched.size(); ++n) {
    of_range += touched[n].work;
    if (of_range * kRangesAThread * loop->threads() < work && n + 1 < touched.size()) continue;
    range_ends.push_back(static_cast<uint32_t>(n + 1));
    of_range = 0;
  }
}

/// `last`: no more splats will come for any tile.
void CpuPainter::State::paintTiles(bool last) {
  listTiles(last);
  loop->forAll("divide tiles", divided.size(), 1,
               [this](size_t n) { queues->moveToParts(divided[n].queue, divided[n].first_part); });
  const uint32_t front = bins->empty() ? 0 : bins->splats().back().first;
  loop->forAll("paint tiles", range_ends.size(), 1, [&, this](size_t range) {
    for (size_t n = range == 0 ? 0 : range_ends[range - 1]; n < range_ends[range]; ++n)
      if (!stop.stop_requested()) paintQueue(touched[n].queue, front, last);
  });
  bins->clear();
}

void CpuPainter::State::paintQueue(size_t queue, uint32_t front, bool last) {
  const size_t number = queues->tileOf(queue);
  const BlockMask blocks = queues->orderTilesIn(queue);
  queues->paint(queue, {bins->splats(), bins->tile(static_cast<int>(number)), front, last},
                open[number].load(std::memory_order_relaxed),
                [&](const OrderedTile& ordered) { return paintOrdered(number, blocks, ordered); });
}

/// Returns which of the blocks are still open. Other threads may paint other blocks of the tile.
BlockMask CpuPainter::State::paintOrdered(size_t number, BlockMask blocks, const OrderedTile& ordered) {
  const auto columns = static_cast<size_t>(bins->columns());
  const BlockMask before = open[number].load(std::memory_order_relaxed) & blocks;
  const BlockMask left = paintTile({tile(number), static_cast<int>(number % columns) * kTileSide,
                                    static_cast<int>(number / columns) * kTileSide, before, ordered.splats,
                                    ordered.order, ordered.lists, *table, colours ? &*colours : nullptr,
                                    shading, windows.tile(number), prepared_bytes});
  if (left == before) return left;
  const BlockMask closed = before & ~left;
  if ((open[number].fetch_and(~closed, std::memory_order_relaxed) & ~closed) == 0)
    bins->close(static_cast<int>(number));
  return left;
}

/// Paints what was collected, and what waits.
void CpuPainter::State::paintLast() {
  const StageTimer timer(draw_s, "paint batch", TraceKind::kStage);
  bins->sort(*loop);
  paintTiles(true);
}

void CpuPainter::draw(std::span<const ScreenSplat> splats) {
  State& state = *state_;
  const Computing computing(state.loop->permits());
  while (!splats.empty() && !state.stop.stop_requested()) {
    if (2 * splats.size() >= state.batch_splats && !state.bins->awaitsSplat()) {
      if (!state.bins->empty()) state.paintBatch();
      state.paintBorrowed(splats);
      continue;
    }
    size_t added;
    {
      const StageTimer timer(state.upload_s, "bin splats");
      added = state.bins->add(splats);
    }
    splats = splats.subspan(added);
    if (!splats.empty()) state.paintBatch();
  }
}

bool CpuPainter::hides(const ScreenBox& box) const {
  if (state_->queues->isFull()) return true;  // the picture will be drawn again
  if (!(box.x0 <= box.x1 && box.y0 <= box.y1)) return false;
  const BlockRange columns = blocksAlong(box.x0, box.x1, state_->size.width);
  const BlockRange rows = blocksAlong(box.y0, box.y1, state_->size.height);
  const auto tiles_a_row = static_cast<size_t>((state_->size.width + kTileSide - 1) / kTileSide);
  for (int row = rows.first / kTileBlocks; row <= rows.last / kTileBlocks; ++row)
    for (int column = columns.first / kTileBlocks; column <= columns.last / kTileBlocks; ++column) {
      const BlockMask touched = blocksOf(columns.inTile(column), rows.inTile(row));
      const size_t number = static_cast<size_t>(row) * tiles_a_row + static_cast<size_t>(column);
      if (state_->open[number].load(std::memory_order_relaxed) & touched) return false;
    }
  return true;
}

Image CpuPainter::end() {
  State& state = *state_;
  const Computing computing(state.loop->permits());
  state.paintLast();
  const StageTimer timer(state.draw_s, "finish picture", TraceKind::kStage);
  Image image = std::exchange(state.image, Image());
  const auto columns = static_cast<size_t>(state.bins->columns());
  state.forRanges("finish tiles", tileCount(state.size), [&](size_t number) {
    const float* tile = state.tile(number);
    const TileWindows* const windows = state.windows.tile(number);
    const int x0 = static_cast<int>(number % columns) * kTileSide;
    const int y0 = static_cast<int>(number / columns) * kTileSide;
    for (int y = 0; y < std::min(kTileSide, state.size.height - y0); ++y)
      for (int x = 0; x < std::min(kTileSide, state.size.width - x0); ++x) {
        const float* block = tile + (y / kBlockSide * kTileBlocks + x / kBlockSide) * kBlockFloats;
        const float* from = block + y % kBlockSide * kBlockSide + x % kBlockSide;
        PixelResult result;
        result.add({from[0], from[kBlockPixels], from[2 * kBlockPixels]}, from[3 * kBlockPixels]);
        if (windows) {
          const auto layers = state.shading.layers->at(x0 + x, y0 + y);
          const float* behind = windows->behind + (from - tile);
          for (size_t n = 0; n < layers.size(); ++n) {
            result.add(glm::vec3(layers[n].colour), 1 - layers[n].colour.w);
            if (layers[n].colour.w >= 1) break;
            result.add({behind[0], behind[kBlockPixels], behind[2 * kBlockPixels]}, behind[3 * kBlockPixels]);
            behind += kTileFloats;
          }
        }
        float* to = image.pixel(x0 + x, y0 + y);
        for (int c = 0; c < 3; ++c) to[c] = result.colour[c] + result.through * state.background[c];
        to[3] = 1 - result.through * (1 - state.background[3]);
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

uint64_t CpuPainter::hiddenSplats() const {
  return state_->bins ? state_->bins->hidden() : 0;
}

bool CpuPainter::isOverfull() const {
  return state_->queues && state_->queues->isFull();
}

uint64_t CpuPainter::frameBytes(ImageSize size) {
  return tileCount(size) *
         (kTileFloats * sizeof(float) + sizeof(std::atomic<BlockMask>) + sizeof(State::Touched));
}

uint64_t CpuPainter::batchBytes(ImageSize size, const PaintResources& resources) {
  return SplatBins::bytes(size, resources.batch_splats, kEntriesASplat * resources.batch_splats,
                          threadsOrCores(resources.threads)) +
         TileQueues::bytes(size, resources.waiting_splats, threadsOrCores(resources.threads));
}

uint64_t CpuPainter::layerBytes(const PixelLayers& layers) {
  return WindowTiles::bytes(layers);
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
