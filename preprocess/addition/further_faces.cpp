#include "preprocess/addition/further_faces.h"

#include "stream/base/file.h"
#include "stream/cache/faces_file.h"

namespace curvisplat {

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
      planes.push_back({face.block, face.axis, face.index});
  }
  return planes;
}

std::optional<FileInfo> writeFurtherFaces(const FurtherFaces& job, const MemoryPlan& plan,
                                          Progress& progress) {
  if (!FacesReader::open(job.cache.path(), job.cache.manifest())) return std::nullopt;
  const std::vector<IndexPlane> planes = planesOf(job.cache);
  plan.requireFaces(memoryOfFaces(job.reader.source().description().blocks, planes));
  const std::filesystem::path output = job.cache.cachePath() / job.name;
  removeAll(output);  // a killed program's
  try {
    return writeGridFaces(job.reader,
                          {output, job.scratch, job.cache.manifest().lower, job.cache.manifest().upper,
                           planes, job.variables, plan.seam_bytes},
                          plan.slab_bytes, progress);
  } catch (...) {
    removeAll(output);
    throw;
  }
}

}  // namespace curvisplat
