#include "preprocess/addition/value_buckets.h"

#include <algorithm>
#include <bit>
#include <memory>
#include <utility>

#include "preprocess/convert/build_cell.h"
#include "stream/base/error.h"
#include "stream/base/memory.h"

namespace curvisplat {

NodeNumbers::NodeNumbers(const std::vector<BlockInfo>& blocks) : blocks_(blocks) {
  uint64_t node = 0;
  for (const BlockInfo& block : blocks) {
    first_nodes_.push_back(node);
    node += block.ni * block.nj * block.nk;
  }
}

uint64_t NodeNumbers::firstOf(const NodeRun& run) const {
  const bool inside = run.block < blocks_.size() && run.count <= blocks_[run.block].ni &&
                      run.i <= blocks_[run.block].ni - run.count && run.j < blocks_[run.block].nj &&
                      run.k < blocks_[run.block].nk;
  if (!inside)
    throw Error("{} nodes from block {}, {} {} {} are not in the grid; the cache is damaged: convert again",
                run.count, run.block + uint64_t{1}, run.i, run.j, run.k);
  const BlockInfo& block = blocks_[run.block];
  return first_nodes_[run.block] + (run.k * block.nj + run.j) * block.ni + run.i;
}

std::string NodeNumbers::nameOf(uint64_t node) const {
  const auto after = std::upper_bound(first_nodes_.begin(), first_nodes_.end(), node);
  const auto number = static_cast<size_t>(after - first_nodes_.begin() - 1);
  const BlockInfo& block = blocks_[number];
  const uint64_t in_block = node - first_nodes_[number];
  return fmt::format("node {} {} {} of block {}", in_block % block.ni, in_block / block.ni % block.nj,
                     in_block / block.ni / block.nj, number + 1);
}

ConversionOrder::ConversionOrder(const CacheReader& cache)
    : bricks_(cache.bricks()), positions_(bricks_.size()) {
  order_.reserve(bricks_.size());
  for (uint32_t root = 0; root < bricks_.size() && bricks_[root].cell.level == 0; ++root) append(root);
  CURVISPLAT_CHECK_OP(order_.size(), ==, bricks_.size());

  const NodeNumbers numbers(cache.manifest().blocks);
  SplatGeometry geometry;
  std::vector<NodeRun> runs;
  for (uint32_t brick = 0; brick < bricks_.size(); ++brick) {
    if (!sharesItsCell(brick)) continue;
    cache.readGeometry(brick, geometry, &runs);
    if (runs.empty()) throw Error("{}: brick {} is a leaf without nodes", cache.path().string(), brick);
    first_nodes_[brick] = numbers.firstOf(runs.front());
  }
}

void ConversionOrder::append(uint32_t brick) {
  const Brick& of = bricks_[brick];
  for (uint32_t n = 0; n < of.child_count; ++n) append(of.first_child + n);
  positions_[brick] = static_cast<uint32_t>(order_.size());
  order_.push_back(brick);
}

bool ConversionOrder::sharesItsCell(uint32_t brick) const {
  const Cell& cell = bricks_[brick].cell;
  return (brick > 0 && bricks_[brick - 1].cell == cell) ||
         (brick + 1 < bricks_.size() && bricks_[brick + 1].cell == cell);
}

uint32_t ConversionOrder::leafOf(const RootPosition& position, uint64_t node) const {
  uint32_t brick = 0;
  while (!bricks_[brick].isLeaf()) {
    const Brick& above = bricks_[brick];
    const Cell cell = above.cell.child(octantOf(position, above.cell));
    uint32_t child = above.first_child;
    const uint32_t end = above.first_child + above.child_count;
    while (child < end && !(bricks_[child].cell == cell)) ++child;
    if (child == end) return kNoBrick;
    brick = child;
  }
  // The last of the cell's bricks that does not begin after the node.
  while (brick + 1 < bricks_.size() && bricks_[brick + 1].cell == bricks_[brick].cell &&
         first_nodes_.at(brick + 1) <= node)
    ++brick;
  return brick;
}

std::array<uint32_t, 3> axisCodes(const Splat& splat) {
  // A float's exponent and the highest three bits of its fraction, from 2^-64 on.
  constexpr int kFractionBits = 23 - 3, kLeast = (127 - 64) << 3, kMost = (1 << kPlaceBits) - 1;
  std::array<uint32_t, 3> codes;
  for (size_t axis = 0; axis < codes.size(); ++axis) {
    const auto bits = std::bit_cast<uint32_t>(recordFloat(splat.axis[axis]));
    codes[axis] =
        static_cast<uint32_t>(std::clamp(static_cast<int>(bits >> kFractionBits) - kLeast, 0, kMost));
  }
  return codes;
}

void packValueRecord(uint64_t node, uint32_t brick, const RecordedSplat& splat,
                     std::span<const SplatScalar> values, std::vector<std::byte>& out) {
  CURVISPLAT_CHECK_OP(node, <, kMaxNodes);
  const bool varied = std::any_of(values.begin(), values.end(),
                                  [](const SplatScalar& value) { return recordFloat(value.variance) != 0; });
  const size_t begin = out.size();
  out.resize(begin + (varied ? maxValueRecordBytes(values.size()) : minValueRecordBytes(values.size())));
  std::byte* to = out.data() + begin;
  const auto put = [&to](const auto& number, size_t bytes) {
    std::memcpy(to, &number, bytes);
    to += bytes;
  };
  put(node | uint64_t{varied} << 47, 6);
  put(brick, sizeof brick);
  for (const std::array<uint32_t, 3>& codes : {splat.place, splat.axes}) {
    const uint32_t bits = codes[0] | codes[1] << kPlaceBits | codes[2] << (2 * kPlaceBits);
    put(bits, sizeof bits);
  }
  for (const SplatScalar& value : values) {
    const float numbers[] = {recordFloat(value.mean), recordFloat(value.slope.x), recordFloat(value.slope.y),
                             recordFloat(value.slope.z)};
    put(numbers, sizeof numbers);
  }
  if (!varied) return;
  for (const SplatScalar& value : values) {
    const float variance = recordFloat(value.variance);
    put(variance, sizeof variance);
  }
}

void unpackValueRecord(const std::byte* record, std::span<SplatScalar> values) {
  const std::byte* at = record + minValueRecordBytes(0);
  const auto take = [&at] {
    float single;
    std::memcpy(&single, at, sizeof single);
    at += sizeof single;
    return static_cast<double>(single);
  };
  for (SplatScalar& value : values) {
    value.mean = take();
    for (int axis = 0; axis < 3; ++axis) value.slope[axis] = take();
    value.variance = 0;
  }
  if (!recordIsIrregular(record)) return;
  for (SplatScalar& value : values) value.variance = take();
}

namespace {

constexpr size_t kGatheredBytes = 32 << 10;

/// Memory for a brick of a bucket while it is built: its records and their places, its geometry, its encoded
/// values, and the values merged from it for its parent.
uint64_t bytesToBuild(const Brick& brick, size_t variables) {
  const uint64_t splats = brick.splats;
  const uint64_t merged =
      std::min(splats, uint64_t{1} << (3 * (kLatticeBits - 1))) * sizeof(SplatScalar) * variables;
  const uint64_t records = brick.isLeaf() ? splats * (maxValueRecordBytes(variables) + sizeof(uint32_t)) : 0;
  return records + brick.geometry.length + splats * 10 * variables + merged;
}

}  // namespace

ValueBuckets::ValueBuckets(std::span<const Brick> bricks, const ConversionOrder& order, size_t variables,
                           uint64_t most_bytes)
    : begins_{0} {
  uint64_t bytes = 0;
  for (uint32_t position = 0; position < order.size(); ++position) {
    const uint64_t of_brick = bytesToBuild(bricks[order[position]], variables);
    if (position > begins_.back() && bytes + of_brick > most_bytes) {
      begins_.push_back(position);
      bytes = 0;
    }
    bytes += of_brick;
  }
  begins_.push_back(static_cast<uint32_t>(order.size()));
}

uint32_t ValueBuckets::of(uint32_t position) const {
  const auto after = std::upper_bound(begins_.begin(), begins_.end(), position);
  return static_cast<uint32_t>(after - begins_.begin() - 1);
}

ValueSink::ValueSink(const CacheReader& cache, const ConversionOrder& order, const ValueBuckets& buckets,
                     uint32_t grouped, BucketFile& file, ValueSample& sample)
    : cache_(&cache), order_(&order), buckets_(&buckets), grouped_(grouped), file_(&file), sample_(sample) {}

void ValueSink::add(const NodeSplat& splat, std::span<const SplatScalar> values) {
  const RootPosition position = cache_->manifest().root.fromWorld(splat.splat.position);
  if (leaf_ == kNoBrick || leaf_shares_ || !cache_->bricks()[leaf_].cell.contains(position)) {
    const uint32_t leaf = order_->leafOf(position, splat.node);
    if (leaf == kNoBrick)
      throw Error("{}: has no splat at {} of the grid; this grid is not the one the cache was made from",
                  cache_->path().string(), NodeNumbers(cache_->manifest().blocks).nameOf(splat.node));
    const uint32_t number = buckets_->of(order_->positionOf(leaf)) / grouped_;
    if (number != number_) flush();
    number_ = number;
    leaf_ = leaf;
    leaf_shares_ = order_->sharesItsCell(leaf);
  }
  if (gathered_.size() + maxValueRecordBytes(values.size()) > kGatheredBytes) flush();
  packValueRecord(splat.node, order_->positionOf(leaf_),
                  {placeInCell(position, cache_->bricks()[leaf_].cell), axisCodes(splat.splat)}, values,
                  gathered_);
  sample_.add(splat.node, splat.splat.weight, values);
}

void ValueSink::flush() {
  if (!gathered_.empty()) file_->append(number_, gathered_);
  gathered_.clear();
  sample_.flush();
}

ValueLoader::ValueLoader(const CacheReader& cache, const ConversionOrder& order, const ValueBuckets& buckets,
                         size_t variables, const MemoryPlan& plan, std::filesystem::path temporary_folder)
    : cache_(&cache),
      order_(&order),
      buckets_(&buckets),
      variables_(variables),
      plan_(plan),
      temporary_folder_(std::move(temporary_folder)),
      geometry_(cache.path() / cache.manifest().steps.front().geometry) {}

void ValueLoader::forEach(const BucketFile& file, uint32_t begin, uint32_t end, uint32_t grouped,
                          const std::function<void(LoadedValues&)>& use) {
  if (grouped > 1) {
    for (uint32_t first = begin; first < end; first += grouped)
      divide(file, (first - begin) / grouped, first, std::min(end, first + grouped), use);
    return;
  }
  uint32_t next = begin;
  ReadAhead<LoadedValues> ahead([&](LoadedValues& loaded) {
    if (next == end) return false;
    load(file, next - begin, next, loaded);
    ++next;
    return true;
  });
  while (LoadedValues* loaded = ahead.next()) use(*loaded);
}

void ValueLoader::divide(const BucketFile& file, uint32_t number, uint32_t begin, uint32_t end,
                         const std::function<void(LoadedValues&)>& use) {
  const uint32_t grouped = grouping(end - begin, plan_);
  const uint32_t numbers = (end - begin + grouped - 1) / grouped;
  const auto path = temporary_folder_ / fmt::format("divided{}.bin", files_made_++);
  BucketFile divided(path, numbers, plan_.chunkBytes(numbers));
  file.forEachChunk(number, [&](std::span<const std::byte> chunk) {
    // Records of one number mostly follow one another.
    size_t first = 0, at = 0;
    uint32_t to = 0;
    const auto send = [&] {
      if (at > first) divided.append(to, chunk.subspan(first, at - first));
      first = at;
    };
    while (at < chunk.size()) {
      const uint32_t here = (buckets_->of(valueRecordBrick(&chunk[at])) - begin) / grouped;
      if (here != to || at - first > kGatheredBytes) send();
      to = here;
      at += valueRecordBytes(&chunk[at], variables_);
    }
    send();
  });
  divided.close();
  forEach(divided, begin, end, grouped, use);
}

void ValueLoader::load(const BucketFile& file, uint32_t number, uint32_t bucket, LoadedValues& out) const {
  out.bucket = bucket;
  out.first = buckets_->begin(bucket);
  const uint32_t bricks = buckets_->end(bucket) - out.first;

  uint64_t splats = 0;
  for (uint32_t n = 0; n < bricks; ++n)
    if (cache_->bricks()[(*order_)[out.first + n]].isLeaf())
      splats += cache_->bricks()[(*order_)[out.first + n]].splats;
  if (file.bytes(number) > splats * maxValueRecordBytes(variables_))
    throw Error(
        "{}: {} of its bricks hold {} splats, but the grid has more samples there; this grid is not the one "
        "the cache was made from",
        cache_->path().string(), bricks, splats);
  file.read(number, out.bytes);
  std::vector<size_t> next(bricks + 1);
  for (size_t at = 0; at < out.bytes.size(); at += valueRecordBytes(&out.bytes[at], variables_))
    ++next[valueRecordBrick(&out.bytes[at]) - out.first + 1];
  for (uint32_t n = 0; n < bricks; ++n) next[n + 1] += next[n];
  out.begins = next;
  if (out.places.capacity() < next.back()) freeMemory(out.places);
  out.places.resize(next.back());
  for (size_t at = 0; at < out.bytes.size(); at += valueRecordBytes(&out.bytes[at], variables_))
    out.places[next[valueRecordBrick(&out.bytes[at]) - out.first]++] = static_cast<uint32_t>(at);

  out.geometries.assign(1, 0);
  for (uint32_t n = 0; n < bricks; ++n)
    out.geometries.push_back(out.geometries.back() +
                             cache_->bricks()[(*order_)[out.first + n]].geometry.length);
  if (out.geometry.capacity() < out.geometries.back()) freeMemory(out.geometry);
  out.geometry.resize(out.geometries.back());
  for (uint32_t n = 0; n < bricks; ++n)
    geometry_.readAt(
        cache_->bricks()[(*order_)[out.first + n]].geometry.offset,
        std::span(out.geometry).subspan(out.geometries[n], out.geometries[n + 1] - out.geometries[n]));
}

}  // namespace curvisplat
