#include "preprocess/addition/build_values.h"

#include <algorithm>
#include <cstdlib>
#include <cstring>
#include <utility>

#include "preprocess/addition/value_buckets.h"
#include "preprocess/grid/parallel.h"
#include "stream/base/checksum.h"
#include "stream/base/error.h"
#include "stream/base/threads.h"
#include "stream/codec/geometry_codec.h"
#include "stream/codec/values_codec.h"

namespace curvisplat {

ValueBuilder::ValueBuilder(const CacheReader& cache, const ConversionOrder& order,
                           const ValueBuckets& buckets, std::vector<ValueCoding> codings,
                           ValuesWriter& writer, Progress& progress)
    : cache_(&cache),
      order_(&order),
      buckets_(&buckets),
      variables_(codings.size()),
      codings_(std::move(codings)),
      numbers_(cache.manifest().blocks),
      writer_(&writer),
      progress_(&progress),
      scratch_([this] {
        return Scratch{newMerger(), {}, {}};
      }) {}

void ValueBuilder::build(LoadedValues& loaded) {
  const uint32_t begin = buckets_->begin(loaded.bucket), end = buckets_->end(loaded.bucket);
  std::vector<Built> built(end - begin);

  const std::vector<Leaf> leaves = leavesOf(loaded);
  std::unique_ptr<OctantMerger> continued = std::move(open_);
  parallelFor(size_t{0}, leaves.size(), [&](size_t n) {
    const Leaf& leaf = leaves[n];
    if (leaf.is_continued) return buildLeaf(leaf, loaded, *continued, built);
    if (!leaf.goes_on) return buildLeaf(leaf, loaded, scratch_.local().merger, built);
    // One at most does: the last.
    open_ = std::make_unique<OctantMerger>(newMerger());
    buildLeaf(leaf, loaded, *open_, built);
  });
  if (!leaves.empty() && leaves.back().is_continued && leaves.back().goes_on) open_ = std::move(continued);

  std::vector<std::vector<uint32_t>> inner(kMaxLevel + 1);  // [level]: positions
  for (uint32_t position = begin; position < end; ++position) {
    if (brickAt(position).isLeaf())
      giveToParent(position, std::move(built[position - begin].octant));
    else
      inner[brickAt(position).cell.level].push_back(position);
  }
  for (size_t level = inner.size(); level-- > 0;) {
    const std::vector<uint32_t>& positions = inner[level];
    parallelFor(size_t{0}, positions.size(),
                [&](size_t n) { built[positions[n] - begin] = buildInner(positions[n], loaded); });
    for (const uint32_t position : positions) {
      octants_.erase((*order_)[position]);
      giveToParent(position, std::move(built[position - begin].octant));
    }
  }

  for (uint32_t position = begin; position < end; ++position) {
    writer_->append((*order_)[position], built[position - begin].values);
    if (brickAt(position).isLeaf()) progress_->advance(brickAt(position).splats);
  }
}

std::vector<ValueBuilder::Leaf> ValueBuilder::leavesOf(const LoadedValues& loaded) const {
  const uint32_t begin = buckets_->begin(loaded.bucket), end = buckets_->end(loaded.bucket);
  const auto is_next_of_cell = [&](uint32_t position) {
    return position > 0 && position < order_->size() && brickAt(position).isLeaf() &&
           brickAt(position - 1).cell == brickAt(position).cell;
  };
  std::vector<Leaf> leaves;
  for (uint32_t position = begin; position < end; ++position) {
    if (!brickAt(position).isLeaf()) continue;
    const bool is_next = is_next_of_cell(position);
    if (!is_next || position == begin) leaves.push_back({position, position, is_next, false});
    leaves.back().end = position + 1;
  }
  if (!leaves.empty() && leaves.back().end == end) leaves.back().goes_on = is_next_of_cell(end);
  return leaves;
}

void ValueBuilder::buildLeaf(const Leaf& leaf, LoadedValues& loaded, OctantMerger& merger,
                             std::vector<Built>& built) {
  Scratch& own = scratch_.local();
  BrickSplats& brick = own.brick;
  const Cell& cell = brickAt(leaf.begin).cell;
  const bool has_parent = cell.level > 0;
  if (has_parent && !leaf.is_continued) merger.begin(cell);
  for (uint32_t position = leaf.begin; position < leaf.end; ++position) {
    decode(position, loaded, brick);
    brick.variables.swap(own.variables);
    takeValues(position, loaded, brick);
    encode(position, brick, built[position - loaded.first]);
    writer_->histograms().add(brick);
    if (has_parent) merger.add(brick);
    brick.variables.swap(own.variables);
  }
  if (has_parent && !leaf.goes_on) built[leaf.end - 1 - loaded.first].octant = merger.finishValues();
}

ValueBuilder::Built ValueBuilder::buildInner(uint32_t position, const LoadedValues& loaded) {
  Scratch& own = scratch_.local();
  BrickSplats& brick = own.brick;
  decode(position, loaded, brick);
  std::array<Values, 8>& octants = octants_.at((*order_)[position]);
  brick.variables.resize(variables_);
  for (Values& octant : octants) {
    for (size_t v = 0; v < octant.size(); ++v)
      brick.variables[v].insert(brick.variables[v].end(), octant[v].begin(), octant[v].end());
    octant = {};
  }
  for (const auto& values : brick.variables)
    if (values.size() != brick.size())
      refuse(position, fmt::format("its children merge to {} splats, but it has {}; the cache is damaged or "
                                   "was written by another version: convert again",
                                   values.size(), brick.size()));
  Built built;
  encode(position, brick, built);
  if (brick.cell.level > 0) {
    own.merger.begin(brick.cell);
    own.merger.add(brick);
    built.octant = own.merger.finishValues();
  }
  return built;
}

void ValueBuilder::giveToParent(uint32_t position, Values&& octant) {
  const Brick& brick = brickAt(position);
  if (brick.parent == kNoBrick || octant.empty()) return;
  octants_[brick.parent][static_cast<size_t>(brick.cell.octantInParent())] = std::move(octant);
}

void ValueBuilder::decode(uint32_t position, const LoadedValues& loaded, BrickSplats& out) const {
  const Brick& brick = brickAt(position);
  const std::span<const std::byte> geometry = loaded.geometryOf(position);
  const uint64_t found = checksumOf(geometry);
  if (found != brick.geometry.checksum)
    refuse(position,
           fmt::format("its geometry has the checksum {:016x}, expected {:016x}; the file is damaged: "
                       "convert again",
                       found, brick.geometry.checksum));
  try {
    decodeForMerging(cache_->manifest().root, brick, geometry, out);
  } catch (const Error& error) {
    refuse(position, error.what());
  }
}

/// The values of a leaf's splats, in the order in which it stores them: by node. Each must be where it was.
void ValueBuilder::takeValues(uint32_t position, LoadedValues& loaded, BrickSplats& brick) const {
  constexpr const char* kOtherGrid = "this grid is not the one the cache was made from";
  constexpr const char* kOtherSplat =
      "this grid is not the one the cache was made from, or an earlier version of this program, whose splats "
      "were others, made it: convert again";
  const RecordSpan records = loaded.records(position);
  if (records.size() != brick.size())
    refuse(position, fmt::format("it has {} splats, but the grid has {} there; {}", brick.size(),
                                 records.size(), kOtherGrid));
  sortByNode(records);

  // Positions are stored in so many bits of the cell, the records' places in kPlaceBits. An ulp may carry a
  // position over a border of either.
  GeometryHeader header;
  std::memcpy(&header, loaded.geometryOf(position).data(), sizeof header);
  const int coarser = std::max(0, kPlaceBits - int{header.position_bits});
  const auto isAt = [&](const std::array<uint32_t, 3>& stored, const std::array<uint32_t, 3>& found) {
    bool near = true;
    for (int axis = 0; axis < 3; ++axis) {
      const auto from = static_cast<int>(stored[axis] >> coarser),
                 to = static_cast<int>(found[axis] >> coarser);
      near &= std::abs(from - to) <= 1;
    }
    return near;
  };

  // Slopes are along the columns of the splat's A. Axes that the cache has rounded are a step apart at the most.
  constexpr int kAlike = 1;
  const auto isAlike = [&](const std::array<uint32_t, 3>& stored, const std::array<uint32_t, 3>& found) {
    bool alike = true;
    for (size_t axis = 0; axis < 3; ++axis)
      alike &= std::abs(static_cast<int>(stored[axis]) - static_cast<int>(found[axis])) <= kAlike;
    return alike;
  };

  brick.variables.resize(variables_);
  for (auto& values : brick.variables) values.resize(brick.size());
  std::vector<SplatScalar> values(variables_);
  size_t n = 0;
  for (const NodeRun& run : brick.runs) {
    const uint64_t first = numbers_.firstOf(run);
    for (uint64_t in_run = 0; in_run < run.count; ++in_run, ++n) {
      const std::byte* record = records[n];
      const uint64_t node = recordNode(record);
      if (node != first + in_run)
        refuse(position, fmt::format("it has {}, but the grid has {} there; {}",
                                     numbers_.nameOf(first + in_run), numbers_.nameOf(node), kOtherGrid));
      const RecordedSplat found = valueRecordSplat(record);
      if (!isAt(placeInCell(brick.positions[n], brick.cell), found.place))
        refuse(position,
               fmt::format("{} has another position in the grid; {}", numbers_.nameOf(node), kOtherSplat));
      if (!isAlike(axisCodes(brick.splats[n]), found.axes))
        refuse(position, fmt::format("{} has a cell of another shape in the grid; {}", numbers_.nameOf(node),
                                     kOtherSplat));
      unpackValueRecord(record, values);
      for (size_t v = 0; v < variables_; ++v) brick.variables[v][n] = values[v];
    }
  }
  if (n != brick.size())
    refuse(position,
           fmt::format("it has {} splats, but its runs hold {} nodes; the cache is damaged: convert again",
                       brick.size(), n));
}

void ValueBuilder::encode(uint32_t position, BrickSplats& brick, Built& built) const {
  static const PerThread<StepReferences::Scratch> scratches;
  StepReferences::Scratch& scratch = scratches.own();
  for (size_t v = 0; v < brick.variables.size(); ++v) {
    TimeReferences references;
    if (references_) references = references_->of((*order_)[position], v, scratch);
    built.values.push_back(
        encodeValues(brick.runs, brick.border_codes, brick.variables[v], references, codings_[v]));
  }
}

void ValueBuilder::refuse(uint32_t position, const std::string& what) const {
  throw Error("{}: brick {}: {}", cache_->path().string(), (*order_)[position], what);
}

}  // namespace curvisplat
