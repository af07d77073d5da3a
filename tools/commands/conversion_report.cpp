#include "tools/commands/conversion_report.h"

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <cstdio>
#include <string>
#include <vector>

#include "preprocess/convert/conversion_workspace.h"
#include "preprocess/convert/convert.h"
#include "preprocess/convert/memory_plan.h"
#include "preprocess/convert/mesh_origin.h"
#include "preprocess/convert/preflight.h"
#include "preprocess/grid/grid_views.h"
#include "stream/base/disk_space.h"
#include "stream/base/error.h"
#include "stream/base/progress.h"
#include "stream/base/text.h"
#include "stream/cache/cache_reader.h"
#include "tools/output/command_run.h"
#include "tools/output/results.h"
#include "tools/output/start_checks.h"

namespace curvisplat {
namespace {

struct Forecast {
  uint64_t samples = 0, sampled = 0, steps = 1;
  uint64_t cache_bytes = 0, temporary_bytes = 0, memory_bytes = 0;
  double seconds = 0, sampling_seconds = 0;
  unsigned threads = 0;
};

uint64_t samplesOf(const GridDescription& description) {
  uint64_t nodes = 0;
  for (const GridBlock& block : description.blocks) nodes += block.nodes();
  for (const MeshPiece& piece : description.pieces) nodes += piece.points;
  return nodes;
}

std::filesystem::path temporaryFolderOf(const ConvertOptions& options) {
  const std::filesystem::path output = std::filesystem::absolute(options.output);
  return options.temporary_folder.empty() ? output.parent_path() : options.temporary_folder;
}

std::string freeText(const std::filesystem::path& folder) {
  const auto bytes = freeBytes(folder);
  return bytes ? fmt::format(" ({} are free)", byteText(*bytes)) : "";
}

void printForecast(const Forecast& forecast, const ConvertOptions& options) {
  const std::filesystem::path output = std::filesystem::absolute(options.output).parent_path();
  const double samples = static_cast<double>(forecast.samples) * static_cast<double>(forecast.steps);
  // A sample that was the whole grid has measured the sizes.
  const bool is_measured = forecast.sampled == forecast.samples && forecast.steps == 1;
  const auto size = is_measured ? byteText : estimatedBytes;
  const std::string of_steps = forecast.steps > 1 ? fmt::format(" in each of {} steps", forecast.steps) : "";
  if (forecast.sampled > 0)
    fmt::print("{} samples{}; estimated from {} of them, converted in {}:\n", forecast.samples, of_steps,
               forecast.sampled, estimatedTime(forecast.sampling_seconds));
  else
    fmt::print(
        "{} samples{}; estimated from its cells, and from conversions of other unstructured grids{}:\n",
        forecast.samples, of_steps, forecast.steps > 1 ? ", if it does not move" : "");
  const double each = static_cast<double>(forecast.cache_bytes) / samples;
  printLine("  cache      {} in {}{}, {} bytes per sample{}", size(forecast.cache_bytes), output.string(),
            freeText(output),
            each >= 100 ? fmt::format("{:.0f}", each) : fmt::format("{:.{}g}", each, is_measured ? 3 : 2),
            forecast.steps > 1 ? " and step" : "");
  const std::filesystem::path temporary = temporaryFolderOf(options);
  printLine("  temporary  {} in {}{}", size(forecast.temporary_bytes), temporary.string(),
            freeText(temporary));
  fmt::print("  memory     {}\n", size(forecast.memory_bytes));
  fmt::print("  time       {}, {}\n", estimatedTime(forecast.seconds), countText(forecast.threads, "thread"));
}

void finish(const Forecast& forecast, const ConvertOptions& options, const ConvertArguments& arguments) {
  printForecast(forecast, options);
  if (arguments.statistics.empty()) return;
  nlohmann::json json = runStatistics();
  json["dry_run"] = {{"samples", forecast.samples},
                     {"sampled", forecast.sampled},
                     {"steps", forecast.steps},
                     {"cache_bytes", forecast.cache_bytes},
                     {"temporary_bytes", forecast.temporary_bytes},
                     {"memory_bytes", forecast.memory_bytes},
                     {"seconds", forecast.seconds},
                     {"threads", forecast.threads}};
  writeStatistics(arguments.statistics, json);
}

/// Forecasts the conversion of one step, from `report` of its sample.
Forecast forecastOf(const ConvertReport& report, const GridDescription& whole, const SampleScale& scale,
                    const ConvertOptions& options) {
  Forecast forecast;
  forecast.samples = samplesOf(whole);
  forecast.sampled = report.nodes;
  forecast.threads = report.threads;
  forecast.cache_bytes = scale.bytesOf(report.files);
  forecast.temporary_bytes = times(report.temporary_bytes, scale.volume);
  MemoryPlan plan = MemoryPlan::ofOptions(options.memory_bytes, options.scalars.size(), options.threads);
  plan.suit(forecast.samples, options.scalars.size());
  forecast.memory_bytes = plan.expectedPeak(times(report.splats, scale.volume), options.scalars.size());
  return forecast;
}

/// Uses this process's peak of memory if the sample was the whole grid: it has taken as much as the
/// conversion will. The plan of memory knows only what grows with the grid, and what is bounded by --memory.
void useOwnPeak(Forecast& forecast, const GridDescription& whole, const GridDescription& sample) {
  if (samplesOf(whole) == samplesOf(sample)) forecast.memory_bytes = ProcessUsage::now().peak_memory_bytes;
}

/// Forecasts the conversion of `steps` time steps, whose points and cells are those of the first: each adds values alone.
Forecast forecastOfMesh(const MeshSource& mesh, const ConvertOptions& options, uint64_t steps) {
  MemoryPlan plan = MemoryPlan::ofOptions(options.memory_bytes, options.scalars.size(), options.threads);
  Forecast forecast;
  Progress progress{progressBar()};
  const StopOnSignals stopping(progress);
  const MeshOrigin origin(mesh, options.scalars, options.blank_value, plan, temporaryFolderOf(options));
  forecast.samples = origin.blocks().front().ni;
  plan.suit(forecast.samples, options.scalars.size());
  forecast.threads = plan.threads;
  const TemporaryNeeds temporary = origin.temporaryNeeds(progress);
  const uint64_t splats = std::max(forecast.samples, temporary.splats);
  const ConversionEstimate estimate =
      estimateConversion(splats, plan.threads,
                         origin.centring() == Centring::kCell ? SplatsOf::kMeshCells : SplatsOf::kMeshPoints);
  const DiskNeeds needs = with(temporary, diskNeeds(splats, options.scalars.size()));
  forecast.steps = steps;
  forecast.cache_bytes =
      estimate.cache_bytes + (steps * options.scalars.size() - 1) * estimate.bytes_per_further_scalar;
  forecast.temporary_bytes = needs.mostTemporary();
  forecast.memory_bytes = plan.expectedPeak(splats, options.scalars.size());
  forecast.seconds = static_cast<double>(steps) * estimate.seconds;
  return forecast;
}

}  // namespace

void dryRun(std::unique_ptr<DataSource> source, const ConvertOptions& options,
            const ConvertArguments& arguments) {
  checkOutput(options.output, options.overwrite || options.resume, temporaryFolderOf(options));
  const GridDescription whole = source->description();
  if (const auto* const mesh = dynamic_cast<const MeshSource*>(source.get()))
    return finish(forecastOfMesh(*mesh, options, 1), options, arguments);
  checkPlanes(whole, options.planes);
  const std::unique_ptr<GridSource> sample =
      sampleOf(std::unique_ptr<GridSource>(dynamic_cast<GridSource*>(source.release())), kSampledNodes);

  requireThreads(options.threads);
  Progress progress{progressBar()};
  const StopOnSignals stopping(progress);
  const ScratchFolder folder(ScratchFolder::newPath(temporaryFolderOf(options), "dry-run"),
                             ScratchFolder::Folder::kMake);
  const ConvertReport report = convert(*sample, optionsOfSample(options, folder.path()), progress);
  const SampleScale scale = SampleScale::of(whole, sample->description(), options);
  Forecast forecast = forecastOf(report, whole, scale, options);
  forecast.sampling_seconds = secondsOf(progress);
  forecast.seconds = scale.volume * forecast.sampling_seconds;
  useOwnPeak(forecast, whole, sample->description());
  finish(forecast, options, arguments);
}

void dryRunOfSeries(const SeriesInput& input, const SeriesOptions& options,
                    const ConvertArguments& arguments) {
  checkOutput(options.convert.output, options.convert.overwrite || options.convert.resume,
              temporaryFolderOf(options.convert));
  requireThreads(options.convert.threads);
  std::unique_ptr<DataSource> first = input.open(0);
  ConvertOptions with_scalars = options.convert;
  with_scalars.scalars = input.scalars(first->description());
  if (const auto* const mesh = dynamic_cast<const MeshSource*>(first.get()))
    return finish(forecastOfMesh(*mesh, with_scalars, input.count), options.convert, arguments);

  Progress progress{progressBar()};
  const StopOnSignals stopping(progress);
  const ScratchFolder folder(ScratchFolder::newPath(temporaryFolderOf(options.convert), "dry-run"),
                             ScratchFolder::Folder::kMake);
  SeriesOptions of_sample = options;
  of_sample.convert = optionsOfSample(options.convert, folder.path());
  GridDescription whole, part;
  SeriesInput sample = input;
  sample.count = std::min<uint64_t>(2, input.count);
  sample.scalars = [&](const GridDescription&) { return with_scalars.scalars; };
  sample.open = [&](uint64_t step) {
    std::unique_ptr<DataSource> opened = step == 0 && first ? std::move(first) : input.open(step);
    std::unique_ptr<GridSource> grid = requireGrid(std::move(opened), "cannot follow a structured step");
    whole = grid->description();
    grid = sampleOf(std::move(grid), kSampledNodes);
    part = grid->description();
    return grid;
  };

  Forecast forecast;
  double first_s = 0, further_s = 0;
  uint64_t further_bytes = 0;
  convertSeries(sample, of_sample, progress, [&](const SeriesEvent& event) {
    if (!event.added && !event.converted) return;
    const SampleScale scale = SampleScale::of(whole, part, with_scalars);
    if (event.converted) {
      forecast = forecastOf(*event.converted, whole, scale, with_scalars);
      first_s = secondsOf(progress) * scale.volume;
    } else {
      further_s = secondsOf(progress) * scale.volume - first_s;
      further_bytes = scale.bytesOf(event.added->files);
    }
  });
  forecast.steps = input.count;
  const auto further = static_cast<double>(input.count - 1);
  forecast.cache_bytes += times(further_bytes, further);
  forecast.seconds = first_s + further * further_s;
  forecast.sampling_seconds = secondsOf(progress);
  useOwnPeak(forecast, whole, part);
  finish(forecast, options.convert, arguments);
}

StoredScalars printStored(const std::filesystem::path& cache, uint64_t step, std::string_view where) {
  std::vector<VariableInfo> variables;
  std::vector<ValueErrors> errors;
  try {
    const auto add = [&](const CacheReader& reader) {
      for (size_t n = 0; n < reader.manifest().variables.size(); ++n) {
        errors.push_back(storedErrors(reader, n).means);
        variables.push_back(reader.manifest().variables[n]);
      }
    };
    const CacheReader reader(cache, step);
    add(reader);
    for (size_t n = 0; n < reader.seriesManifest().own_blanks.size(); ++n) add(reader.ownBlanks(n));
  } catch (const std::exception& error) {
    printMessage("warning: the cache is complete, but it cannot be read back: {}", error.what());
  }
  StoredScalars stored;
  for (size_t n = 0; n < variables.size(); ++n) {
    const auto& [number, name, unit, min, max] = variables[n];
    printLine("{}{}: {:.6g} .. {:.6g}{}, rounded within {:.1e}, typically {:.1e}", name, where, min + 0.0,
              max + 0.0,  // not -0
              unit.empty() ? "" : " " + unit, errors[n].largest, errors[n].typical);
    stored.errors.push_back(errors[n].largest);
    if (min == max) stored.constant.push_back(name);
  }
  return stored;
}

}  // namespace curvisplat
