#include "render/gl/gl_tile_painter.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <functional>
#include <map>
#include <vector>

#include "render/gl/card_bricks.h"
#include "render/gl/gl_functions.h"
#include "render/gl/gl_tile_lists.h"
#include "render/gl/splat_shader.h"
#include "render/gl/splat_tables.h"
#include "render/project/splat_chooser.h"
#include "render/project/tile_key.h"
#include "stream/base/error.h"
#include "stream/base/os.h"
#include "stream/base/trace.h"

namespace curvisplat {
namespace {

// Records before a batch's first element, since records of a splat are looked for before it.
constexpr size_t kMaxRecords = 3;
enum : size_t { kPaint = GlTileLists::kOtherStages, kProject, kStages };
constexpr int kGroupSide = 8;  // of splatTileShader()

/// The lists of tiles take no more than a sixth of what bricks take by default, and no more than a buffer holds.
GlTilePainter::Capacity within(const GlFunctions& gl, uint64_t default_bytes,
                               const GlTilePainter::Capacity& most) {
  const uint64_t bytes = std::min(default_bytes / 6, CardBuffer::largest(gl));
  return {most.splats, std::clamp<size_t>(bytes / GlTileLists::kEntryBytes, 1, most.entries),
          most.buffer_bytes};
}

/// An element that fills the gap before a batch's first: it is no splat, and no shader draws it.
const ScreenSplat kNoSplat = ScreenDepth{}.record();

/// The last key that the splat has in any tile, or a later one.
uint64_t lastKeyOf(const ScreenSplat& splat) {
  return leans(splat) ? uint64_t{splat.key} + static_cast<uint64_t>(std::min(mostBefore(splat), kMaxSteps))
                      : splat.key;
}

TileBox intersectionOf(const TileBox& a, const TileBox& b) {
  return {std::max(a.x0, b.x0), std::max(a.y0, b.y0), std::min(a.x1, b.x1), std::min(a.y1, b.y1)};
}

/// The tiles of `side` pixels in which some of these pixels lie.
TileBox tilesOver(const TileBox& pixels, int side) {
  return {pixels.x0 / side, pixels.y0 / side, (pixels.x1 + side - 1) / side, (pixels.y1 + side - 1) / side};
}

}  // namespace

struct GlTilePainter::State final : BrickStore {
  State(const GlFunctions& functions, const Capacity& capacity_, bool software)
      : gl(functions),
        default_bytes(software ? 0 : defaultCardBytes(functions, os::availableMemory())),
        capacity(software ? capacity_ : within(functions, default_bytes, capacity_)),
        tables(gl),
        lists(gl, timers),
        splats(gl),
        closed(gl),
        bricks(gl, capacity_.buffer_bytes),
        windows(makeTexture(gl)),
        framebuffer(makeFramebuffer(gl)),
        drawn(makeBuffer(gl)) {}

  const GlFunctions& gl;
  const uint64_t default_bytes;
  const Capacity capacity;
  std::map<SplatShaderKind, GlProgram> programs;  // each compiled when it is first needed
  SplatTables tables;
  GlTimers timers{gl, kStages};
  GlTileLists lists;
  CardBuffer splats, closed;  // closed: pixels of each small tile, then of each large one, that take no more
  CardBricks bricks;
  size_t stored = 0;  // elements of `splats` for those projected from bricks; the batch follows
  std::vector<CardSlab> slabs;
  size_t slab = 0;  // the one that is projected there
  std::function<void()> project_slab;
  GlObject windows, framebuffer, drawn;  // drawn: the windows, where the processor can read them
  ImageSize size{0, 0};
  int window_count = 0;
  unsigned threads = 0;
  glm::vec4 background{0};
  const ClassificationTable* table = nullptr;
  std::stop_token stop;

  TileBox clip{};                  // pixels
  std::vector<ScreenSplat> batch;  // behind kMaxRecords elements: what waits, then what is new
  size_t waiting = 0;              // elements of the batch
  size_t most_waiting = 0;
  bool painted = false;  // something of the tiles that are drawn now
  uint32_t before = 0;   // the front up to which
  std::atomic<bool> overfull = false;
  std::unique_ptr<std::atomic<uint8_t>[]> hidden;  // [large tile]
  double upload_s = 0, draw_s = 0;
  uint64_t window_bytes = 0, most_bytes = 0;  // on the card
  uint64_t sent_bytes = 0;                    // CardBricks::sentBytes() when the last picture ended
  uint64_t frame_sent_bytes = 0;

  void open(uint64_t content, const StepPosition& step) override { bricks.open(content, step); }
  size_t makeRoom(std::span<const StoredPart> parts, uint64_t bytes) override {
    return bricks.makeRoom(parts, bytes, splats, otherBytes());
  }
  bool giveMemoryUp() override {
    if (!bricks.giveMemoryUp()) return false;
    splats.release();
    return true;
  }
  uint64_t defaultBytes() const override { return default_bytes; }
  bool has(uint32_t brick) const override { return bricks.has(brick); }
  void put(const StoredPart& part, const GeometryArrays<const float>& geometry, const BrickValues& values,
           const BrickPieces& pieces) override {
    bricks.put(part, geometry, values, pieces);
  }
  void drawStored(const ProjectionSettings& settings, const DepthKeys& keys,
                  std::span<const StoredPart> parts) override;
  ProjectionCounts counts() const override { return stored > 0 ? bricks.counts() : ProjectionCounts{}; }

  const GlProgram& program();
  void allocate(ImageSize wanted, int count);
  void openTiles();
  CardTiles tilesOf(bool small) const;
  /// `splats` has these behind the stored ones, or more where more wait.
  uint64_t otherBytes() const { return (kMaxRecords + capacity.splats) * sizeof(ScreenSplat); }
  size_t largeTiles() const { return TileSet::tilesOf(size, kLargeTile); }
  void paintBatch(bool last);
  void paintSlabs(bool last);
  void goToSlab(size_t wanted);
  void upload();
  void paintBox(const ListedSplats& listed, const CardTiles& tiles, const TileBox& box);
  void paintLists(const CardTiles& tiles, const TileBox& box);
  void keepWaiting(uint32_t front);
  void lookAtClosed();
  std::span<const float> readWindows();
};

GlTilePainter::GlTilePainter(const GlContext& context)
    : GlTilePainter(context, Capacity::of(context.isSoftware())) {}

GlTilePainter::GlTilePainter(const GlContext& context, const Capacity& capacity) {
  if (const std::string why = context.functions().whyNoCompute(); !why.empty()) throw Error("{}", why);
  state_ = std::make_unique<State>(context.functions(), capacity, context.isSoftware());
  // A driver that refuses the most demanding shader is to be known of now.
  const SplatShaderKind all{true, true, true, true, true, PixelLayers::kMaxWindows};
  state_->programs.emplace(all, GlProgram(state_->gl, splatTileShader(all)));
  if (state_->default_bytes > 0) state_->bricks.compile();
  state_->gl.check("setting up the painter");
}

GlTilePainter::~GlTilePainter() = default;

const GlProgram& GlTilePainter::State::program() {
  const SplatShaderKind kind = tables.kind();
  auto found = programs.find(kind);
  if (found == programs.end()) found = programs.emplace(kind, GlProgram(gl, splatTileShader(kind))).first;
  return found->second;
}

void GlTilePainter::State::allocate(ImageSize wanted, int count) {
  if (wanted == size && count == window_count) return;
  GLint most = 0;
  gl.GetIntegerv(GL_MAX_TEXTURE_SIZE, &most);
  if (wanted.width > most || wanted.height > most)
    throw Error(
        "an image of {}x{} pixels is larger than this OpenGL draws (at most {}x{}); ask for a smaller --size",
        wanted.width, wanted.height, most, most);
  size = {0, 0};
  windows = makeTexture(gl);
  gl.BindTexture(GL_TEXTURE_2D_ARRAY, windows.name());
  gl.TexStorage3D(GL_TEXTURE_2D_ARRAY, 1, GL_RGBA32F, wanted.width, wanted.height, count);
  closed.reserve((TileSet::tilesOf(wanted, kSmallTile) + TileSet::tilesOf(wanted, kLargeTile)) *
                 sizeof(uint32_t));
  gl.check("the picture");
  window_bytes = 4 * sizeof(float) * wanted.pixels() * static_cast<uint64_t>(count);
  gl.BindBuffer(GL_PIXEL_PACK_BUFFER, drawn.name());
  gl.BufferData(GL_PIXEL_PACK_BUFFER, static_cast<GLsizeiptr>(window_bytes), nullptr, GL_STREAM_READ);
  gl.BindBuffer(GL_PIXEL_PACK_BUFFER, 0);
  gl.check("the picture that is read");
  hidden = std::make_unique<std::atomic<uint8_t>[]>(TileSet::tilesOf(wanted, kLargeTile));
  size = wanted;
  window_count = count;
}

/// Nothing is painted, and every pixel lets everything through.
void GlTilePainter::State::openTiles() {
  gl.BindFramebuffer(GL_FRAMEBUFFER, framebuffer.name());
  gl.ClearColor(0, 0, 0, 1);
  for (int n = 0; n < window_count; ++n) {
    gl.FramebufferTextureLayer(GL_FRAMEBUFFER, GL_COLOR_ATTACHMENT0, windows.name(), 0, n);
    gl.Clear(GL_COLOR_BUFFER_BIT);
  }
  closed.clear();
  gl.check("beginning a frame");
  for (size_t tile = 0; tile < largeTiles(); ++tile) hidden[tile].store(0, std::memory_order_relaxed);
}

void GlTilePainter::begin(ImageSize size, const glm::vec4& background, const ClassificationTable& table,
                          PixelShading shading, const PaintResources& resources) {
  State& state = *state_;
  state.timers.reset();
  state.lists.resetCounts();
  state.upload_s = state.draw_s = 0;
  state.tables.load(size, table, shading);
  state.allocate(size, state.tables.windows());
  state.openTiles();
  state.background = background;
  state.stop = resources.stop;
  state.threads = resources.threads;
  state.clip = {0, 0, size.width, size.height};
  state.batch.assign(kMaxRecords, kNoSplat);
  state.stored = 0;
  state.slabs.clear();
  state.table = &table;
  state.painted = false;
  state.waiting = 0;
  state.most_waiting = resources.waiting_splats;
  state.before = 0;
  state.overfull = false;
}

void GlTilePainter::drawOnly(const TileSet& tiles) {
  State& state = *state_;
  state.paintBatch(true);
  const TileBox box = tiles.box();
  constexpr int kSide = kSharedTileSide;
  state.clip = intersectionOf({box.x0 * kSide, box.y0 * kSide, box.x1 * kSide, box.y1 * kSide},
                              {0, 0, state.size.width, state.size.height});
  state.painted = false;
  state.before = 0;
  state.goToSlab(0);
}

BrickStore* GlTilePainter::store() {
  return state_.get();
}

void GlTilePainter::State::drawStored(const ProjectionSettings& settings, const DepthKeys& keys,
                                      std::span<const StoredPart> parts) {
  const StageTimer timer(upload_s, "project bricks");
  slabs = bricks.beginFrame(parts);
  for (const CardSlab& each : slabs) stored = std::max(stored, each.elements);
  project_slab = [this, &settings, &keys] {
    timers.measure(kProject, [&] {
      if (slabs[slab].elements < stored) splats.fill(stored * sizeof(ScreenSplat), kNoSplat.l11);
      bricks.project(settings, keys, slabs[slab], tables, SplatChooser::largestScalar(*table), splats);
    });
  };
  splats.reserve(stored * sizeof(ScreenSplat) + otherBytes());
  slab = 0;
  project_slab();
}

void GlTilePainter::State::goToSlab(size_t wanted) {
  if (stored == 0 || slab == wanted) return;
  slab = wanted;
  project_slab();
}

void GlTilePainter::draw(std::span<const ScreenSplat> splats) {
  State& state = *state_;
  while (!splats.empty()) {
    // A batch has at least as many new splats as waiting ones, since each batch looks at all that wait.
    const size_t most = std::max(state.capacity.splats, state.waiting);
    const size_t fresh = state.batch.size() - kMaxRecords - state.waiting;
    const size_t some = std::min(splats.size(), most - std::min(fresh, most));
    if (some == 0) {
      state.paintBatch(false);
      continue;
    }
    state.batch.insert(state.batch.end(), splats.begin(), splats.begin() + static_cast<std::ptrdiff_t>(some));
    splats = splats.subspan(some);
  }
}

/// `last`: all that was drawn is painted, whatever its keys.
void GlTilePainter::State::paintBatch(bool last) {
  // Records whose splat has not come yet stay behind it.
  std::vector<ScreenSplat> records;
  while (batch.size() > kMaxRecords + waiting && isRecord(batch.back())) {
    records.insert(records.begin(), batch.back());
    batch.pop_back();
  }
  const bool is_any = batch.size() > kMaxRecords || (last && stored > 0);
  if (is_any && !stop.stop_requested() && !overfull) {
    const StageTimer timer(draw_s, "paint batch", TraceKind::kStage);
    lookAtClosed();
    upload();
    if (overfull) {
      batch.resize(kMaxRecords);
      waiting = 0;
      return;
    }
    paintSlabs(last);
    if (last)
      batch.resize(kMaxRecords);
    else
      keepWaiting(before);
  } else {
    batch.resize(kMaxRecords);
  }
  waiting = batch.size() - kMaxRecords;
  batch.insert(batch.end(), records.begin(), records.end());
}

/// Paints the batch, which ends with a splat, and what stored bricks have up to its front: slab after slab, with what the
/// batch has there.
void GlTilePainter::State::paintSlabs(bool last) {
  const std::span<const ScreenSplat> all = std::span(batch).subspan(kMaxRecords);
  const uint32_t front = last ? CardBricks::kLastKey : all.back().first;
  const bool ordered = stored > 0 || waiting > 0 || std::any_of(all.begin(), all.end(), leans);
  const CardTiles tiles = tilesOf(ordered);
  const TileBox box = tilesOver(clip, tiles.side);
  size_t earlier = painted ? stored + kMaxRecords + waiting : 0;
  for (;;) {
    const uint32_t until = stored > 0 ? std::min(front, slabs[slab].front) : front;
    const ListedSplats listed{
        &splats, static_cast<uint32_t>(stored + batch.size()), static_cast<uint32_t>(earlier), before, until,
        ordered};
    if (clip.x0 < clip.x1 && clip.y0 < clip.y1) paintBox(listed, tiles, box);
    before = until;
    painted = true;
    if (until == front) return;
    goToSlab(slab + 1);
    earlier = stored + batch.size();
  }
}

CardTiles GlTilePainter::State::tilesOf(bool small) const {
  const auto small_tiles = static_cast<uint32_t>(TileSet::tilesOf(size, kSmallTile));
  return {small ? kSmallTile : kLargeTile, size, &closed, small ? 0 : small_tiles};
}

void GlTilePainter::State::upload() {
  const StageTimer timer(upload_s, "upload splats");
  const std::span<const ScreenSplat> all = batch;
  const uint64_t bytes = (stored + std::max(all.size(), capacity.splats + kMaxRecords)) * sizeof(ScreenSplat);
  if (stored > 0 && bytes > CardBuffer::largest(gl)) {  // smaller regions of the picture need less
    overfull = true;
    return;
  }
  if (bytes > splats.bytes()) {  // more wait than there was space for
    splats.reserve(bytes);
    if (stored > 0) project_slab();
  }
  splats.write(stored * sizeof(ScreenSplat), all);
}

/// Paints a box, in halves if there are more entries than there is space for.
void GlTilePainter::State::paintBox(const ListedSplats& listed, const CardTiles& tiles, const TileBox& box) {
  const uint64_t entries = lists.count(listed, tiles, box);
  if (entries == 0) return;
  if (entries > capacity.entries && box.tiles() > 1) {
    TileBox first = box, second = box;
    if (box.columns() > box.rows())
      first.x1 = second.x0 = box.x0 + box.columns() / 2;
    else
      first.y1 = second.y0 = box.y0 + box.rows() / 2;
    paintBox(listed, tiles, first);
    paintBox(listed, tiles, second);
    return;
  }
  lists.make(listed, tiles, box, entries);
  timers.measure(kPaint, [&] { paintLists(tiles, box); });
  most_bytes = std::max(most_bytes, 2 * window_bytes + splats.bytes() + closed.bytes() + lists.cardBytes() +
                                        bricks.cardBytes());
}

void GlTilePainter::State::paintLists(const CardTiles& tiles, const TileBox& box) {
  const GlProgram& painting = program();
  tables.use(painting);
  const TileBox pixels{box.x0 * tiles.side, box.y0 * tiles.side, box.x1 * tiles.side, box.y1 * tiles.side};
  const TileBox open = intersectionOf(clip, pixels);  // groups reach beyond both
  gl.Uniform4i(painting.uniform("clip"), open.x0, open.y0, open.x1, open.y1);
  gl.Uniform2i(painting.uniform("origin"), pixels.x0, pixels.y0);
  gl.Uniform1i(painting.uniform("side"), tiles.side);
  gl.Uniform1i(painting.uniform("columns"), box.columns());
  const CardTiles small = tilesOf(true), large = tilesOf(false);
  gl.Uniform3i(painting.uniform("closed_places"), small.columns(), large.columns(),
               static_cast<GLint>(large.closed_begin));
  splats.bind(0);
  lists.bind();
  closed.bind(3);
  gl.BindImageTexture(0, windows.name(), 0, GL_TRUE, 0, GL_READ_WRITE, GL_RGBA32F);
  const auto groups = [&](int count) {
    return static_cast<GLuint>((count * tiles.side + kGroupSide - 1) / kGroupSide);
  };
  gl.DispatchCompute(groups(box.columns()), groups(box.rows()), 1);
  gl.MemoryBarrier(GL_SHADER_STORAGE_BARRIER_BIT | GL_SHADER_IMAGE_ACCESS_BARRIER_BIT |
                   GL_BUFFER_UPDATE_BARRIER_BIT | GL_TEXTURE_UPDATE_BARRIER_BIT | GL_FRAMEBUFFER_BARRIER_BIT);
  gl.check("painting tiles");
}

/// Moves what has more behind the front to the beginning of the batch.
void GlTilePainter::State::keepWaiting(uint32_t front) {
  size_t kept = kMaxRecords, records = 0;
  for (size_t n = kMaxRecords; n < batch.size(); ++n) {
    if (isRecord(batch[n])) {
      ++records;
      continue;
    }
    if (lastKeyOf(batch[n]) > front) {
      std::copy(&batch[n - records], &batch[n] + 1, &batch[kept]);
      kept += records + 1;
    }
    records = 0;
  }
  batch.resize(kept);
  if (kept - kMaxRecords <= most_waiting) return;
  overfull = true;
  batch.resize(kMaxRecords);
}

/// Finds which large tiles take no more, for hides(), by what was painted before: nothing has to be waited
/// for.
void GlTilePainter::State::lookAtClosed() {
  std::vector<uint32_t> pixels(largeTiles());
  closed.bind();
  gl.GetBufferSubData(GL_SHADER_STORAGE_BUFFER,
                      static_cast<GLintptr>(tilesOf(false).closed_begin * sizeof(uint32_t)),
                      static_cast<GLsizeiptr>(std::span(pixels).size_bytes()), pixels.data());
  const int columns = TileSet::tilesAlong(size.width, kLargeTile);
  for (size_t tile = 0; tile < pixels.size(); ++tile) {
    const int x = static_cast<int>(tile) % columns * kLargeTile,
              y = static_cast<int>(tile) / columns * kLargeTile;
    const int all = std::min(kLargeTile, size.width - x) * std::min(kLargeTile, size.height - y);
    hidden[tile].store(pixels[tile] == static_cast<uint32_t>(all), std::memory_order_relaxed);
  }
}

bool GlTilePainter::hides(const ScreenBox& box) const {
  const State& state = *state_;
  if (state.overfull.load(std::memory_order_relaxed)) return true;  // the picture will be drawn again
  if (!(box.x0 <= box.x1 && box.y0 <= box.y1)) return false;
  const auto at = [](float pixel, int pixels) {
    return static_cast<int>(std::clamp(pixel, 0.0f, static_cast<float>(pixels - 1))) / kLargeTile;
  };
  const ImageSize size = state.size;
  const int columns = TileSet::tilesAlong(size.width, kLargeTile);
  for (int row = at(box.y0, size.height); row <= at(box.y1, size.height); ++row)
    for (int column = at(box.x0, size.width); column <= at(box.x1, size.width); ++column)
      if (!state.hidden[static_cast<size_t>(row * columns + column)].load(std::memory_order_relaxed))
        return false;
  return true;
}

/// Returns the windows, which are valid until the buffer is unmapped. They go through a buffer that the card itself
/// writes, since drivers copy into other memory much slower.
std::span<const float> GlTilePainter::State::readWindows() {
  gl.BindTexture(GL_TEXTURE_2D_ARRAY, windows.name());
  gl.GetTexImage(GL_TEXTURE_2D_ARRAY, 0, GL_RGBA, GL_FLOAT, nullptr);
  const void* const mapped =
      gl.MapBufferRange(GL_PIXEL_PACK_BUFFER, 0, static_cast<GLsizeiptr>(window_bytes), GL_MAP_READ_BIT);
  gl.check("reading the picture");
  return {static_cast<const float*>(mapped), window_bytes / sizeof(float)};
}

Image GlTilePainter::end() {
  State& state = *state_;
  state.paintBatch(true);
  const StageTimer timer(state.draw_s, "draw (OpenGL)");
  const GlFunctions& gl = state.gl;
  gl.BindBuffer(GL_PIXEL_PACK_BUFFER, state.drawn.name());
  struct Release {  // where there is no memory for the picture, too
    const GlFunctions& gl;
    bool is_mapped = false;
    ~Release() {
      if (is_mapped) gl.UnmapBuffer(GL_PIXEL_PACK_BUFFER);
      gl.BindBuffer(GL_PIXEL_PACK_BUFFER, 0);
    }
  } release{gl};
  const std::span<const float> drawn = state.readWindows();
  release.is_mapped = true;
  gl.checkReset("drawing");
  state.timers.finish();
  state.frame_sent_bytes = state.bricks.sentBytes() - state.sent_bytes;
  state.sent_bytes = state.bricks.sentBytes();
  return state.tables.composite(drawn, false, state.background, state.threads);
}

bool GlTilePainter::isOverfull() const {
  return state_->overfull;
}

double GlTilePainter::uploadSeconds() const {
  return state_->upload_s;
}

double GlTilePainter::drawSeconds() const {
  return state_->draw_s;
}

CardWork GlTilePainter::cardWork() const {
  const GlTimers& timers = state_->timers;
  const double list_s = timers.seconds(GlTileLists::kList), sort_s = timers.seconds(GlTileLists::kSort),
               paint_s = timers.seconds(kPaint), project_s = timers.seconds(kProject);
  return {project_s + list_s + sort_s + paint_s,
          project_s,
          list_s,
          sort_s,
          paint_s,
          state_->lists.listedEntries(),
          state_->most_bytes,
          state_->frame_sent_bytes,
          state_->slabs.size()};
}

uint64_t GlTilePainter::bytes(ImageSize size, const PaintResources& resources, const Capacity& capacity) {
  return 4 * sizeof(float) * size.pixels() +  // what is read at the end
         (capacity.splats + 2 * resources.waiting_splats) * sizeof(ScreenSplat) +
         TileSet::tilesOf(size, kLargeTile) * (sizeof(uint32_t) + 1);
}

}  // namespace curvisplat
