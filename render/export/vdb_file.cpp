#include "render/export/vdb_file.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <fstream>
#include <string>

#include "render/export/field_sampler.h"
#include "stream/base/disk_space.h"
#include "stream/base/durable_file.h"
#include "stream/base/error.h"
#include "stream/base/file.h"
#include "stream/base/text.h"
#include "stream/vdb/fog_volume.h"

namespace curvisplat {
namespace {

constexpr uint32_t kSlab = 8;  // planes: a row of OpenVDB's leaves

SampleLattice latticeOf(const Manifest& manifest, uint32_t voxels) {
  const glm::dvec3 extent = manifest.upper - manifest.lower;
  const double widest = std::max({extent.x, extent.y, extent.z});
  const double voxel = (widest > 0 ? widest : 1) / voxels;
  SampleLattice lattice{manifest.lower + 0.5 * glm::dvec3(voxel), glm::dvec3(voxel), {}};
  for (int axis = 0; axis < 3; ++axis)
    lattice.size[static_cast<size_t>(axis)] =
        std::clamp(static_cast<uint32_t>(std::ceil(extent[axis] / voxel - 1e-6)), 1u, voxels);
  return lattice;
}

/// The bytes of two grids of which every voxel is filled: leaves of 8 voxels along each axis and the nodes
/// above them, of 16 and 32.
uint64_t filledBytes(const SampleLattice& lattice) {
  constexpr uint64_t kLeaf = 2400, kNode = 48 << 10, kUpperNode = 384 << 10;
  const auto count = [&](uint32_t side) {
    uint64_t nodes = 1;
    for (const uint32_t voxels : lattice.size) nodes *= (voxels + side - 1) / side;
    return nodes;
  };
  return 2 * (count(8) * kLeaf + count(128) * kNode + count(4096) * kUpperNode);
}

/// --memory that suffices whatever the cache: half of it is for the grids, half for those who sample.
std::string sufficientMemory(const SampleLattice& lattice) {
  const uint64_t half = std::max(filledBytes(lattice), kSampleBytes * kSlab * lattice.planePoints());
  return fmt::format("{}M", (2 * half >> 20) + 1);
}

/// How many threads may sample at a time, so that half of the memory is left for the grids.
unsigned threadsFor(const SampleLattice& lattice, const VdbOptions& options) {
  const unsigned threads =
      FieldSampler::threadsWithin(options.memory_bytes / 2, lattice, kSlab, options.threads);
  if (threads == 0)
    throw UsageError(
        "--memory {}: is too little to sample {} x {} x {} voxels; give --memory {} or fewer --voxels",
        byteText(options.memory_bytes), lattice.size[0], lattice.size[1], lattice.size[2],
        sufficientMemory(lattice));
  return threads;
}

void add(FogVolume& volume, const SampleLattice& lattice, uint32_t k_begin, uint32_t k_end,
         const FieldSamples& samples) {
  size_t n = 0;
  for (uint32_t k = k_begin; k < k_end; ++k)
    for (uint32_t j = 0; j < lattice.size[1]; ++j)
      for (uint32_t i = 0; i < lattice.size[0]; ++i, ++n)
        if (samples.density[n] > kMinDensity) volume.set({i, j, k}, samples.value[n], samples.density[n]);
}

/// Writes by a stream of ours that throws: OpenVDB's own file does not look whether its stream has failed.
void writeVolume(const FogVolume& volume, const std::filesystem::path& path) {
  TemporaryFile temporary(writableTarget(path));
  errno = 0;
  try {
    std::ofstream file;
    file.exceptions(std::ios::badbit | std::ios::failbit);
    file.open(temporary.path(), std::ios::binary);
    volume.write(file);
    file.close();
  } catch (const std::ios::failure&) {  // its words are "basic_ios::clear: iostream error"
    const int error = errno ? errno : EIO;
    if (DiskFull::is(error)) throw DiskFull(temporary.path(), path, "the voxels", error);
    throw Error("{}: cannot be written: {}", path.string(), std::strerror(error));
  } catch (const std::exception& error) {  // OpenVDB's
    throw Error("{}: cannot be written: {}", path.string(), temporary.aboutTarget(error.what()));
  }
  temporary.putIntoPlace();
}

}  // namespace

VdbReport writeVdb(const CacheReader& cache, size_t variable, const VdbOptions& options,
                   const std::filesystem::path& path, Progress& progress) {
  const SampleLattice lattice = latticeOf(cache.manifest(), options.voxels);
  const unsigned threads = threadsFor(lattice, options);
  const FieldSampler sampler(cache, variable, bricksOfDetail(cache, 0.5 * lattice.spacing.x), lattice);
  const auto volume = makeFogVolume(lattice.origin, lattice.spacing.x);
  sampler.sweep(kSlab, threads, progress, [&](uint32_t k_begin, uint32_t k_end, const FieldSamples& samples) {
    add(*volume, lattice, k_begin, k_end, samples);
    if (volume->bytes() > options.memory_bytes / 2)
      throw UsageError(
          "--memory {}: the voxels take more than half of it; give --memory {} or fewer --voxels",
          byteText(options.memory_bytes), sufficientMemory(lattice));
  });
  const VariableInfo& info = cache.manifest().variables.at(variable);
  volume->describe(info.name, info.unit, cache.time());
  writeVolume(*volume, path);
  return {volume->activeVoxels(), lattice.origin - 0.5 * lattice.spacing, lattice.spacing.x};
}

}  // namespace curvisplat
