#include "preprocess/convert/convert.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "preprocess/convert/conversion.h"
#include "preprocess/convert/conversion_workspace.h"
#include "preprocess/convert/convert_sets.h"
#include "preprocess/convert/grid_origin.h"
#include "preprocess/convert/memory_plan.h"
#include "preprocess/convert/mesh_origin.h"
#include "preprocess/convert/preflight.h"
#include "preprocess/convert/shared_passes.h"
#include "preprocess/faces/grid_faces_pass.h"
#include "preprocess/grid/grid_views.h"
#include "preprocess/grid/parallel.h"
#include "stream/base/error.h"
#include "stream/base/file.h"
#include "stream/base/text.h"
#include "stream/base/watched_file.h"
#include "stream/cache/faces_file.h"
#include "stream/cache/manifest.h"

namespace curvisplat {
namespace {

// A margin for forecasts of the cache's size: samples of eight million nodes promised 0.73 to 1.20 of what
// grids of 12 to 64 million then took.
constexpr double kSampleMargin = 1.15;

/// The shape of the grid and its scalars, in words. Without files' names and times, which may differ between
/// machines.
std::string shapeOf(const GridDescription& description, const std::vector<uint32_t>& scalars) {
  std::string shape = description.blocks.empty() ? "" : countText(description.blocks.size(), "block") + " of";
  for (const GridBlock& block : description.blocks)
    shape += fmt::format(" {}x{}x{}", block.ni, block.nj, block.nk);
  for (const MeshPiece& piece : description.pieces)
    shape += fmt::format(" {} points and {} cells", piece.points, piece.cells);
  shape += ", with";
  for (const uint32_t scalar : scalars) shape += " " + description.scalars[scalar].name;
  return shape;
}

/// Throws Error at ranks that see other files than rank 0: each converts its share of what it sees.
void requireSameGrid(const GridDescription& description, const std::vector<uint32_t>& scalars, Ranks& ranks) {
  const std::string own = shapeOf(description, scalars);
  const auto sent = fromBytes<char>(ranks.broadcast(toBytes(std::vector<char>(own.begin(), own.end()))));
  if (std::equal(own.begin(), own.end(), sent.begin(), sent.end())) return;
  constexpr size_t kShown = 200;
  if (sent.empty()) throw Error("rank 0 has no grid to compare this one with; give all ranks the same files");
  throw Error("{}: is another grid here than at rank 0: {}; found there {}; give all ranks the same files",
              description.files.empty() ? description.format : description.files.front(),
              own.substr(0, kShown), std::string(sent.begin(), sent.end()).substr(0, kShown));
}

/// Some buckets for each rank, so that they can be dealt out evenly.
uint64_t bucketSplatsOfRanks(const DataSource& source, const Ranks& ranks) {
  constexpr uint64_t kBucketsOfRank = 4;
  return std::max<uint64_t>(samplesOf(source.description()) / (kBucketsOfRank * ranks.count()),
                            4 * kMaxBrickSplats);
}

/// Whether only the traces of a finished conversion were to be removed. Throws Error if the output is in the
/// way. Rank 0 finds out, for all.
bool isFinished(const ConvertOptions& options, const std::vector<ConversionFact>& facts) {
  const auto found = [&] {
    if (options.resume) {
      const auto killed = ConversionWorkspace::clearKilled(options.output);
      if (killed && differenceOf(*killed, facts).empty()) return true;
    }
    if (options.resume && !options.overwrite && std::filesystem::exists(options.output / "manifest.json") &&
        !hasUnfinished(options.output))
      throw Error("{}: is complete, so there is nothing to resume; to replace it, add --overwrite",
                  options.output.string());
    checkOutput(options.output, options.overwrite, temporaryFolder(options));
    return false;
  };
  std::vector<uint8_t> finished(1);
  if (options.ranks->isFirst()) finished[0] = found();
  return fromBytes<uint8_t>(options.ranks->broadcast(toBytes(finished)))[0] != 0;
}

/// EstimateNeeds.
std::optional<DiskNeeds> needsIfSampled(const GridSource& grid, const ConvertOptions& options,
                                        const std::filesystem::path& folder, const Progress& progress) {
  const uint64_t nodes = std::min(samplesOf(grid.description()), kSampledNodes);
  if (!hasDiskSpace(diskNeeds(nodes, options.scalars.size()), folder, folder.parent_path()))
    return std::nullopt;
  try {
    return sampledNeeds(grid, options, folder, progress);
  } catch (const Interrupted&) {
    throw;
  } catch (const Error&) {
    return std::nullopt;  // the conversion reports what is wrong with the grid
  }
}

}  // namespace

DiskNeeds sampledNeeds(const GridSource& grid, const ConvertOptions& options,
                       const std::filesystem::path& folder, const Progress& progress, uint64_t nodes) {
  const std::shared_ptr<const GridSource> borrowed(std::shared_ptr<void>(), &grid);
  const std::unique_ptr<GridSource> sample = sampleOf(borrowed, nodes);
  const ScratchFolder scratch(folder, ScratchFolder::Folder::kMake);
  ConvertOptions of_sample = optionsOfSample(options, folder);
  of_sample.check_disk_space = false;
  of_sample.keep_interrupted = false;
  Progress of_work;
  of_work.stopWith(progress);
  const ConvertReport report = convert(*sample, of_sample, of_work);
  const SampleScale scale = SampleScale::of(grid.description(), sample->description(), options);
  const double margin = scale.volume > 1 ? kSampleMargin : 1;
  return {times(report.temporary_bytes, scale.volume), times(scale.bytesOf(report.files), margin), 0};
}

namespace {

ConvertReport convertScalars(const DataSource& source, ConvertOptions options, Progress& progress,
                             const decltype(FurtherParts::own_blanks)& own_blanks) {
  MemoryPlan plan = MemoryPlan::ofOptions(options.memory_bytes, options.scalars.size(), options.threads);
  const auto* const grid = dynamic_cast<const GridSource*>(&source);
  plan.suit(samplesOf(source.description()), options.scalars.size());
  if (grid) GridOrigin::requireMemory(*grid, options.scalars, plan);
  requireSameGrid(source.description(), options.scalars, *options.ranks);
  if (!options.ranks->alone())
    plan.limitBuckets(bucketSplatsOfRanks(source, *options.ranks), options.scalars.size());
  plan.limitTo(options.limits, options.scalars.size());
  plan = commonPlan(plan, *options.ranks);

  if (!grid) {
    if (!options.planes.empty())
      throw UsageError("--surface: {} has no index planes", source.description().format);
    if (options.blank_faces)
      throw UsageError(
          "--surface blanks: {} has no cells with indices; structured grids have faces of blanked cells",
          source.description().format);
    options.surfaces = false;
  }
  if (options.surfaces) {
    checkPlanes(source.description(), options.planes);
    plan.requireFaces(memoryOfFaces(source.description(), options.planes));
  }
  std::vector<ConversionFact> facts =
      factsOf(source.description(), options.scalars, options.blank_value, options.overlap);
  facts.push_back({"--value-precision", wordOf(options.precision)});
  ConvertReport report;
  if (isFinished(options, facts)) {
    const std::filesystem::path manifest = options.output / "manifest.json";
    report.resumed = true;
    reportCache(Manifest::fromJson(readTextFile(manifest), manifest), report);
    report.resumed_bricks = report.bricks;
  } else {
    const ConversionThreads threads(plan.threads);
    FurtherParts parts;
    parts.own_blanks = own_blanks;
    if (grid)
      parts.estimate = [&](const std::filesystem::path& folder) {
        progress.begin("sample", 0, "nodes");
        return needsIfSampled(*grid, options, folder, progress);
      };
    report = runConversion(source, options, plan, std::move(facts), parts, progress);
  }
  report.threads = plan.threads;
  report.memory_bytes = plan.cap_bytes;
  return report;
}

uint64_t blockNodes(const GridDescription& description) {
  uint64_t nodes = 0;
  for (const GridBlock& block : description.blocks) nodes += block.nodes();
  return nodes;
}

}  // namespace

ConvertReport convert(const DataSource& source, const ConvertOptions& options, Progress& progress) {
  const WatchedFiles files(source.description().files);
  ConvertReport report = convertSets(
      source, options,
      [&](const ConvertOptions& of_set, const decltype(FurtherParts::own_blanks)& own_blanks) {
        return convertScalars(source, of_set, progress, own_blanks);
      },
      progress);
  files.warn(report.warnings);
  return report;
}

uint64_t times(uint64_t count, double factor) {
  return static_cast<uint64_t>(std::llround(static_cast<double>(count) * factor));
}

SampleScale SampleScale::of(const GridDescription& whole, const GridDescription& sample,
                            const ConvertOptions& options) {
  const auto of_faces = [&](const GridDescription& grid, std::span<const IndexPlane> planes) {
    return static_cast<double>(temporaryBytesOfFaces(grid, planes, options.scalars.size()));
  };
  return {static_cast<double>(blockNodes(whole)) / static_cast<double>(blockNodes(sample)),
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
  of_sample.differing = DifferingScalars::kBlankAll;
  of_sample.planes.clear();  // the sample may not have them
  of_sample.ranks = &oneRank();
  return of_sample;
}

}  // namespace curvisplat
