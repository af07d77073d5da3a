#include "tools/options/kept_conversion.h"

#include <memory>
#include <system_error>

#include "preprocess/addition/convert_series.h"
#include "preprocess/convert/convert.h"
#include "preprocess/formats/open/series_files.h"
#include "preprocess/grid/thinned_source.h"
#include "stream/base/error.h"
#include "tools/options/convert_arguments.h"
#include "tools/options/series_input.h"

namespace curvisplat {
namespace {

namespace fs = std::filesystem;

constexpr const char *kPreview = "preview", *kSeries = "series";  // names of folders

ConvertOptions optionsFor(const fs::path& output, const std::string& title) {
  ConvertOptions options;
  options.output = output;
  options.overwrite = true;
  options.title = title;
  options.temporary_folder = output.parent_path();
  return options;
}

void sayAll(const KeptCacheEvents& events, const GridDescription& source, const ConvertReport& report) {
  for (const std::string& warning : source.warnings) events.say("warning: " + warning);
  for (const std::string& warning : report.warnings) events.say("warning: " + warning);
  for (const std::string& note : report.notes) events.say("note: " + note);
}

uint64_t nodesOf(const GridSource& grid) {
  uint64_t nodes = 0;
  for (const GridBlock& block : grid.description().blocks) nodes += block.nodes();
  return nodes;
}

/// A cache of every n-th index plane, if the grid is large. A grid that cannot be thinned, or a preview that fails, has
/// none: the conversion of the whole says what is wrong.
void makePreview(const DataSource& source, const ConvertOptions& whole, Progress& progress,
                 const KeptCacheEvents& events) {
  const auto* const grid = dynamic_cast<const GridSource*>(&source);
  if (!events.preview || !grid) return;
  if (nodesOf(*grid) <= kNodesWithoutPreview) return;
  const uint64_t stride = strideFor(grid->description(), kNodesWithoutPreview / 4);
  const auto coarse = thinned(*grid, stride);
  if (nodesOf(*coarse) > kNodesWithoutPreview) return;  // of many small blocks
  ConvertOptions options = whole;
  options.surfaces = false;
  try {
    const auto folder = std::make_shared<const PreviewFolder>(whole.output.parent_path(), kPreview);
    options.output = folder->path() / whole.output.filename();
    options.temporary_folder = folder->path();
    convert(*coarse, options, progress);
    events.preview({options.output, whole.output, stride, folder});
  } catch (const Interrupted&) {
    throw;
  } catch (const Error&) {
  } catch (const fs::filesystem_error&) {
  }
}

/// A series is made beside its place, since a cache of its first steps looks complete. It is not moved when it is, since
/// a view may read it: a link takes the place.
void makeSeries(ConvertArguments& arguments, const fs::path& output, Progress& progress,
                const KeptCacheEvents& events, ValuePrecision precision) {
  const auto folder = std::make_shared<PreviewFolder>(output.parent_path(), kSeries);
  arguments.output = folder->path() / output.filename();
  const std::vector<StepFiles> steps = stepsOf(arguments.grid);
  SeriesOptions options;
  options.convert = optionsFor(arguments.output, arguments.grid.grid.stem().string());
  options.convert.precision = precision;
  convertSeries(seriesInput(arguments, steps), options, progress, [&](const SeriesEvent& event) {
    if (!event.converted) return;
    if (event.source) sayAll(events, *event.source, *event.converted);
    if (events.preview) events.preview({arguments.output, output, 1, folder});
  });
  std::error_code error;
  if (fs::is_symlink(output, error)) fs::remove(output, error);  // to a series that someone has removed
  fs::create_directory_symlink(folder->path().filename() / output.filename(), output, error);
  if (error) throw Error("{}: cannot create the link: {}", output.string(), error.message());
  folder->keep();
}

}  // namespace

void makeKeptCache(const std::vector<fs::path>& files, const fs::path& output, Progress& progress,
                   const KeptCacheEvents& events, ValuePrecision precision) {
  for (const char* const name : {kPreview, kSeries})
    PreviewFolder::removeLeftOnes(output.parent_path(), name);
  ConvertArguments arguments;
  arguments.grid.grid = files.front();
  arguments.grid.solutions.assign(files.begin() + 1, files.end());
  arguments.output = output;
  if (hasSeveralStepFiles(arguments.grid)) return makeSeries(arguments, output, progress, events, precision);
  const auto source = openSource(arguments, output);
  ConvertOptions options = optionsFor(output, files.front().stem().string());
  options.precision = precision;
  options.scalars = chooseScalars(arguments, {}, source->description());
  makePreview(*source, options, progress, events);
  sayAll(events, source->description(), convert(*source, options, progress));
}

}  // namespace curvisplat
