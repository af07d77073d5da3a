#include "tools/throughput/prepared_sample.h"

#include <algorithm>

#include "stream/base/check.h"
#include "stream/base/checksum.h"
#include "stream/base/file.h"
#include "stream/codec/brick_codec.h"

namespace curvisplat {
namespace {

void sortInto(DepthSorter& sorter, const std::vector<uint32_t>& keys, const std::vector<ScreenSplat>& splats,
              std::vector<ScreenSplat>& sorted) {
  const auto order = sorter.sort(keys, DrawingOrder::kFrontToBack);
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
  plan_.keys.keysOf(scratch.projector.depths(), cache_.manifest().root.cellMin(of_index.cell),
                    plan_.keys.rangeOf(of_index), scratch.keys);
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

}  // namespace curvisplat
