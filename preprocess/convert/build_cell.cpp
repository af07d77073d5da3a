#include "preprocess/convert/build_cell.h"

#include <tbb/enumerable_thread_specific.h>
#include <tbb/task_group.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <optional>
#include <utility>

#include "preprocess/convert/splat_record.h"
#include "preprocess/grid/parallel.h"
#include "stream/base/error.h"
#include "stream/base/trace.h"

namespace curvisplat {
namespace {

/// A cell that is done, and what its parent needs of it.
struct Subtree {
  BuiltCell built;
  std::optional<MergedOctant> octant;  // none for the topmost
};

bool coincide(const RecordSpan& records) {
  const RootPosition first = recordPosition(records[0]);
  for (size_t n = 1; n < records.size(); ++n)
    if (recordPosition(records[n]) != first) return false;
  return true;
}

/// Throws where a cell was not built: if another task of an enclosing loop has thrown, TBB cancels the loops
/// within a cell, too, which then return normally with work left undone. The cell must not be built from the
/// rest; of the two exceptions the first one is reported.
[[noreturn]] void throwNotAllBuilt() {
  throw Error("the bricks of a cell were not all built");
}

/// Reorders the records by octant of `cell`, many by several threads. Returns where each octant begins, and
/// the end.
std::array<size_t, 9> divide(const Cell& cell, RecordSpan records) {
  constexpr size_t kRecordsPerTask = 32768;
  struct Part {
    std::array<size_t, 8> next{};  // record of each octant: first their number, then where it goes
  };
  std::vector<Part> parts((records.size() + kRecordsPerTask - 1) / kRecordsPerTask);
  std::vector<uint8_t> octants(records.size());
  const auto forEachPart = [&](const auto& work) {
    parallelFor(size_t{0}, parts.size(), [&](size_t n) {
      const TraceScope trace("divide cell");
      const size_t begin = n * kRecordsPerTask;
      work(parts[n], begin, std::min(begin + kRecordsPerTask, records.size()));
    });
  };
  forEachPart([&](Part& part, size_t begin, size_t end) {
    for (size_t n = begin; n < end; ++n) {
      records.prefetchAfter(n);
      octants[n] = static_cast<uint8_t>(octantOf(recordPosition(records[n]), cell));
      ++part.next[octants[n]];
    }
  });
  std::array<size_t, 9> begins{};
  size_t placed = 0;
  for (size_t octant = 0; octant < 8; ++octant) {
    begins[octant] = placed;
    for (Part& part : parts) placed += std::exchange(part.next[octant], placed);
  }
  begins[8] = placed;
  if (placed != records.size()) throwNotAllBuilt();
  std::vector<uint32_t> divided(records.size());
  forEachPart([&](Part& part, size_t begin, size_t end) {
    for (size_t n = begin; n < end; ++n) divided[part.next[octants[n]]++] = records.places[n];
  });
  std::copy(divided.begin(), divided.end(), records.places.begin());
  return begins;
}

}  // namespace

void sortByNode(RecordSpan records) {
  struct Key {
    uint64_t node;
    uint32_t place;
  };
  // Nodes of a cell lie close together: a radix sort of what they differ in takes two or three passes.
  constexpr int kDigitBits = 11;
  std::vector<Key> keys(records.size()), sorted(records.size());
  uint64_t least = UINT64_MAX, most = 0;
  for (size_t n = 0; n < records.size(); ++n) {
    records.prefetchAfter(n);
    keys[n] = {recordNode(records[n]), records.places[n]};
    least = std::min(least, keys[n].node);
    most = std::max(most, keys[n].node);
  }
  for (int shift = 0; (most - least) >> shift != 0; shift += kDigitBits) {
    const auto digitOf = [&](const Key& key) {
      return (key.node - least) >> shift & ((uint64_t{1} << kDigitBits) - 1);
    };
    std::array<uint32_t, (size_t{1} << kDigitBits) + 1> begins{};
    for (const Key& key : keys) ++begins[digitOf(key) + 1];
    for (size_t digit = 1; digit < begins.size(); ++digit) begins[digit] += begins[digit - 1];
    for (const Key& key : keys) sorted[begins[digitOf(key)]++] = key;
    keys.swap(sorted);
  }
  for (size_t n = 0; n < records.size(); ++n) records.places[n] = keys[n].place;
}

struct CellBuilder::State {
  /// Scratch memory of a thread for making a brick; kept, since it is large. Never held across a wait for
  /// other tasks.
  struct Scratch {
    BrickSplats brick;
    OctantMerger merger;
  };

  State(const RootCube& root_cube, const std::vector<GridBlock>& grid_blocks, size_t variable_count,
        HistogramSums& histogram_sums, const Progress& stopping, std::vector<ValueCoding> value_codings)
      : root(root_cube),
        blocks(&grid_blocks),
        variables(variable_count),
        histograms(&histogram_sums),
        progress(&stopping),
        codings(std::move(value_codings)),
        codings_of_merged(codingsOfMerged(codings)),
        scratch([this] {
          return Scratch{{}, OctantMerger(root, variables)};
        }) {
    uint64_t node = 0;
    for (const GridBlock& block : grid_blocks) {
      first_nodes.push_back(node);
      node += block.nodes();
    }
  }

  Subtree build(const Cell& cell, RecordSpan records, bool is_top);
  Subtree buildLeaf(const Cell& cell, RecordSpan records, bool is_top);
  Subtree buildInner(const Cell& cell, RecordSpan records, bool is_top);

  void unpack(const Cell& cell, const RecordSpan& records, BrickSplats& brick) const;
  void addToRuns(uint64_t node, std::vector<NodeRun>& runs) const;

  const RootCube root;
  const std::vector<GridBlock>* blocks;
  const size_t variables;
  HistogramSums* const histograms;
  const Progress* progress;
  const std::vector<ValueCoding> codings, codings_of_merged;  // [variable]
  std::vector<uint64_t> first_nodes;                          // [block]
  tbb::enumerable_thread_specific<Scratch> scratch;
};

Subtree CellBuilder::State::build(const Cell& cell, RecordSpan records, bool is_top) {
  CURVISPLAT_CHECK(records.size() > 0);
  progress->throwIfStopped();
  if (records.size() <= kMaxBrickSplats || cell.level == kMaxLevel || coincide(records))
    return buildLeaf(cell, records, is_top);
  return buildInner(cell, records, is_top);
}

Subtree CellBuilder::State::buildLeaf(const Cell& cell, RecordSpan records, bool is_top) {
  const TraceScope trace("build leaf");
  sortByNode(records);
  Scratch& own = scratch.local();
  if (!is_top) own.merger.begin(cell);
  Subtree leaf;
  for (size_t begin = 0; begin < records.size(); begin += kMaxBrickSplats) {
    unpack(cell, records.subspan(begin, std::min<size_t>(kMaxBrickSplats, records.size() - begin)),
           own.brick);
    leaf.built.bricks.push_back({encodeBrick(root, own.brick, codings), 0, true});
    histograms->add(own.brick);
    if (!is_top) own.merger.add(own.brick);
  }
  leaf.built.own_bricks = leaf.built.bricks.size();
  if (!is_top) leaf.octant = own.merger.finish();
  return leaf;
}

Subtree CellBuilder::State::buildInner(const Cell& cell, RecordSpan records, bool is_top) {
  const std::array<size_t, 9> begins = divide(cell, records);
  std::array<Subtree, 8> children;
  parallelFor(size_t{0}, size_t{8}, [&](size_t octant) {
    const size_t count = begins[octant + 1] - begins[octant];
    if (count == 0) return;
    children[octant] =
        build(cell.child(static_cast<int>(octant)), records.subspan(begins[octant], count), false);
  });
  for (size_t octant = 0; octant < 8; ++octant)
    if (begins[octant] != begins[octant + 1] && !children[octant].octant) throwNotAllBuilt();

  const TraceScope trace("build inner brick");
  Subtree inner;
  std::array<MergedOctant, 8> octants;
  for (size_t octant = 0; octant < 8; ++octant) {
    Subtree& child = children[octant];
    if (!child.octant) continue;
    inner.built.error = std::max({inner.built.error, child.built.error, child.octant->detail});
    octants[octant] = std::move(*child.octant);
    std::move(child.built.bricks.begin(), child.built.bricks.end(), std::back_inserter(inner.built.bricks));
  }
  BrickSplats brick = joinOctants(cell, variables, std::move(octants));
  inner.built.bricks.push_back(
      {encodeBrick(root, brick, codings_of_merged), static_cast<float>(inner.built.error), false});
  inner.built.own_bricks = 1;
  if (!is_top) {
    OctantMerger& merger = scratch.local().merger;
    merger.begin(cell);
    merger.add(brick);
    inner.octant = merger.finish();
  }
  return inner;
}

void CellBuilder::State::unpack(const Cell& cell, const RecordSpan& records, BrickSplats& brick) const {
  brick.cell = cell;
  brick.runs.clear();
  brick.positions.resize(records.size());
  brick.splats.resize(records.size());
  brick.border_codes.resize(records.size());
  brick.growth_codes.resize(records.size());
  brick.variables.resize(variables);
  for (auto& values : brick.variables) values.resize(records.size());
  std::vector<SplatScalar> values(variables);
  for (size_t n = 0; n < records.size(); ++n) {
    records.prefetchAfter(n);
    brick.positions[n] = recordPosition(records[n]);
    const SplatCodes codes = unpackRecord(records[n], brick.splats[n], values);
    brick.border_codes[n] = codes.border;
    brick.growth_codes[n] = codes.growth;
    for (size_t variable = 0; variable < variables; ++variable)
      brick.variables[variable][n] = values[variable];
    addToRuns(recordNode(records[n]), brick.runs);
  }
}

void CellBuilder::State::addToRuns(uint64_t node, std::vector<NodeRun>& runs) const {
  if (!runs.empty()) {
    NodeRun& last = runs.back();
    const GridBlock& block = (*blocks)[last.block];
    const uint64_t next_in_block = last.i + last.count + block.ni * (last.j + block.nj * last.k);
    if (last.i + last.count < block.ni && node == first_nodes[last.block] + next_in_block) {
      ++last.count;
      return;
    }
  }
  const auto after = std::upper_bound(first_nodes.begin(), first_nodes.end(), node);
  const auto number = static_cast<uint32_t>(after - first_nodes.begin() - 1);
  const GridBlock& block = (*blocks)[number];
  const uint64_t in_block = node - first_nodes[number];
  runs.push_back(
      {number, in_block % block.ni, in_block / block.ni % block.nj, in_block / block.ni / block.nj, 1});
}

CellBuilder::CellBuilder(const RootCube& root, const std::vector<GridBlock>& blocks, size_t variables,
                         HistogramSums& histograms, const Progress& progress,
                         std::vector<ValueCoding> codings)
    : state_(std::make_unique<State>(root, blocks, variables, histograms, progress, std::move(codings))) {}

CellBuilder::~CellBuilder() = default;

BuiltCell CellBuilder::build(const Cell& cell, RecordSpan records) {
  return state_->build(cell, records, true).built;
}

namespace {

constexpr int kOctantBits = kLatticeBits - 1;  // voxels along an edge of a child's cell
constexpr size_t kOctantVoxels = size_t{1} << (3 * kOctantBits);
constexpr uint64_t kOctantMask = (uint64_t{1} << kOctantBits) - 1;

}  // namespace

OctantMerger::OctantMerger(const RootCube& root, size_t variables, bool even)
    : root_(root),
      variables_(variables),
      even_(even),
      unit_(std::ldexp(root.size, -kPositionBits)),
      voxels_(variables, kOctantVoxels),
      values_(variables) {}

void OctantMerger::begin(const Cell& child) {
  CURVISPLAT_CHECK_OP(child.level, >, 0u);
  child_ = child;
  shift_ = kPositionBits - static_cast<int>(child.level) - kOctantBits;
  voxels_.clear(even_ ? std::ldexp(unit_, shift_) : 0);
}

size_t OctantMerger::voxelOf(const RootPosition& position) const {
  size_t voxel = 0;
  for (int axis = 2; axis >= 0; --axis)
    voxel = voxel << kOctantBits | (position.at[axis] >> shift_ & kOctantMask);
  return voxel;
}

RootPosition OctantMerger::voxelCorner(size_t voxel) const {
  RootPosition corner;
  for (int axis = 0; axis < 3; ++axis) {
    const uint64_t in_octant = voxel >> (axis * kOctantBits) & kOctantMask;
    corner.at[axis] = (uint64_t{child_.at[axis]} << kOctantBits | in_octant) << shift_;
  }
  return corner;
}

void OctantMerger::add(const BrickSplats& brick) {
  const uint64_t in_voxel = (uint64_t{1} << shift_) - 1;
  for (size_t n = 0; n < brick.size(); ++n) {
    const RootPosition& position = brick.positions[n];
    glm::dvec3 from_corner;
    for (int axis = 0; axis < 3; ++axis)
      from_corner[axis] = unit_ * (static_cast<double>(position.at[axis] & in_voxel) + 0.5);
    for (size_t variable = 0; variable < variables_; ++variable)
      values_[variable] = brick.variables[variable][n];
    SplatCodes codes;
    if (!brick.border_codes.empty()) codes.border = brick.border_codes[n];
    if (!brick.growth_codes.empty()) codes.growth = brick.growth_codes[n];
    voxels_.add(voxelOf(position), from_corner, brick.splats[n], values_, codes);
  }
}

MergedOctant OctantMerger::finish() {
  MergedOctant merged;
  merged.splats.cell = child_;
  merged.splats.variables.resize(variables_);
  const auto last_in_voxel = static_cast<double>((uint64_t{1} << shift_) - 1);
  for (size_t voxel = 0; voxel < kOctantVoxels; ++voxel) {
    if (voxels_.count(voxel) == 0) continue;
    Splat splat;
    const SplatCodes codes = voxels_.finish(voxel, splat, values_);
    merged.detail = voxels_.detail(voxel, merged.detail);
    // The centre of a cluster lies among its members, thus in the voxel; rounding must not take it out.
    RootPosition position = voxelCorner(voxel);
    for (int axis = 0; axis < 3; ++axis)
      position.at[axis] +=
          static_cast<uint64_t>(std::clamp(splat.position[axis] / unit_, 0.0, last_in_voxel));
    merged.splats.positions.push_back(position);
    merged.splats.splats.push_back(splat);
    merged.splats.border_codes.push_back(codes.border);
    merged.splats.growth_codes.push_back(codes.growth);
    for (size_t variable = 0; variable < variables_; ++variable)
      merged.splats.variables[variable].push_back(values_[variable]);
  }
  return merged;
}

std::vector<std::vector<SplatScalar>> OctantMerger::finishValues() {
  std::vector<std::vector<SplatScalar>> merged(variables_);
  for (size_t voxel = 0; voxel < kOctantVoxels; ++voxel) {
    if (voxels_.count(voxel) == 0) continue;
    voxels_.finishValues(voxel, values_);
    for (size_t variable = 0; variable < variables_; ++variable)
      merged[variable].push_back(values_[variable]);
  }
  return merged;
}

BrickSplats joinOctants(const Cell& cell, size_t variables, std::array<MergedOctant, 8>&& octants) {
  BrickSplats brick;
  brick.cell = cell;
  brick.variables.resize(variables);
  size_t size = 0;
  for (const MergedOctant& octant : octants) size += octant.splats.size();
  brick.positions.reserve(size);
  brick.splats.reserve(size);
  brick.border_codes.reserve(size);
  brick.growth_codes.reserve(size);
  for (auto& values : brick.variables) values.reserve(size);
  for (MergedOctant& octant : octants) {
    const BrickSplats from = std::exchange(octant.splats, {});
    brick.positions.insert(brick.positions.end(), from.positions.begin(), from.positions.end());
    brick.splats.insert(brick.splats.end(), from.splats.begin(), from.splats.end());
    brick.border_codes.insert(brick.border_codes.end(), from.border_codes.begin(), from.border_codes.end());
    brick.growth_codes.insert(brick.growth_codes.end(), from.growth_codes.begin(), from.growth_codes.end());
    for (size_t variable = 0; variable < from.variables.size(); ++variable)
      brick.variables[variable].insert(brick.variables[variable].end(), from.variables[variable].begin(),
                                       from.variables[variable].end());
  }
  return brick;
}

std::vector<ValueCoding> codingsOfMerged(std::vector<ValueCoding> codings) {
  for (ValueCoding& coding : codings)
    if (coding.precision == ValuePrecision::kFine) coding = {};
  return codings;
}

BuiltCell buildFromChildren(const RootCube& root, const std::vector<ValueCoding>& codings, const Cell& cell,
                            const std::array<ChildBricks, 8>& children) {
  const size_t variables = codings.size();
  std::array<MergedOctant, 8> octants;
  tbb::enumerable_thread_specific<OctantMerger> mergers([&] { return OctantMerger(root, variables); });
  // This loop has a context of its own: otherwise it would end early, with children missing, if a loop around
  // it is cancelled.
  tbb::task_group_context own(tbb::task_group_context::isolated);
  parallelFor(
      size_t{0}, size_t{8},
      [&](size_t octant) {
        const ChildBricks& child = children[octant];
        if (child.bricks == 0) return;
        const TraceScope trace("merge octant");
        OctantMerger& merger = mergers.local();
        merger.begin(child.cell);
        for (uint64_t n = 0; n < child.bricks; ++n) merger.add(child.read(n));
        octants[octant] = merger.finish();
      },
      own);
  const TraceScope trace("build parent");
  BuiltCell built;
  for (size_t octant = 0; octant < 8; ++octant)
    if (!octants[octant].splats.positions.empty())
      built.error = std::max({built.error, children[octant].error, octants[octant].detail});
  BrickSplats brick = joinOctants(cell, variables, std::move(octants));
  built.bricks.push_back(
      {encodeBrick(root, brick, codingsOfMerged(codings)), static_cast<float>(built.error), false});
  built.own_bricks = 1;
  return built;
}

}  // namespace curvisplat
