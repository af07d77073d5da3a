#include "preprocess/convert/sampled_conversion.h"

#include <cmath>
#include <span>

#include "preprocess/faces/grid_faces_pass.h"
#include "stream/cache/faces_file.h"

namespace curvisplat {
namespace {

uint64_t nodesOf(const GridDescription& description) {
  uint64_t nodes = 0;
  for (const GridBlock& block : description.blocks) nodes += block.nodes();
  return nodes;
}

}  // namespace

uint64_t times(uint64_t count, double factor) {
  return static_cast<uint64_t>(std::llround(static_cast<double>(count) * factor));
}

SampleScale SampleScale::of(const GridDescription& whole, const GridDescription& sample,
                            const ConvertOptions& options) {
  const auto of_faces = [&](const GridDescription& grid, std::span<const IndexPlane> planes) {
    return static_cast<double>(temporaryBytesOfFaces(grid.blocks, planes, options.scalars.size()));
  };
  return {static_cast<double>(nodesOf(whole)) / static_cast<double>(nodesOf(sample)),
          of_faces(whole, options.planes) / of_faces(sample, {})};
}

uint64_t SampleScale::bytesOf(const std::vector<FileReport>& files) const {
  uint64_t bytes = 0;
  for (const FileReport& file : files) bytes += times(file.bytes, isFacesFile(file.name) ? faces : volume);
  return bytes;
}

ConvertOptions optionsOfSample(const ConvertOptions& options, const std::filesystem::path& folder) {
  ConvertOptions of_sample = options;
  of_sample.output = folder / "sample.splats";
  of_sample.temporary_folder = folder;
  if (of_sample.given_folders.empty()) of_sample.given_folders = {temporaryFolder(options)};
  of_sample.overwrite = of_sample.resume = false;
  of_sample.planes.clear();  // the sample may not have them
  of_sample.ranks = nullptr;
  return of_sample;
}

}  // namespace curvisplat
