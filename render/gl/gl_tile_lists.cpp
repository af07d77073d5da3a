#include "render/gl/gl_tile_lists.h"

#include <algorithm>

namespace curvisplat {
namespace {

uint32_t groupsOf(uint64_t count, uint32_t a_group) {
  return static_cast<uint32_t>((count + a_group - 1) / a_group);
}

GlProgram programOf(const GlFunctions& gl, TileListStep step) {
  return {gl, tileListShader(step)};
}

}  // namespace

GlTileLists::GlTileLists(const GlFunctions& gl, GlTimers& timers)
    : gl_(gl),
      timers_(timers),
      programs_{programOf(gl, TileListStep::kList), programOf(gl, TileListStep::kScan),
                programOf(gl, TileListStep::kSort)},
      ends_(gl),
      chunks_(gl),
      total_(gl),
      entries_(gl) {
  total_.reserve(sizeof(uint32_t));
}

const GlProgram& GlTileLists::use(TileListStep step) const {
  const GlProgram& program = programs_[static_cast<size_t>(step)];
  gl_.UseProgram(program.name());
  return program;
}

void GlTileLists::dispatch(uint32_t columns, uint32_t rows) const {
  gl_.DispatchCompute(columns, rows, 1);
  gl_.MemoryBarrier(GL_SHADER_STORAGE_BARRIER_BIT | GL_BUFFER_UPDATE_BARRIER_BIT);
}

void GlTileLists::bind() const {
  ends_.bind(1);
  chunks_.bind(2);
  entries_.bind(4);
}

/// Counts the entries of each tile, or writes them.
void GlTileLists::list(const ListedSplats& splats, const CardTiles& tiles, const TileBox& box,
                       bool writes) const {
  const GlProgram& program = use(TileListStep::kList);
  const auto set = [&](const char* name, uint32_t value) { gl_.Uniform1ui(program.uniform(name), value); };
  gl_.Uniform1i(program.uniform("writes"), writes);
  gl_.Uniform1i(program.uniform("ordered"), splats.ordered);
  set("splat_count", splats.count);
  set("waiting", splats.waiting);
  set("before", splats.before);
  set("front", splats.front);
  gl_.Uniform4i(program.uniform("box"), box.x0, box.y0, box.x1, box.y1);
  gl_.Uniform1i(program.uniform("side"), tiles.side);
  gl_.Uniform2i(program.uniform("picture"), tiles.picture.width, tiles.picture.height);
  gl_.Uniform1i(program.uniform("closed_columns"), tiles.columns());
  gl_.Uniform1i(program.uniform("closed_begin"), static_cast<GLint>(tiles.closed_begin));
  splats.splats->bind(0);
  bind();
  tiles.closed->bind(3);
  const uint32_t groups = groupsOf(splats.count, kListThreads);
  dispatch(std::min(groups, kMaxGroups), groupsOf(groups, kMaxGroups));
}

void GlTileLists::scan(const CardBuffer& sums, const CardBuffer& totals, uint32_t rows,
                       uint32_t length) const {
  const GlProgram& program = use(TileListStep::kScan);
  gl_.Uniform1ui(program.uniform("length_of_row"), length);
  sums.bind(0);
  totals.bind(1);
  dispatch(rows);
}

uint64_t GlTileLists::count(const ListedSplats& splats, const CardTiles& tiles, const TileBox& box) {
  const uint32_t chunks = groupsOf(box.tiles(), kTilesAChunk);
  ends_.reserve(uint64_t{chunks} * kTilesAChunk * sizeof(uint32_t));
  chunks_.reserve(chunks * sizeof(uint32_t));
  entries_.reserve(kEntryBytes);  // there must be one
  timers_.measure(kList, [&] {
    ends_.clear();
    list(splats, tiles, box, false);
    scan(ends_, chunks_, chunks, kTilesAChunk);
    scan(chunks_, total_, 1, chunks);
  });
  uint32_t total = 0;
  total_.bind();
  gl_.GetBufferSubData(GL_SHADER_STORAGE_BUFFER, 0, sizeof(total), &total);
  gl_.check("counting the splats of tiles");
  return total;
}

void GlTileLists::make(const ListedSplats& splats, const CardTiles& tiles, const TileBox& box,
                       uint64_t entries) {
  entries_.reserve(entries * kEntryBytes);
  timers_.measure(kList, [&] { list(splats, tiles, box, true); });
  timers_.measure(kSort, [&] {
    const GlProgram& program = use(TileListStep::kSort);
    gl_.Uniform1ui(program.uniform("columns"), static_cast<uint32_t>(box.columns()));
    bind();
    dispatch(static_cast<uint32_t>(box.columns()), static_cast<uint32_t>(box.rows()));
  });
  listed_entries_ += entries;
}

}  // namespace curvisplat
