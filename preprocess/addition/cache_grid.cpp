#include "preprocess/addition/cache_grid.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "preprocess/convert/scatter.h"
#include "preprocess/grid/node_reader.h"
#include "preprocess/splats/seams.h"
#include "stream/cache/cell_octants.h"

namespace curvisplat {
namespace {

/// Discards splats.
class NoSink : public SplatSink {
 public:
  void add(const NodeSplat&, std::span<const SplatScalar>) override {}
};

}  // namespace

UnlikeHalves unlikeHalvesOf(const Manifest& manifest) {
  const bool first_version = manifest.requirements.empty();
  return first_version ? UnlikeHalves::kMerged : UnlikeHalves::kApart;
}

CacheGrid::CacheGrid(const GridSource& source) : source_(&source) {
  uint64_t node = 0;
  for (const GridBlock& block : source.description().blocks) {
    first_nodes_.push_back(node);
    node += block.nodes();
  }
}

void CacheGrid::restrictTo(const CacheReader& cache, const MemoryPlan& plan,
                           const std::filesystem::path& temporary_folder, Progress& progress) {
  is_steep_ = cache.manifest().stretch == kSteepStretch;
  cuts_octants_ = cache.manifest().hasFeature(kCellOctants);
  drawn_ = std::make_unique<DrawnNodes>(cache, plan, temporary_folder, progress);
}

void CacheGrid::addMergedFaces(const MemoryPlan& plan, UnlikeHalves unlike,
                               const std::filesystem::path& temporary_folder, Progress& progress) {
  all_faces_ = true;
  SeamMerger seams(0, plan.seam_bytes, temporary_folder, unlike);
  NoSink none;
  SlabPass pass(progress);
  pass.steep = is_steep_;
  pass.octants = cuts_octants_;
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
  source_->read(block, box, scalars, out);
  blankOthers(block, box, scalars, out);
}

void CacheGrid::readPartOfRows(uint32_t block, const NodeBox& box, std::span<const uint32_t> scalars,
                               NodeArrays& out) const {
  source_->readPartOfRows(block, box, scalars, out);
  blankOthers(block, box, scalars, out);
}

/// Blanks what has no splat in the cache.
void CacheGrid::blankOthers(uint32_t block, const NodeBox& box, std::span<const uint32_t> scalars,
                            NodeArrays& out) const {
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

}  // namespace curvisplat
