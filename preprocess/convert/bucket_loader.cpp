#include "preprocess/convert/bucket_loader.h"

#include <algorithm>
#include <numeric>

#include "preprocess/convert/splat_record.h"
#include "stream/base/freed_memory.h"
#include "stream/model/brick.h"

namespace curvisplat {
namespace {

/// Finds the unit of one record after the other; neighbours are mostly in the same leaf.
class UnitFinder {
 public:
  explicit UnitFinder(const BucketTree& tree) : tree_(&tree) {}
  uint32_t unitOf(const RootPosition& position) {
    if (unit_ == BucketTree::kNone || !(*tree_)[unit_].cell.contains(position))
      unit_ = buildUnitOf(*tree_, tree_->leafOf(position));
    return unit_;
  }
  uint32_t unit() const { return unit_; }

 private:
  const BucketTree* tree_;
  uint32_t unit_ = BucketTree::kNone;
};

/// The first cell of kMaxLevel in `cell`: disjoint cells of any levels compare as these do.
Cell firstDeepest(const Cell& cell) {
  Cell deepest{static_cast<uint32_t>(kMaxLevel), {}};
  for (int axis = 0; axis < 3; ++axis) deepest.at[axis] = cell.at[axis] << (kMaxLevel - cell.level);
  return deepest;
}

}  // namespace

uint32_t buildUnitOf(const BucketTree& tree, uint32_t leaf) {
  uint32_t unit = leaf;
  for (uint32_t above = tree[leaf].parent; above != BucketTree::kNone; above = tree[above].parent) {
    const CellContents& contents = tree[above].contents;
    if (contents.splats > kMaxBrickSplats && !contents.coincide()) break;
    unit = above;
  }
  return unit;
}

BucketLoader::BucketLoader(const BucketTree& tree, const BucketFile& file, size_t variables,
                           const BucketRange& range, uint64_t most_bytes)
    : tree_(&tree),
      file_(&file),
      variables_(variables),
      position_(range.first),
      end_(range.end),
      most_bytes_(most_bytes),
      ahead_([this](LoadedBucket& loaded) { return fill(loaded); }) {}

bool BucketLoader::fill(LoadedBucket& loaded) {
  while (position_ < end_ && file_->bytes(position_) == 0) ++position_;
  if (position_ == end_ || ended_) return false;
  loaded.bucket = position_++;
  loaded.too_large = ended_ = file_->bytes(loaded.bucket) > most_bytes_;
  loaded.parts.clear();
  if (loaded.too_large) return true;
  file_->read(loaded.bucket, loaded.bytes);
  group(loaded);
  return true;
}

void BucketLoader::group(LoadedBucket& loaded) {
  // Looks at each record once: its part and its length are all that placing it takes.
  UnitFinder finder(*tree_);
  std::vector<LoadedBucket::Part>& parts = loaded.parts;
  std::vector<uint32_t> part_of(tree_->size(), BucketTree::kNone);
  tags_.clear();
  const size_t most = loaded.bytes.size() / regularRecordBytes(variables_);
  if (tags_.capacity() < most) {
    freeMemory(tags_);
    tags_.reserve(most);  // growing would hold the old and the new
  }
  for (size_t at = 0; at < loaded.bytes.size();) {
    const std::byte* record = &loaded.bytes[at];
    uint32_t& part = part_of[finder.unitOf(recordPosition(record))];
    if (part == BucketTree::kNone) {
      part = static_cast<uint32_t>(parts.size());
      parts.push_back({finder.unit(), 0, 0});
    }
    ++parts[part].count;
    const bool irregular = recordIsIrregular(record);
    tags_.push_back(2 * part + irregular);
    at += irregular ? irregularRecordBytes(variables_) : regularRecordBytes(variables_);
  }

  std::vector<uint32_t> in_order(parts.size());
  std::iota(in_order.begin(), in_order.end(), 0u);
  std::sort(in_order.begin(), in_order.end(), [&](uint32_t a, uint32_t b) {
    return mortonLess(firstDeepest((*tree_)[parts[a].unit].cell), firstDeepest((*tree_)[parts[b].unit].cell));
  });
  std::vector<size_t> next(parts.size());
  size_t begin = 0;
  for (const uint32_t part : in_order) {
    parts[part].begin = next[part] = begin;
    begin += parts[part].count;
  }
  if (loaded.places.capacity() < tags_.size()) freeMemory(loaded.places);
  loaded.places.resize(tags_.size());
  size_t at = 0;
  for (const uint32_t tag : tags_) {
    loaded.places[next[tag / 2]++] = static_cast<uint32_t>(at);
    at += tag % 2 ? irregularRecordBytes(variables_) : regularRecordBytes(variables_);
  }
  std::sort(parts.begin(), parts.end(), [](const auto& a, const auto& b) { return a.begin < b.begin; });
}

}  // namespace curvisplat
