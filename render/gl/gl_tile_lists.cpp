#include "render/gl/gl_tile_lists.h"

#include <algorithm>
#include <bit>

#include "stream/base/error.h"

namespace curvisplat {
namespace {

constexpr uint64_t kKeyBytes = 2 * sizeof(uint32_t), kNumberBytes = sizeof(uint32_t);

uint32_t groupsOf(uint64_t count, uint32_t a_group) {
  return static_cast<uint32_t>((count + a_group - 1) / a_group);
}

GlProgram programOf(const GlFunctions& gl, TileListStep step) {
  return {gl, tileListShader(step)};
}

}  // namespace

void CardBuffer::reserve(uint64_t bytes) {
  if (bytes <= bytes_) return;
  GLint64 most = 0;
  gl_.GetInteger64v(GL_MAX_SHADER_STORAGE_BLOCK_SIZE, &most);
  if (bytes > static_cast<uint64_t>(most))
    throw Error("this OpenGL has no buffers of {} MiB (at most {}); give --backend egl-quads, or cpu",
                bytes >> 20, most >> 20);
  bytes_ = 0;
  bind();
  gl_.BufferData(GL_SHADER_STORAGE_BUFFER, static_cast<GLsizeiptr>(bytes), nullptr, GL_DYNAMIC_COPY);
  gl_.check("splats and the lists of tiles");
  bytes_ = bytes;
}

void CardBuffer::clear() const {
  bind();
  gl_.ClearBufferData(GL_SHADER_STORAGE_BUFFER, GL_R32UI, GL_RED_INTEGER, GL_UNSIGNED_INT, nullptr);
}

GlTileLists::GlTileLists(const GlFunctions& gl, GlTimers& timers)
    : gl_(gl),
      timers_(timers),
      programs_{programOf(gl, TileListStep::kList), programOf(gl, TileListStep::kScan),
                programOf(gl, TileListStep::kHistogram), programOf(gl, TileListStep::kScatter),
                programOf(gl, TileListStep::kRanges)},
      counts_(gl),
      sums_(gl),
      totals_(gl),
      ranges_(gl),
      keys_{CardBuffer(gl), CardBuffer(gl)},
      numbers_{CardBuffer(gl), CardBuffer(gl)} {
  totals_.reserve(kDigits * sizeof(uint32_t));
}

const GlProgram& GlTileLists::use(TileListStep step) const {
  const GlProgram& program = programs_[static_cast<size_t>(step)];
  gl_.UseProgram(program.name());
  return program;
}

void GlTileLists::dispatch(uint32_t groups) const {
  gl_.DispatchCompute(groups, 1, 1);
  gl_.MemoryBarrier(GL_SHADER_STORAGE_BARRIER_BIT | GL_BUFFER_UPDATE_BARRIER_BIT);
}

void GlTileLists::setInputs(const GlProgram& program, const ListedSplats& splats, const CardTiles& tiles,
                            const TileBox& box, bool writes) const {
  const auto set = [&](const char* name, uint32_t value) { gl_.Uniform1ui(program.uniform(name), value); };
  gl_.Uniform1i(program.uniform("writes"), writes);
  set("first_splat", splats.first);
  set("splat_count", splats.count);
  set("waiting", splats.waiting);
  set("before", splats.before);
  set("front", splats.front);
  set("least_key", splats.least_key);
  set("key_bits", splats.key_bits);
  gl_.Uniform4i(program.uniform("box"), box.x0, box.y0, box.x1, box.y1);
  gl_.Uniform1i(program.uniform("side"), tiles.side);
  gl_.Uniform2i(program.uniform("picture"), tiles.picture.width, tiles.picture.height);
  gl_.Uniform1i(program.uniform("closed_columns"), tiles.columns());
  gl_.Uniform1i(program.uniform("closed_begin"), static_cast<GLint>(tiles.closed_begin));
  splats.splats->bind(0);
  counts_.bind(1);
  sums_.bind(2);
  tiles.closed->bind(3);
}

void GlTileLists::scan(uint32_t rows, uint32_t length) {
  const GlProgram& program = use(TileListStep::kScan);
  gl_.Uniform1ui(program.uniform("length_of_row"), length);
  sums_.bind(0);
  totals_.bind(1);
  dispatch(rows);
}

uint64_t GlTileLists::count(const ListedSplats& splats, const CardTiles& tiles, const TileBox& box) {
  const uint32_t groups = groupsOf(splats.count, kListThreads);
  counts_.reserve(splats.count * sizeof(uint32_t));
  sums_.reserve(groups * sizeof(uint32_t));
  timers_.measure(kList, [&] {
    setInputs(use(TileListStep::kList), splats, tiles, box, false);
    dispatch(groups);
    scan(1, groups);
  });
  uint32_t total = 0;
  totals_.bind();
  gl_.GetBufferSubData(GL_SHADER_STORAGE_BUFFER, 0, sizeof(total), &total);
  gl_.check("counting the splats of tiles");
  return total;
}

void GlTileLists::make(const ListedSplats& splats, const CardTiles& tiles, const TileBox& box,
                       uint64_t entries) {
  for (CardBuffer& keys : keys_) keys.reserve(entries * kKeyBytes);
  for (CardBuffer& numbers : numbers_) numbers.reserve(entries * kNumberBytes);
  timers_.measure(kList, [&] { emit(splats, tiles, box); });
  sums_.reserve(uint64_t{kDigits} * groupsOf(entries, kSortedAGroup) * sizeof(uint32_t));
  timers_.measure(kSort, [&] {
    const auto bits = splats.key_bits + static_cast<uint32_t>(std::bit_width(box.tiles() - 1));
    for (uint32_t shift = 0; shift < bits; shift += kDigitBits) sortDigit(entries, shift);
  });
  ranges_.reserve(box.tiles() * 2 * sizeof(uint32_t));
  timers_.measure(kList, [&] { findRanges(splats.key_bits, entries); });
  listed_entries_ += entries;
}

void GlTileLists::emit(const ListedSplats& splats, const CardTiles& tiles, const TileBox& box) {
  sorted_ = 0;
  setInputs(use(TileListStep::kList), splats, tiles, box, true);
  keys_[0].bind(4);
  numbers_[0].bind(5);
  dispatch(groupsOf(splats.count, kListThreads));
}

void GlTileLists::findRanges(uint32_t key_bits, uint64_t entries) {
  ranges_.clear();
  const GlProgram& program = use(TileListStep::kRanges);
  gl_.Uniform1ui(program.uniform("entry_count"), static_cast<uint32_t>(entries));
  gl_.Uniform1ui(program.uniform("shift"), key_bits);
  keys_[sorted_].bind(0);
  ranges_.bind(2);
  dispatch(groupsOf(entries, kListThreads));
}

void GlTileLists::sortDigit(uint64_t entries, uint32_t shift) {
  const uint32_t groups = groupsOf(entries, kSortedAGroup);
  const auto begin = [&](TileListStep step) {
    const GlProgram& program = use(step);
    gl_.Uniform1ui(program.uniform("entry_count"), static_cast<uint32_t>(entries));
    gl_.Uniform1ui(program.uniform("shift"), shift);
    keys_[sorted_].bind(0);
    numbers_[sorted_].bind(1);
    sums_.bind(2);
  };
  begin(TileListStep::kHistogram);
  dispatch(groups);
  scan(kDigits, groups);
  begin(TileListStep::kScatter);
  totals_.bind(3);
  sorted_ = 1 - sorted_;
  keys_[sorted_].bind(4);
  numbers_[sorted_].bind(5);
  dispatch(groups);
  moved_entries_ += entries;
}

uint64_t GlTileLists::cardBytes() const {
  uint64_t bytes = counts_.bytes() + sums_.bytes() + totals_.bytes() + ranges_.bytes();
  for (size_t n = 0; n < 2; ++n) bytes += keys_[n].bytes() + numbers_[n].bytes();
  return bytes;
}

}  // namespace curvisplat
