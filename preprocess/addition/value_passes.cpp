#include "preprocess/addition/value_passes.h"

#include <tbb/enumerable_thread_specific.h>

#include <optional>
#include <utility>

#include "preprocess/addition/build_values.h"
#include "preprocess/addition/cache_grid.h"
#include "preprocess/convert/scatter.h"
#include "stream/cache/cell_octants.h"

namespace curvisplat {

ValuePasses::ValuePasses(const CacheReader& cache, size_t variables, const MemoryPlan& plan,
                         std::filesystem::path scratch, Progress& progress)
    : cache_(&cache),
      variables_(variables),
      plan_(plan),
      scratch_(std::move(scratch)),
      progress_(&progress),
      order_(cache),
      buckets_(cache.bricks(), order_, variables, plan.bucket_bytes),
      grouped_(ValueLoader::grouping(buckets_.size(), plan)) {}

void ValuePasses::openFile() {
  const uint32_t numbers = (buckets_.size() + grouped_ - 1) / grouped_;
  file_ = std::make_unique<BucketFile>(scratch_ / "values.bin", numbers, plan_.chunkBytes(numbers));
}

void ValuePasses::scatter(SplatOrigin& origin) {
  openFile();
  tbb::enumerable_thread_specific<ValueSink> sinks([this] { return newSink(); });
  origin.scatter([&]() -> SplatSink& { return sinks.local(); }, *progress_);
  ValueSink last = newSink();
  origin.finish(last, *progress_);
  last.flush();
  for (ValueSink& sink : sinks) sink.flush();
}

void ValuePasses::scatter(const NodeReader& reader, std::function<void(const LoadedSlab&)> see) {
  openFile();
  seams_ = std::make_unique<SeamMerger>(variables_, plan_.seam_bytes, scratch_,
                                        unlikeHalvesOf(cache_->manifest()));
  coordinate_bytes_ = reader.source().description().coordinate_bytes;

  tbb::enumerable_thread_specific<ValueSink> sinks([this] { return newSink(); });
  std::optional<BlockOwners> owners;
  if (!overlaps_.empty()) owners.emplace(ownersReader(reader, true), overlaps_, plan_.owner_bytes);
  SlabPass pass(*progress_, std::move(see));
  pass.owners = owners ? &*owners : nullptr;
  pass.octants = cache_->manifest().hasFeature(kCellOctants);
  streamSplats(
      reader, nullptr, plan_.slab_bytes, [&]() -> SplatSink& { return sinks.local(); }, *seams_, pass);
  for (ValueSink& sink : sinks) sink.flush();
}

void ValuePasses::mergeSeams() {
  if (seams_) {
    ValueSink sink = newSink();
    seams_->finish(coordinate_bytes_, [&](const NodeSplat& splat, std::span<const SplatScalar> values) {
      sink.add(splat, values);
      progress_->advance(1);
    });
    sink.flush();
    seams_.reset();
  }
  file_->close();
  temporary_bytes_ = file_->size();
}

void ValuePasses::build(ValuesWriter& writer, const StepReferences* references) {
  ValueBuilder builder(*cache_, order_, buckets_, variables_, writer, *progress_);
  if (references) builder.predictFrom(*references);
  ValueLoader loader(*cache_, order_, buckets_, variables_, plan_, scratch_);
  loader.forEach(*file_, 0, buckets_.size(), grouped_, [&](LoadedValues& loaded) { builder.build(loaded); });
  file_.reset();
}

}  // namespace curvisplat
