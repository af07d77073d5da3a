#include "render/gl/gl_painter.h"

#include <algorithm>
#include <deque>
#include <map>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "render/gl/gl_functions.h"
#include "render/gl/splat_shader.h"
#include "render/gl/splat_tables.h"
#include "render/tiles/splat_bins.h"
#include "render/tiles/tile_queues.h"
#include "stream/base/compute_permits.h"
#include "stream/base/error.h"

namespace curvisplat {
namespace {

// llvmpipe sets up triangles far ahead of drawing them, at 640 bytes a splat: unbounded, half a million
// splats took 330 MiB. Two draws under way keep all its threads busy.
constexpr size_t kSplatsPerDraw = 16384;
constexpr size_t kDrawsInFlight = 2;
constexpr size_t kBatchSplats = 65536, kEntriesASplat = 4;
/// How many records of a splat may come before it.
constexpr size_t kMaxRecordsOfSplat = 3;

/// Splats as the shader's instances, behind kMaxRecordsOfSplat elements that are not drawn: ScreenSplat's floats as 4 + 4 + 2,
/// and those of the two records that cut it, which lie before it; its skew, `along` and the pixels that it is clipped
/// to, in the place of its keys; and its ScreenColour. Leaves itself bound.
struct InstanceBuffer {
  GlObject buffer, vertex_array;

  explicit InstanceBuffer(const GlFunctions& gl) : buffer(makeBuffer(gl)), vertex_array(makeVertexArray(gl)) {
    setUp(gl, false);
  }

  /// `coloured`: a ScreenColour lies between a splat and what cuts it.
  void setUp(const GlFunctions& gl, bool coloured) {
    static constexpr GLint kComponents[] = {4, 4, 2};
    constexpr size_t kSplat = kMaxRecordsOfSplat * sizeof(ScreenSplat);
    bind(gl);
    GLuint attribute = 0;
    const auto point = [&](GLint components, size_t offset) {
      gl.EnableVertexAttribArray(attribute);
      gl.VertexAttribPointer(attribute, components, GL_FLOAT, GL_FALSE, sizeof(ScreenSplat),
                             reinterpret_cast<const void*>(offset));
      gl.VertexAttribDivisor(attribute++, 1);
    };
    const auto pointToInts = [&](GLint components, size_t member) {
      gl.EnableVertexAttribArray(attribute);
      gl.VertexAttribIPointer(attribute, components, GL_INT, sizeof(ScreenSplat),
                              reinterpret_cast<const void*>(kSplat + member));
      gl.VertexAttribDivisor(attribute++, 1);
    };
    for (size_t record = 0; record < 3; ++record) {
      size_t offset = kSplat - (record > 0 && coloured ? record + 1 : record) * sizeof(ScreenSplat);
      for (const GLint components : kComponents) {
        point(components, offset);
        offset += static_cast<size_t>(components) * sizeof(float);
      }
    }
    pointToInts(1, offsetof(ScreenSplat, skew));
    pointToInts(2, offsetof(ScreenSplat, key));
    point(1, kSplat + offsetof(ScreenSplat, along));
    if (!coloured) return;
    point(4, kSplat - sizeof(ScreenSplat));
    point(2, kSplat - sizeof(ScreenSplat) + 4 * sizeof(float));
  }

  void bind(const GlFunctions& gl) const {
    gl.BindVertexArray(vertex_array.name());
    gl.BindBuffer(GL_ARRAY_BUFFER, buffer.name());
  }
};

/// The pixels of a rectangle, in the place of a splat's keys.
struct ClipBox {
  int x, y, side;

  void writeTo(ScreenSplat& splat) const {
    static_assert(offsetof(ScreenSplat, first) == offsetof(ScreenSplat, key) + sizeof(uint32_t));
    splat.key = static_cast<uint32_t>(x) | static_cast<uint32_t>(y) << 16;
    splat.first = static_cast<uint32_t>(side);
  }
};

}  // namespace

struct GlPainter::State {
  explicit State(const GlFunctions& functions)
      : gl(functions), tables(gl), instances(gl), framebuffer(makeFramebuffer(gl)) {}

  const GlFunctions& gl;
  std::map<SplatShaderKind, GlProgram> programs;  // each compiled when it is first needed
  SplatTables tables;
  bool coloured = false;  // splats have ScreenColours
  InstanceBuffer instances;
  std::vector<ScreenSplat> staged;  // the next draw
  std::optional<SplatBins> bins;
  std::optional<TileQueues> queues;
  size_t waiting_splats = 0;
  PaintLoop loop{1, nullptr};
  GlObject framebuffer;
  std::vector<GlObject> colours;  // an attachment for each window of depth
  ImageSize size{0, 0};
  glm::vec4 background{0};
  struct InFlight {
    GlFence fence;
    GlObject timer;  // a query, done when the fence is passed
  };
  std::deque<InFlight> in_flight;
  double upload_s = 0, draw_s = 0, gl_draw_s = 0;
  uint64_t read_bytes = 0;

  void allocate(ImageSize wanted, int windows);
  void useRecords(bool with_colours);
  const GlProgram& program(const SplatShaderKind& kind);
  void paintBatch(bool last);
  void stageTile(size_t number, const OrderedTile& ordered);
  void stage(std::span<const ScreenSplat> splats, uint32_t splat, const ClipBox& clip);
  void drawStaged();
  void finishDraws();
  void finishOldest();
};

GlPainter::GlPainter(const GlContext& context) : state_(std::make_unique<State>(context.functions())) {
  const GlFunctions& gl = state_->gl;
  gl.Enable(GL_BLEND);
  gl.Enable(GL_SCISSOR_TEST);
  gl.BlendFunc(GL_ONE_MINUS_DST_ALPHA, GL_ONE);  // nearest first
  gl.check("setting up the painter");
}

GlPainter::~GlPainter() = default;

const GlProgram& GlPainter::State::program(const SplatShaderKind& kind) {
  auto found = programs.find(kind);
  if (found == programs.end())
    found = programs.emplace(kind, GlProgram(gl, splatVertexShader(), splatFragmentShader(kind))).first;
  return found->second;
}

void GlPainter::State::allocate(ImageSize wanted, int windows) {
  const auto count = static_cast<size_t>(windows);
  const bool same_size = wanted.width == size.width && wanted.height == size.height;
  if (same_size && colours.size() == count) return;
  GLint viewport[2] = {0, 0}, side = 0;
  gl.GetIntegerv(GL_MAX_VIEWPORT_DIMS, viewport);
  gl.GetIntegerv(GL_MAX_RENDERBUFFER_SIZE, &side);
  const GLint widest = std::min(side, viewport[0]), tallest = std::min(side, viewport[1]);
  if (wanted.width > widest || wanted.height > tallest)
    throw Error(
        "an image of {}x{} pixels is larger than this OpenGL draws (at most {}x{}); ask for a smaller --size",
        wanted.width, wanted.height, widest, tallest);
  size = {0, 0};
  if (!same_size) colours.clear();
  gl.BindFramebuffer(GL_FRAMEBUFFER, framebuffer.name());
  for (size_t n = count; n < colours.size(); ++n)
    gl.FramebufferRenderbuffer(GL_FRAMEBUFFER, GL_COLOR_ATTACHMENT0 + static_cast<GLenum>(n), GL_RENDERBUFFER,
                               0);
  colours.erase(colours.begin() + static_cast<std::ptrdiff_t>(std::min(count, colours.size())),
                colours.end());
  std::vector<GLenum> attachments;
  for (size_t n = 0; n < count; ++n) {
    attachments.push_back(GL_COLOR_ATTACHMENT0 + static_cast<GLenum>(n));
    if (n < colours.size()) continue;
    colours.push_back(makeRenderbuffer(gl));
    gl.BindRenderbuffer(GL_RENDERBUFFER, colours[n].name());
    gl.RenderbufferStorage(GL_RENDERBUFFER, GL_RGBA32F, wanted.width, wanted.height);
    gl.FramebufferRenderbuffer(GL_FRAMEBUFFER, attachments[n], GL_RENDERBUFFER, colours[n].name());
  }
  gl.DrawBuffers(static_cast<GLsizei>(count), attachments.data());
  gl.check("allocating the image");
  if (const GLenum status = gl.CheckFramebufferStatus(GL_FRAMEBUFFER); status != GL_FRAMEBUFFER_COMPLETE)
    throw Error(
        "this OpenGL cannot draw to a 32-bit float image of {}x{} pixels (framebuffer status 0x{:04x})",
        wanted.width, wanted.height, status);
  size = wanted;
}

/// Whether splats have ScreenColours.
void GlPainter::State::useRecords(bool with_colours) {
  if (with_colours == coloured) return;
  coloured = with_colours;
  instances.setUp(gl, coloured);
}

void GlPainter::begin(ImageSize size, const glm::vec4& background, const ClassificationTable& table,
                      PixelShading shading, const PaintResources& resources) {
  const GlFunctions& gl = state_->gl;
  state_->finishDraws();  // of a frame that was not ended
  state_->staged.assign(kMaxRecordsOfSplat, {});
  const bool same_size = size == state_->size;
  state_->upload_s = state_->draw_s = state_->gl_draw_s = 0;
  state_->read_bytes = 0;
  state_->tables.load(size, table, shading, resources.threads);
  state_->allocate(size, state_->tables.windows());
  if (!same_size || !state_->bins || resources.waiting_splats != state_->waiting_splats) {
    state_->bins.emplace(size, kBatchSplats, kEntriesASplat * kBatchSplats, 1);
    state_->queues.emplace(size, resources.waiting_splats, 1u);
    state_->waiting_splats = resources.waiting_splats;
  }
  state_->bins->clear();
  state_->bins->open();
  state_->queues->clear();
  state_->useRecords(shading.colours != nullptr);
  const GlProgram& program = state_->program(state_->tables.kind());
  state_->tables.use(program);
  gl.Uniform2f(program.uniform("clip_from_pixel"), 2.0f / static_cast<float>(size.width),
               2.0f / static_cast<float>(size.height));
  gl.Viewport(0, 0, size.width, size.height);
  gl.Scissor(0, 0, size.width, size.height);
  state_->background = background;
  gl.ClearColor(0, 0, 0, 0);
  gl.Clear(GL_COLOR_BUFFER_BIT);
  gl.check("beginning a frame");
}

void GlPainter::drawOnly(const TileSet& tiles) {
  state_->paintBatch(true);
  state_->drawStaged();
  const TileBox box = tiles.box();
  state_->gl.Scissor(box.x0 * kSharedTileSide, box.y0 * kSharedTileSide, box.columns() * kSharedTileSide,
                     box.rows() * kSharedTileSide);
}

void GlPainter::draw(std::span<const ScreenSplat> splats) {
  State& state = *state_;
  while (!splats.empty()) {
    splats = splats.subspan(state.bins->add(splats));
    if (!splats.empty()) state.paintBatch(false);
  }
}

/// Draws what was collected: as it came, if it has one order; else tile by tile.
void GlPainter::State::paintBatch(bool last) {
  const std::span<const ScreenSplat> splats = bins->splats();
  const bool one_order = !queues->anyWaits() && std::none_of(splats.begin(), splats.end(), leans);
  if (one_order) {
    for (uint32_t n = 0; n < splats.size(); ++n)
      if (!isRecord(splats[n])) stage(splats, n, {0, 0, std::max(size.width, size.height)});
  } else {
    bins->sort(loop);
    const uint32_t front = splats.empty() ? 0 : splats.back().first;
    for (size_t number = 0; number < TileSet::tilesOf(size); ++number) {
      const auto entries = bins->tile(static_cast<int>(number));
      if (entries.empty() && !(last && queues->waits(number))) continue;
      queues->paint(number, {splats, entries, front, last}, TileQueues::kAllOpen,
                    [&](const OrderedTile& ordered) {
                      stageTile(number, ordered);
                      return TileQueues::kAllOpen;
                    });
    }
  }
  bins->clear();
}

void GlPainter::State::stageTile(size_t number, const OrderedTile& ordered) {
  const auto columns = static_cast<size_t>(bins->columns());
  const int x = static_cast<int>(number % columns) * kTileSide,
            y = static_cast<int>(number / columns) * kTileSide;
  if (!ordered.lists) {
    for (const uint32_t n : ordered.order) stage(ordered.splats, n, {x, y, kTileSide});
    return;
  }
  for (size_t tile = 0; tile < kOrderTiles; ++tile) {
    const ClipBox clip{x + static_cast<int>(tile) % kOrderTilesAlong * kOrderSide,
                       y + static_cast<int>(tile) / kOrderTilesAlong * kOrderSide, kOrderSide};
    for (const uint64_t item : (*ordered.lists)[tile])
      stage(ordered.splats, ordered.order[numberOf(item)], clip);
  }
}

/// Adds a splat, and the records before it, to the next draw.
void GlPainter::State::stage(std::span<const ScreenSplat> splats, uint32_t splat, const ClipBox& clip) {
  uint32_t first = splat;
  while (first > 0 && isRecord(splats[first - 1])) --first;
  staged.insert(staged.end(), splats.begin() + first, splats.begin() + splat + 1);
  clip.writeTo(staged.back());
  if (staged.size() >= kSplatsPerDraw) drawStaged();
}

void GlPainter::State::drawStaged() {
  if (staged.size() <= kMaxRecordsOfSplat) return;
  GlObject query = makeQuery(gl);
  instances.bind(gl);
  {
    // Fresh storage each time: the driver keeps what it still draws from.
    const StageTimer timer(upload_s, "upload splats");
    gl.BufferData(GL_ARRAY_BUFFER, static_cast<GLsizeiptr>(std::span(staged).size_bytes()), staged.data(),
                  GL_STREAM_DRAW);
  }
  const StageTimer timer(draw_s, "draw (OpenGL)");
  gl.BeginQuery(GL_TIME_ELAPSED, query.name());
  gl.DrawArraysInstanced(GL_TRIANGLE_STRIP, 0, 4, static_cast<GLsizei>(staged.size() - kMaxRecordsOfSplat));
  gl.EndQuery(GL_TIME_ELAPSED);
  gl.check("drawing splats");
  in_flight.push_back({GlFence(gl), std::move(query)});
  if (in_flight.size() > kDrawsInFlight) finishOldest();
  staged.resize(kMaxRecordsOfSplat);
}

void GlPainter::State::finishOldest() {
  in_flight.front().fence.wait();
  GLuint64 nanoseconds = 0;
  gl.GetQueryObjectui64v(in_flight.front().timer.name(), GL_QUERY_RESULT, &nanoseconds);
  gl_draw_s += 1e-9 * static_cast<double>(nanoseconds);
  in_flight.pop_front();
}

void GlPainter::State::finishDraws() {
  const StageTimer timer(draw_s, "draw (OpenGL)");
  while (!in_flight.empty()) finishOldest();
}

bool GlPainter::isOverfull() const {
  return state_->queues->isFull();
}

uint64_t GlPainter::bytes(ImageSize size, const PaintResources& resources) {
  return 4 * sizeof(float) * size.pixels() +  // the framebuffer
         SplatBins::bytes(size, kBatchSplats, kEntriesASplat * kBatchSplats, 1) +
         TileQueues::bytes(size, resources.waiting_splats, 1);
}

Image GlPainter::end() {
  const GlFunctions& gl = state_->gl;
  state_->paintBatch(true);
  state_->drawStaged();
  state_->finishDraws();
  const StageTimer timer(state_->draw_s, "draw (OpenGL)");
  const State& state = *state_;
  std::vector<float> drawn(4 * state.size.pixels() * state.colours.size());
  for (size_t n = 0; n < state.colours.size(); ++n) {
    gl.ReadBuffer(GL_COLOR_ATTACHMENT0 + static_cast<GLenum>(n));
    gl.ReadPixels(0, 0, state.size.width, state.size.height, GL_RGBA, GL_FLOAT,
                  &drawn[4 * state.size.pixels() * n]);
  }
  gl.check("reading the picture");
  state_->read_bytes = std::span(drawn).size_bytes();
  return state.tables.composite(drawn, true, state.background);
}

double GlPainter::uploadSeconds() const {
  return state_->upload_s;
}

double GlPainter::drawSeconds() const {
  return state_->draw_s;
}

CardWork GlPainter::cardWork() const {
  return {.draw_s = state_->gl_draw_s, .read_bytes = state_->read_bytes};
}

}  // namespace curvisplat
