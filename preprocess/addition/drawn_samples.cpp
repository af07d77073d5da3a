#include "preprocess/addition/drawn_samples.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <optional>

#include "preprocess/addition/value_buckets.h"
#include "preprocess/convert/bucket_file.h"
#include "preprocess/convert/scatter.h"
#include "preprocess/gather/mesh_reader.h"
#include "preprocess/grid/node_reader.h"
#include "preprocess/seams/seams.h"
#include "stream/base/checksum.h"
#include "stream/base/error.h"
#include "stream/base/file.h"
#include "stream/cache/cache_index.h"
#include "stream/cache/manifest.h"
#include "stream/model/thin_walls.h"

namespace curvisplat {
namespace {

struct RunRecord {
  uint64_t first, count;
};

/// Nodes of a bucket: their bits take this many bytes, or more where that would make too many buckets.
constexpr uint64_t kBucketBytes = 4 << 20;
constexpr size_t kPieceBytes = 64 << 10;

}  // namespace

DrawnNodes::DrawnNodes(const CacheReader& cache, const MemoryPlan& plan,
                       const std::filesystem::path& temporary_folder, Progress& progress)
    : written_(temporary_folder / "drawn.bin"), bits_(written_.path()) {
  const Manifest& manifest = cache.manifest();
  uint64_t nodes = 0;  // of the blocks, also where splats stand for cells
  for (const BlockInfo& block : manifest.blocks) nodes += block.ni * block.nj * block.nk;
  const uint64_t bytes = (nodes + 7) / 8;
  const uint64_t bucket_bytes = std::max(kBucketBytes, bytes / plan.most_buckets + 1);
  const uint64_t bucket_nodes = 8 * bucket_bytes;
  const auto buckets = static_cast<uint32_t>((bytes + bucket_bytes - 1) / bucket_bytes);
  BucketFile runs_file(temporary_folder / "runs.bin", buckets, plan.chunkBytes(buckets));

  const NodeNumbers numbers(manifest.blocks);
  SplatGeometry geometry;
  std::vector<NodeRun> runs;
  for (uint32_t brick = 0; brick < cache.bricks().size(); ++brick) {
    progress.advance(1);
    if (!cache.bricks()[brick].isLeaf()) continue;
    cache.readGeometry(brick, geometry, &runs);
    for (const NodeRun& run : runs) {
      RunRecord record{numbers.firstOf(run), run.count};
      while (record.count > 0) {
        const uint64_t bucket = record.first / bucket_nodes;
        const RunRecord part{record.first,
                             std::min(record.count, (bucket + 1) * bucket_nodes - record.first)};
        runs_file.append(static_cast<uint32_t>(bucket), std::as_bytes(std::span(&part, 1)));
        record = {part.first + part.count, record.count - part.count};
      }
    }
  }
  runs_file.close();

  std::vector<uint8_t> bits;
  for (uint32_t bucket = 0; bucket < buckets; ++bucket) {
    bits.assign(std::min(bucket_bytes, bytes - bucket * bucket_bytes), 0);
    runs_file.forEachChunk(bucket, [&](std::span<const std::byte> chunk) {
      for (size_t at = 0; at < chunk.size(); at += sizeof(RunRecord)) {
        RunRecord record;
        std::memcpy(&record, &chunk[at], sizeof record);
        for (uint64_t n = 0; n < record.count; ++n) {
          const uint64_t bit = record.first + n - bucket * bucket_nodes;
          bits[bit / 8] |= static_cast<uint8_t>(1u << (bit % 8));
        }
      }
    });
    written_.append(std::span<const uint8_t>(bits));
  }
}

DrawnNodes::~DrawnNodes() {
  removeFileIfThere(written_.path());
}

bool DrawnNodes::holds(uint64_t node) const {
  uint8_t bits = 0;
  bits_.readAt(node / 8, std::span(&bits, 1));
  return (bits >> (node % 8) & 1) != 0;
}

void DrawnNodes::add(uint64_t node) {
  uint8_t bits = 0;
  bits_.readAt(node / 8, std::span(&bits, 1));
  bits |= static_cast<uint8_t>(1u << (node % 8));
  written_.writeAt(node / 8, std::as_bytes(std::span(&bits, 1)));
}

void DrawnNodes::blankOthers(uint64_t first, std::span<uint8_t> blank) const {
  std::vector<uint8_t> bits;
  for (size_t done = 0; done < blank.size();) {
    const uint64_t begin = first + done;
    const size_t count = std::min<size_t>(blank.size() - done, 8 * kPieceBytes);
    bits.resize((begin + count + 7) / 8 - begin / 8);
    bits_.readAt(begin / 8, std::span(bits));
    for (size_t n = 0; n < count; ++n) {
      const size_t bit = begin % 8 + n;
      blank[done + n] |= ~bits[bit / 8] >> (bit % 8) & 1;
    }
    done += count;
  }
}

namespace {

/// Discards splats.
class NoSink : public SplatSink {
 public:
  void add(const NodeSplat&, std::span<const SplatScalar>) override {}
};

}  // namespace

SplatRules rulesOf(const Manifest& manifest) {
  SplatRules rules;
  rules.steep = manifest.isSteep();
  rules.octants = manifest.hasFeature(kCellOctants);
  rules.dual_cells = manifest.hasDualCells();
  rules.widths = manifest.stretch == kCellWidths;
  return rules;
}

UnlikeHalves unlikeHalvesOf(const Manifest& manifest) {
  const bool first_version = manifest.requirements.empty();
  if (first_version) return UnlikeHalves::kMerged;
  return manifest.hasDualCells() ? UnlikeHalves::kApart : UnlikeHalves::kApartInCells;
}

ThinWalls thinWallsOf(const CacheReader& cache) {
  const Manifest& manifest = cache.manifest();
  if (!manifest.hasFeature(kThinWalls)) return {};
  const auto bytes = readListed(cache.path(), kThinWallsFileName, manifest, kMaxThinWallsBytes);
  std::vector<GridBlock> blocks;
  for (const BlockInfo& block : manifest.blocks) blocks.push_back({block.name, block.ni, block.nj, block.nk});
  return ThinWalls::read(bytes, blocks, (cache.path() / kThinWallsFileName).string());
}

CacheGrid::CacheGrid(const GridSource& source) : ForwardingGrid(source) {
  uint64_t node = 0;
  for (const GridBlock& block : source.description().blocks) {
    first_nodes_.push_back(node);
    node += block.nodes();
  }
}

void CacheGrid::restrictTo(const CacheReader& cache, const MemoryPlan& plan,
                           const std::filesystem::path& temporary_folder, Progress& progress) {
  rules_ = rulesOf(cache.manifest());
  walls_ = thinWallsOf(cache);
  drawn_ = std::make_unique<DrawnNodes>(cache, plan, temporary_folder, progress);
}

void CacheGrid::addMergedFaces(const MemoryPlan& plan, UnlikeHalves unlike,
                               const std::filesystem::path& temporary_folder, Progress& progress) {
  all_faces_ = true;
  SeamMerger seams(0, plan.seam_bytes, temporary_folder, unlike);
  seams.keepApart(walls_);
  NoSink none;
  SlabPass pass(progress);
  pass.rules = rules_;
  streamSplats(
      NodeReader(*this, {}, std::nullopt), nullptr, plan.slab_bytes, [&]() -> SplatSink& { return none; },
      seams, pass);
  // The splat of a set has the number of the lowest node in it that is drawn.
  seams.forEachSet(description().coordinate_bytes, [&](std::span<const uint64_t> nodes) {
    bool merges = false;
    for (const uint64_t node : nodes) {
      const bool is_drawn = drawn_->holds(node);
      if (merges && !is_drawn) drawn_->add(node);
      merges |= is_drawn;
    }
  });
  all_faces_ = false;
}

void CacheGrid::read(uint32_t block, const NodeBox& box, std::span<const uint32_t> scalars,
                     NodeArrays& out) const {
  ForwardingGrid::read(block, box, scalars, out);
  for (size_t n = 0; n < out.x.size(); ++n)
    out.blank[n] |= !(std::isfinite(out.x[n]) && std::isfinite(out.y[n]) && std::isfinite(out.z[n]));
  if (!drawn_) return;
  const bool cells = !scalars.empty() && description().scalars[scalars.front()].centring == Centring::kCell;
  if (!cells) {
    restrict(block, box, out.blank);
    return;
  }
  std::vector<uint8_t> no_cell(out.blank.size(), 0);
  restrict(block, box, no_cell);
  for (std::vector<float>& values : out.scalars)
    for (size_t n = 0; n < values.size(); ++n)
      if (no_cell[n]) values[n] = std::numeric_limits<float>::quiet_NaN();
}

void CacheGrid::restrict(uint32_t block_number, const NodeBox& box, std::vector<uint8_t>& blank) const {
  const GridBlock& block = description().blocks[block_number];
  const uint64_t end = box.endOfRow(block.ni), row_nodes = end - box.i0;
  const uint64_t inner_begin = std::max<uint64_t>(1, box.i0), inner_end = std::min(end, block.ni - 1);
  size_t at = 0;
  for (uint64_t k = box.k0; k < box.k1; ++k) {
    for (uint64_t j = box.j0; j < box.j1; ++j, at += row_nodes) {
      const std::span<uint8_t> row(&blank[at], row_nodes);
      const uint64_t first = first_nodes_[block_number] + (k * block.nj + j) * block.ni;
      const bool on_face = j == 0 || j + 1 == block.nj || k == 0 || k + 1 == block.nk;
      if (!all_faces_)
        drawn_->blankOthers(first + box.i0, row);
      else if (!on_face && inner_begin < inner_end)
        drawn_->blankOthers(first + inner_begin, row.subspan(inner_begin - box.i0, inner_end - inner_begin));
    }
  }
}

DrawnMesh::DrawnMesh(const MeshSource& source) : ForwardingMesh(source) {
  uint64_t points = 0, cells = 0;
  for (const MeshPiece& piece : source.description().pieces) {
    first_points_.push_back(points);
    first_cells_.push_back(cells);
    points += piece.points;
    cells += piece.cells;
  }
}

void DrawnMesh::restrictTo(const CacheReader& cache, const MemoryPlan& plan,
                           const std::filesystem::path& temporary_folder, Progress& progress) {
  of_cells_ = cache.manifest().cells;
  const MeshReader reader(this->source(), {}, std::nullopt);
  numbers_ = std::make_unique<PointNumbers>(reader, plan.mesh_bytes / 2, temporary_folder, progress);
  drawn_ = std::make_unique<DrawnNodes>(cache, plan, temporary_folder, progress);
}

void DrawnMesh::readPoints(uint32_t piece, uint64_t first, uint64_t count, std::span<const uint32_t> scalars,
                           MeshPoints& out) const {
  ForwardingMesh::readPoints(piece, first, count, scalars, out);
  if (!drawn_ || of_cells_) return;
  std::vector<uint8_t> missing(count, 0);
  drawn_->blankOthers(first_points_[piece] + first, missing);
  if (numbers_->merged() > 0) {
    std::vector<uint64_t> numbers(count);
    numbers_->read(first_points_[piece] + first, numbers);
    for (size_t n = 0; n < count; ++n)
      if (missing[n]) missing[n] = !drawn_->holds(numbers[n]);
  }
  for (size_t n = 0; n < count; ++n) out.hidden[n] |= missing[n];
}

void DrawnMesh::readCells(uint32_t piece, uint64_t first, uint64_t count, std::span<const uint32_t> scalars,
                          MeshCells& out) const {
  ForwardingMesh::readCells(piece, first, count, scalars, out);
  if (drawn_ && of_cells_) drawn_->blankOthers(first_cells_[piece] + first, out.hidden);
}

}  // namespace curvisplat
