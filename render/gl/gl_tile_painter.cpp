#include "render/gl/gl_tile_painter.h"

#include <algorithm>
#include <atomic>
#include <map>
#include <vector>

#include "render/gl/card_picture.h"
#include "render/gl/gl_functions.h"
#include "render/gl/gl_tile_lists.h"
#include "render/gl/pixel_counts.h"
#include "render/gl/splat_shader.h"
#include "render/gl/splat_tables.h"
#include "render/gl/stored_splats.h"
#include "render/gl/tile_picture.h"
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

struct GlTilePainter::State {
  State(const GlContext& context, const Capacity& capacity_, uint64_t default_bytes)
      : gl(context.functions()),
        capacity(context.isSoftware() ? capacity_ : within(gl, default_bytes, capacity_)),
        tables(gl),
        lists(gl, timers),
        stored(gl,
               {default_bytes, capacity.buffer_bytes, (kMaxRecords + capacity.splats) * sizeof(ScreenSplat)},
               tables, timers, kProject),
        picture(gl),
        card_pictures(gl, context.shared()) {}

  const GlFunctions& gl;
  const Capacity capacity;
  std::map<SplatShaderKind, GlProgram> programs;  // each compiled when it is first needed
  SplatTables tables;
  GlTimers timers{gl, kStages};
  GlTileLists lists;
  StoredSplats stored;
  TilePicture picture;
  CardPictures card_pictures;
  PixelCounts pixel_counts{gl};
  glm::vec4 background{0};
  std::stop_token stop;

  TileBox clip{};                  // pixels
  std::vector<ScreenSplat> batch;  // behind kMaxRecords elements: what waits, then what is new
  size_t waiting = 0;              // elements of the batch
  size_t most_waiting = 0;
  bool painted = false;  // something of the tiles that are drawn now
  uint32_t before = 0;   // the front up to which
  std::atomic<bool> overfull = false;
  double upload_s = 0, draw_s = 0;
  uint64_t most_bytes = 0;  // on the card
  uint64_t sent_bytes = 0, read_bytes = 0;

  const GlProgram& program();
  void paintBatch(bool last);
  void paintSlabs(bool last);
  void upload();
  void paintBox(const ListedSplats& listed, const CardTiles& tiles, const TileBox& box);
  void paintLists(const CardTiles& tiles, const TileBox& box);
  void keepWaiting(uint32_t front);
  void countBytes(uint64_t further = 0);
  void finish();
};

GlTilePainter::GlTilePainter(const GlContext& context)
    : GlTilePainter(context, Capacity::of(context.isSoftware())) {}

GlTilePainter::GlTilePainter(const GlContext& context, const Capacity& capacity) {
  if (const std::string why = context.functions().whyNoCompute(); !why.empty()) throw Error("{}", why);
  const uint64_t default_bytes =
      context.isSoftware() ? 0 : defaultCardBytes(context.functions(), os::availableMemory());
  state_ = std::make_unique<State>(context, capacity, default_bytes);
  // A driver that refuses the most demanding shader is to be known of now.
  const SplatShaderKind all{true, true, true, true, true, PixelLayers::kMaxWindows};
  state_->programs.emplace(all, GlProgram(state_->gl, splatTileShader(all)));
  if (default_bytes > 0) state_->stored.compile();
  state_->gl.check("setting up the painter");
}

GlTilePainter::~GlTilePainter() = default;

const GlProgram& GlTilePainter::State::program() {
  SplatShaderKind kind = tables.kind();
  kind.counts = pixel_counts.areWanted();
  auto found = programs.find(kind);
  if (found == programs.end()) found = programs.emplace(kind, GlProgram(gl, splatTileShader(kind))).first;
  return found->second;
}

void GlTilePainter::begin(ImageSize size, const glm::vec4& background, const ClassificationTable& table,
                          PixelShading shading, const PaintResources& resources) {
  State& state = *state_;
  state.timers.reset();
  state.lists.resetCounts();
  state.upload_s = state.draw_s = 0;
  state.sent_bytes = state.read_bytes = 0;
  state.tables.load(size, table, shading, resources.threads);
  state.picture.begin(size, state.tables.windows());
  state.stored.begin(table);
  state.pixel_counts.begin(size);
  state.background = background;
  state.stop = resources.stop;
  state.clip = {0, 0, size.width, size.height};
  state.batch.assign(kMaxRecords, kNoSplat);
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
  const ImageSize size = state.picture.size();
  state.clip = intersectionOf({box.x0 * kSide, box.y0 * kSide, box.x1 * kSide, box.y1 * kSide},
                              {0, 0, size.width, size.height});
  state.painted = false;
  state.before = 0;
  state.stored.goToFirstSlab();
}

BrickStore* GlTilePainter::store() {
  return &state_->stored;
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
  const bool is_any = batch.size() > kMaxRecords || (last && stored.elements() > 0);
  if (is_any && !stop.stop_requested() && !overfull) {
    const StageTimer timer(draw_s, "paint batch", TraceKind::kStage);
    picture.lookAtClosed();
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
  const bool ordered = stored.elements() > 0 || waiting > 0 || std::any_of(all.begin(), all.end(), leans);
  const CardTiles tiles = picture.tiles(ordered);
  const TileBox box = tilesOver(clip, tiles.side);
  const size_t elements = stored.elements() + batch.size();
  size_t earlier = painted ? stored.elements() + kMaxRecords + waiting : 0;
  for (;;) {
    const uint32_t until = std::min(front, stored.front());
    const ListedSplats listed{
        &stored.buffer(), static_cast<uint32_t>(elements), static_cast<uint32_t>(earlier), before, until,
        ordered};
    if (clip.x0 < clip.x1 && clip.y0 < clip.y1) paintBox(listed, tiles, box);
    before = until;
    painted = true;
    if (until == front) return;
    stored.goToNextSlab();
    earlier = elements;
  }
}

/// The picture is overfull where OpenGL has no buffer for what waits: smaller regions of it need less.
void GlTilePainter::State::upload() {
  const StageTimer timer(upload_s, "upload splats");
  if (!stored.write(batch, std::max(batch.size(), capacity.splats + kMaxRecords))) overfull = true;
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
  countBytes();
}

/// Counts what the card's memory holds now, and `further` bytes that are about to go.
void GlTilePainter::State::countBytes(uint64_t further) {
  most_bytes = std::max(most_bytes, picture.cardBytes() + stored.cardBytes() + lists.cardBytes() +
                                        tables.layerBytes() + further);
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
  stored.buffer().bind(0);
  lists.bind();
  picture.bind(painting);
  pixel_counts.bind();
  if (pixel_counts.areWanted())
    gl.Uniform1i(painting.uniform("counts_alone"), pixel_counts.areAlone() ? 1 : 0);
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

bool GlTilePainter::hides(const ScreenBox& box) const {
  // An overfull picture will be drawn again.
  return state_->overfull.load(std::memory_order_relaxed) || state_->picture.hides(box);
}

/// Waits for the card's clock, and takes the counts of the frame.
void GlTilePainter::State::finish() {
  timers.finish();
  pixel_counts.finish();
  sent_bytes = stored.takeSentBytes();
}

Image GlTilePainter::end() {
  State& state = *state_;
  state.paintBatch(true);
  const StageTimer timer(state.draw_s, "draw (OpenGL)");
  Image image;
  state.picture.read([&](std::span<const float> drawn) {
    state.finish();
    state.read_bytes = drawn.size_bytes();
    image = state.tables.composite(drawn, false, state.background);
  });
  return image;
}

std::shared_ptr<CardPicture> GlTilePainter::endOnCard() {
  State& state = *state_;
  if (!state.card_pictures.canShare()) return nullptr;
  state.paintBatch(true);
  const StageTimer timer(state.draw_s, "draw (OpenGL)");
  auto made = state.card_pictures.make(state.picture, state.tables, state.background);
  state.countBytes(made->bytes() + state.tables.layerColourBytes());
  state.finish();
  state.gl.checkReset("drawing");
  return made;
}

bool GlTilePainter::isOverfull() const {
  return state_->overfull;
}

double GlTilePainter::uploadSeconds() const {
  return state_->upload_s + state_->stored.seconds();
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
          state_->sent_bytes,
          state_->stored.slabs(),
          state_->read_bytes,
          state_->pixel_counts.listed(),
          state_->pixel_counts.blended()};
}

uint64_t GlTilePainter::bytes(ImageSize size, const PaintResources& resources, const Capacity& capacity) {
  return 4 * sizeof(float) * size.pixels() +  // what is read at the end
         (capacity.splats + 2 * resources.waiting_splats) * sizeof(ScreenSplat) +
         TileSet::tilesOf(size, kLargeTile) * (sizeof(uint32_t) + 1);
}

}  // namespace curvisplat
