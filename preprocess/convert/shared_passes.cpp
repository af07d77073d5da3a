#include "preprocess/convert/shared_passes.h"

#include <algorithm>
#include <bit>
#include <utility>

#include "preprocess/splats/cell_splats.h"
#include "preprocess/splats/node_splats.h"

namespace curvisplat {
namespace {

/// Everything as 64 bits: five whole numbers, six of the box, two a scalar.
Ranks::Bytes pack(const GridSurvey& survey) {
  std::vector<uint64_t> words{survey.nodes, survey.blanked.by_grid, survey.blanked.by_value,
                              survey.blanked.not_finite, survey.grid_checksum};
  const auto put = [&](double number) { words.push_back(std::bit_cast<uint64_t>(number)); };
  for (int axis = 0; axis < 3; ++axis) put(survey.lower[axis]);
  for (int axis = 0; axis < 3; ++axis) put(survey.upper[axis]);
  for (const ScalarRange& range : survey.ranges) {
    put(range.min);
    put(range.max);
  }
  return toBytes(words);
}

GridSurvey unpackSurvey(const Ranks::Bytes& bytes) {
  const auto words = fromBytes<uint64_t>(bytes);
  size_t at = 5;
  const auto get = [&] { return std::bit_cast<double>(words[at++]); };
  GridSurvey survey;
  survey.nodes = words[0];
  survey.blanked = {words[1], words[2], words[3]};
  survey.grid_checksum = words[4];
  for (int axis = 0; axis < 3; ++axis) survey.lower[axis] = get();
  for (int axis = 0; axis < 3; ++axis) survey.upper[axis] = get();
  while (at < words.size()) {
    const double min = get();
    survey.ranges.push_back({min, get()});
  }
  return survey;
}

}  // namespace

uint64_t slabBytesOfRanks(const NodeReader& reader, uint64_t slab_bytes, const Ranks& ranks) {
  constexpr uint64_t kSlabsOfRank = 8;
  const std::vector<GridBlock>& blocks = reader.source().description().blocks;
  uint64_t nodes = 0;
  for (const GridBlock& block : blocks) nodes += block.nodes();
  const uint64_t share = nodes * slabBytesPerNode(reader.scalars()) / (kSlabsOfRank * ranks.count());
  const Halo halo = reader.centring() == Centring::kCell ? kCellSplatHalo : kNodeSplatHalo;
  return std::min(slab_bytes, std::max(share, leastSlabBytes(blocks, reader.scalars(), halo)));
}

MemoryPlan commonPlan(MemoryPlan plan, Ranks& ranks) {
  const std::vector<MemoryPlan> own{plan};
  Ranks::Bytes plans;
  for (const Ranks::Bytes& one : ranks.gather(toBytes(own)))
    plans.insert(plans.end(), one.begin(), one.end());
  for (const MemoryPlan& other : fromBytes<MemoryPlan>(ranks.broadcast(std::move(plans)))) {
    for (auto bytes : {&MemoryPlan::slab_bytes, &MemoryPlan::counting_bytes, &MemoryPlan::seam_bytes,
                       &MemoryPlan::owner_bytes, &MemoryPlan::mesh_bytes, &MemoryPlan::chunk_buffer_bytes,
                       &MemoryPlan::bucket_splats, &MemoryPlan::bucket_bytes})
      plan.*bytes = std::min(plan.*bytes, other.*bytes);
    plan.most_buckets = std::min(plan.most_buckets, other.most_buckets);
  }
  return plan;
}

GridSurvey combinedSurvey(const GridSurvey& share, Ranks& ranks) {
  GridSurvey whole = share;
  const std::vector<Ranks::Bytes> shares = ranks.gather(pack(share));
  for (size_t n = 1; n < shares.size(); ++n) whole = unitedSurvey(std::move(whole), unpackSurvey(shares[n]));
  return broadcastSurvey(whole, ranks);
}

GridSurvey broadcastSurvey(const GridSurvey& survey, Ranks& ranks) {
  return unpackSurvey(ranks.broadcast(pack(survey)));
}

void sendCountsToFirst(CountingGrid& counts, Ranks& ranks) {
  for (unsigned sender = 1; sender < ranks.count(); ++sender) {
    const bool sends = sender == ranks.rank();
    const std::vector<uint32_t> level{counts.level()};
    const std::vector<Ranks::Bytes> levels = ranks.gather(toBytes(level));
    const std::vector<Ranks::Bytes> runs = ranks.gather(sends ? toBytes(counts.takeRuns()) : Ranks::Bytes{});
    if (ranks.isFirst())
      counts.addCoarser(fromBytes<uint32_t>(levels[sender])[0], fromBytes<VoxelRun>(runs[sender]));
  }
}

BucketTree broadcastTree(const BucketTree& tree, Ranks& ranks) {
  return BucketTree::fromLinks(fromBytes<BucketTree::Link>(ranks.broadcast(toBytes(tree.links()))));
}

void sumContents(std::vector<CellContents>& contents, Ranks& ranks) {
  const std::vector<Ranks::Bytes> shares = ranks.gather(toBytes(contents));
  for (size_t n = 1; n < shares.size(); ++n) {
    const auto share = fromBytes<CellContents>(shares[n]);
    for (size_t node = 0; node < contents.size(); ++node) contents[node].add(share[node]);
  }
  contents = fromBytes<CellContents>(ranks.broadcast(toBytes(contents)));
}

std::vector<BucketChains> gatherChains(const BucketChains& chains, Ranks& ranks) {
  std::vector<uint64_t> words{chains.chunk_bytes, chains.size};
  for (const BucketChains::OfBucket& bucket : chains.chains) {
    words.insert(words.end(), bucket.last_chunks.begin(), bucket.last_chunks.end());
    words.push_back(bucket.bytes);
  }
  const std::vector<Ranks::Bytes> sent = ranks.gather(toBytes(words));
  std::vector<BucketChains> of_ranks;
  for (size_t n = 1; n < sent.size(); ++n) {
    const auto from = fromBytes<uint64_t>(sent[n]);
    BucketChains& one = of_ranks.emplace_back();
    one.chunk_bytes = from[0];
    one.size = from[1];
    for (size_t at = 2; at < from.size(); at += BucketChains::kCount + 1) {
      BucketChains::OfBucket& bucket = one.chains.emplace_back();
      std::copy_n(&from[at], BucketChains::kCount, bucket.last_chunks.begin());
      bucket.bytes = from[at + BucketChains::kCount];
    }
  }
  return of_ranks;
}

}  // namespace curvisplat
