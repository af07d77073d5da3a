#include "preprocess/addition/value_passes.h"

#include <tbb/enumerable_thread_specific.h>

#include <optional>
#include <utility>

#include "preprocess/addition/build_values.h"
#include "preprocess/addition/drawn_samples.h"
#include "preprocess/convert/sampled_scalars.h"
#include "preprocess/convert/scatter.h"
#include "preprocess/convert/shared_passes.h"
#include "preprocess/seams/wall_search.h"
#include "stream/base/file.h"
#include "stream/base/text.h"
#include "stream/cache/faces_file.h"
#include "stream/cache/manifest.h"

namespace curvisplat {

ValuePasses::ValuePasses(const CacheReader& cache, size_t variables, const MemoryPlan& plan,
                         std::filesystem::path scratch, Progress& progress)
    : cache_(&cache),
      variables_(variables),
      plan_(plan),
      scratch_(std::move(scratch)),
      progress_(&progress),
      shared_(scratch_),
      order_(cache),
      buckets_(cache.bricks(), order_, variables, plan.bucket_bytes),
      grouped_(ValueLoader::grouping(buckets_.size(), plan)),
      sample_(variables) {}

void ValuePasses::shareWith(Ranks& ranks, std::filesystem::path shared) {
  ranks_ = &ranks;
  shared_ = std::move(shared);
}

std::filesystem::path ValuePasses::fileOf(unsigned rank) const {
  return shared_ / fmt::format("values.{}.bin", rank);
}

void ValuePasses::openFile() {
  const uint32_t numbers = (buckets_.size() + grouped_ - 1) / grouped_;
  file_ = std::make_unique<BucketFile>(fileOf(ranks_->rank()), numbers, plan_.chunkBytes(numbers));
}

/// Joins the ranks' files: rank 0's file then has the records of all.
void ValuePasses::joinFiles() {
  const std::vector<BucketChains> others = gatherChains(file_->chains(), *ranks_);
  for (size_t n = 0; n < others.size(); ++n) file_->join(fileOf(static_cast<unsigned>(n + 1)), others[n]);
  if (ranks_->isFirst()) return;
  file_->leave();  // for rank 0
  file_.reset();
}

void ValuePasses::scatter(SplatOrigin& origin) {
  openFile();
  if (!ranks_->isFirst()) return;
  tbb::enumerable_thread_specific<ValueSink> sinks([this] { return newSink(); });
  const SinkOfThread sink_of_thread = [&]() -> SplatSink& { return sinks.local(); };
  origin.scatter(sink_of_thread, {}, *progress_);
  origin.finish(sink_of_thread, *progress_);
  for (ValueSink& sink : sinks) sink.flush();
}

void ValuePasses::scatter(const NodeReader& reader, std::function<void(const LoadedSlab&)> see) {
  openFile();
  seams_ = std::make_unique<SeamMerger>(variables_, plan_.seam_bytes, scratch_,
                                        unlikeHalvesOf(cache_->manifest()));
  reader_ = &reader;

  tbb::enumerable_thread_specific<ValueSink> sinks([this] { return newSink(); });
  std::optional<BlockOwners> owners;
  if (!overlaps_.empty()) owners.emplace(ownersReader(reader, true), overlaps_, plan_.owner_bytes);
  SlabPass pass(*progress_, std::move(see));
  pass.owners = owners ? &*owners : nullptr;
  pass.ranks = ranks_;
  pass.rules = rulesOf(cache_->manifest());
  pass.rules.growth_codes = false;
  streamSplats(
      reader, nullptr, plan_.slab_bytes, [&]() -> SplatSink& { return sinks.local(); }, *seams_, pass);
  for (ValueSink& sink : sinks) sink.flush();
}

void ValuePasses::mergeSeams() {
  if (seams_) seams_->sendToFirst(*ranks_);
  if (seams_ && ranks_->isFirst()) {
    const GridDescription& grid = reader_->source().description();
    const std::vector<GridBlock>& blocks = grid.blocks;
    const ThinWalls walls = thinWallsOf(*cache_);
    // The second step of a series tells.
    const std::vector<WallSide> of_values =
        cache_->series().steps.size() > 1
            ? std::vector<WallSide>{}
            : findThinWalls(*seams_, *reader_, {plan_.slab_bytes, scratch_}, *progress_).boxes;
    if (const uint64_t missing = countMissing(of_values, blocks, walls); missing > 0)
      warning_of_walls_ = fmt::format(
          "at {} of nodes on both sides of thin walls the values are means of both sides: the cache has one "
          "splat for each pair, since no values differed there when it was made, or an earlier program made "
          "it; convert the grid again, with values that differ in the first step",
          countText(missing, "pair"));
    seams_->keepApart(walls);
    tbb::enumerable_thread_specific<ValueSink> sinks([this] { return newSink(); });
    seams_->finishInParallel(grid.coordinate_bytes,
                             [&](const NodeSplat& splat, std::span<const SplatScalar> values) {
                               sinks.local().add(splat, values);
                               progress_->advance(1);
                             });
    for (ValueSink& sink : sinks) sink.flush();
  }
  seams_.reset();
  sample_.gatherFrom(*ranks_);
  file_->close(!ranks_->alone());
  joinFiles();
  if (file_) temporary_bytes_ = file_->size();
}

void ValuePasses::build(ValuesWriter& writer, const StepReferences* references) {
  const SampledScalars scalars(sample_, variables_, precisionOf(cache_->manifest()));
  scalars.divide(writer.histograms());
  ValueBuilder builder(*cache_, order_, buckets_, scalars.codings, writer, *progress_);
  if (references) builder.predictFrom(*references);
  ValueLoader loader(*cache_, order_, buckets_, variables_, plan_, scratch_);
  loader.forEach(*file_, 0, buckets_.size(), grouped_, [&](LoadedValues& loaded) { builder.build(loaded); });
  file_.reset();
}

std::vector<IndexPlane> planesOf(const CacheReader& cache) {
  const auto faces = FacesReader::open(cache.path(), cache.manifest());
  std::vector<IndexPlane> planes;
  if (!faces) return planes;
  for (const GridFace& face : faces->faces()) {
    if (face.side != FaceSide::kPlane) continue;
    const BlockInfo& block = cache.manifest().blocks[face.block];
    const uint64_t nodes[] = {block.ni, block.nj, block.nk};
    // At an end it may be a side that folds upon itself, which is found again.
    if (face.index > 0 && face.index + 1 < nodes[face.axis])
      planes.push_back({face.block, face.axis, face.index, true});
  }
  return planes;
}

bool hasFacesOfBlanks(const CacheReader& cache) {
  return FacesReader::open(cache.path(), cache.manifest(), kBlanksFileName) != nullptr;
}

std::optional<FileInfo> writeFurtherFaces(const FurtherFaces& job, const MemoryPlan& plan,
                                          Progress& progress) {
  if (!FacesReader::open(job.cache.path(), job.cache.manifest())) return std::nullopt;
  const std::vector<IndexPlane> planes = planesOf(job.cache);
  plan.requireFaces(memoryOfFaces(job.reader.source().description(), planes));
  const std::filesystem::path output = job.cache.cachePath() / job.name;
  removeFileIfThere(output);  // a killed program's
  try {
    return writeGridFaces(job.reader,
                          {output, job.scratch, job.cache.manifest().lower, job.cache.manifest().upper,
                           planes, job.variables, plan.seam_bytes},
                          plan.slab_bytes, progress)
        .faces;
  } catch (...) {
    removeFileIfThere(output);
    throw;
  }
}

}  // namespace curvisplat
