#include "tools/options/kept_conversion.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <memory>
#include <optional>
#include <set>
#include <system_error>
#include <utility>
#include <vector>

#include "preprocess/addition/convert_series.h"
#include "preprocess/convert/convert.h"
#include "preprocess/convert/scan.h"
#include "preprocess/formats/open/series_files.h"
#include "preprocess/gather/mesh_lattice.h"
#include "preprocess/grid/grid_views.h"
#include "render/automatic/first_choice.h"
#include "stream/base/error.h"
#include "stream/base/file.h"
#include "stream/base/name_list.h"
#include "stream/cache/series.h"
#include "tools/options/convert_arguments.h"
#include "tools/options/default_scalars.h"

namespace curvisplat {
namespace {

namespace fs = std::filesystem;

constexpr const char* kLock = "lock";

fs::path newPath(const fs::path& place, const std::string& name) {
  static std::atomic<unsigned> made = 0;
  return place / fmt::format("{}.{}.{}", name, ::getpid(), made++);
}

bool isHeld(const fs::path& folder) {
  const int fd = ::open((folder / kLock).c_str(), O_RDWR | O_CLOEXEC);
  if (fd < 0) return errno != ENOENT;
  const bool held = ::flock(fd, LOCK_EX | LOCK_NB) != 0;
  ::close(fd);
  return held;
}

}  // namespace

PreviewFolder::PreviewFolder(const fs::path& place, const std::string& name) : path_(newPath(place, name)) {
  removeAll(path_);  // of a process of the same number that was killed
  makeFolder(path_);
  lock_ = ::open((path_ / kLock).c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0666);
  if (lock_ < 0) {
    const std::string reason = std::generic_category().message(errno);
    removeAll(path_);
    throw Error("{}: cannot be created: {}", (path_ / kLock).string(), reason);
  }
  ::flock(lock_, LOCK_EX | LOCK_NB);  // a file system without locks has no left ones removed, either
}

PreviewFolder::~PreviewFolder() {
  if (!keep_) removeAll(path_);
  ::close(lock_);
}

void PreviewFolder::removeLeftOnes(const fs::path& place, const std::string& name) {
  std::vector<fs::path> left;
  std::error_code error;
  for (fs::directory_iterator at(place, error), end; !error && at != end; at.increment(error))
    if (at->path().filename().string().starts_with(name + ".") && !isHeld(at->path()))
      left.push_back(at->path());
  for (const fs::path& folder : left) removeAll(folder);
}

namespace {

constexpr const char *kPreview = "preview", *kSeries = "series";  // names of folders
constexpr uint64_t kBytesForPreview = uint64_t{1} << 30;          // for the points of a mesh

ConvertOptions optionsFor(const fs::path& output, const std::string& title) {
  ConvertOptions options;
  options.output = output;
  options.overwrite = true;
  options.keep_interrupted = false;  // it may never be opened again
  options.title = title;
  options.temporary_folder = output.parent_path();
  options.full_disk_hint = "make room, or set XDG_CACHE_HOME to a folder on another disk";
  options.differing = DifferingScalars::kKeepApart;
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

/// A source that is quick to convert, of the scalars `scalars`.
struct CoarseSource {
  std::unique_ptr<GridSource> source;  // null: there is none
  std::vector<uint32_t> scalars;
  KeptPreview what;
};

CoarseSource coarseGrid(const GridSource& grid, const std::vector<uint32_t>& scalars) {
  if (nodesOf(grid) <= kNodesWithoutPreview) return {};
  const uint64_t stride = strideFor(grid.description(), kNodesWithoutPreview / 4);
  CoarseSource coarse{thinned(grid, stride), scalars, {}};
  if (nodesOf(*coarse.source) > kNodesWithoutPreview) return {};  // of many small blocks
  coarse.what.stride = stride;
  return coarse;
}

CoarseSource coarseMesh(const MeshSource& mesh, const std::vector<uint32_t>& scalars, Progress& progress) {
  const MeshReader reader(mesh, scalars, std::nullopt);
  if (std::max(reader.points(), reader.cells()) <= kNodesWithoutPreview) return {};
  CoarseSource coarse{latticeOf(reader, kNodesWithoutPreview / 4, kBytesForPreview, progress), {}, {}};
  for (uint32_t n = 0; n < scalars.size(); ++n) coarse.scalars.push_back(n);
  if (coarse.source) coarse.what.lattice = coarse.source->description().blocks.front().ni;
  return coarse;
}

/// Makes a cache of a coarse sample, if the grid is large. There is none of a grid that cannot be sampled,
/// or if the preview fails: the conversion of the whole reports what is wrong. `whole`: options of the whole
/// conversion.
void makePreview(const DataSource& source, const ConvertOptions& whole, bool first_step, Progress& progress,
                 const KeptCacheEvents& events) {
  if (!events.preview) return;
  try {
    const auto* const grid = dynamic_cast<const GridSource*>(&source);
    const CoarseSource coarse =
        grid ? coarseGrid(*grid, whole.scalars)
             : coarseMesh(dynamic_cast<const MeshSource&>(source), whole.scalars, progress);
    if (!coarse.source) return;
    const auto folder = std::make_shared<const PreviewFolder>(whole.output.parent_path(), kPreview);
    ConvertOptions options = whole;
    options.scalars = coarse.scalars;
    options.surfaces = false;
    options.output = folder->path() / whole.output.filename();
    options.temporary_folder = folder->path();
    convert(*coarse.source, options, progress);
    KeptPreview preview = coarse.what;
    preview.cache = options.output;
    preview.whole = whole.output;
    preview.first_step = first_step;
    preview.folder = folder;
    events.preview(preview);
  } catch (const Interrupted&) {
    throw;
  } catch (const Error&) {
  } catch (const fs::filesystem_error&) {
  }
}

void makePreviewOfFirstStep(const SeriesInput& input, const ConvertOptions& whole, Progress& progress,
                            const KeptCacheEvents& events) {
  if (!events.preview) return;
  try {
    const std::unique_ptr<DataSource> first = input.open(0);
    ConvertOptions options = whole;
    options.scalars = input.scalars(first->description());
    makePreview(*first, options, true, progress, events);
  } catch (const Interrupted&) {
    throw;
  } catch (const Error&) {  // the conversion of the step says it
  }
}

/// The default scalars; of a grid alone those of `wanted` that it has.
std::vector<uint32_t> scalarsOf(const ConvertArguments& arguments, const std::vector<std::string>& wanted,
                                const GridDescription& description) {
  const bool is_alone = std::ranges::all_of(description.scalars, &GridScalar::derived);
  std::vector<std::string> names;
  for (const std::string& name : wanted)
    if (is_alone && std::ranges::count(description.scalars, name, &GridScalar::name) == 1 &&
        std::ranges::count(names, name) == 0)
      names.push_back(name);
  try {
    return chooseScalars(arguments, names, description);
  } catch (const Error& error) {
    if (is_alone) throw LoneGrid("{}", error.what());
    throw;
  }
}

/// Whether one of `wanted` is the scalar, as `info` prints it with its unit or without.
bool isWanted(const GridScalar& scalar, const std::vector<std::string>& wanted) {
  return std::ranges::count(wanted, scalar.name) > 0 ||
         std::ranges::count(wanted, fmt::format("{} [{}]", scalar.name, scalar.unit)) > 0;
}

/// Converts without scalars whose range is too wide, unless they are wanted or no other is there.
ConvertReport convertNarrow(const DataSource& source, const ConvertOptions& all,
                            const std::vector<std::string>& wanted, Progress& progress) {
  try {
    return convert(source, all, progress);
  } catch (const WideScalars& error) {
    ConvertOptions others = all;
    std::vector<std::string> left_out;
    for (const uint32_t wide : error.scalars()) {
      const GridScalar& scalar = source.description().scalars[wide];
      if (isWanted(scalar, wanted)) throw;
      left_out.push_back(scalar.name);
      std::erase(others.scalars, wide);
    }
    if (others.scalars.empty()) throw;
    ConvertReport report = convert(source, others, progress);
    report.warnings.push_back(fmt::format("left out: {}: {}", listed(left_out), error.what()));
    return report;
  }
}

bool isSameScalar(const GridScalar& a, const GridScalar& b) {
  return a.name == b.name && a.centring == b.centring && a.derived == b.derived;
}

bool isConstant(const fs::path& cache) {
  return std::ranges::all_of(readManifest(cache).variables, isNearlyConstant);
}

std::string namesIn(const GridDescription& description, const std::vector<uint32_t>& scalars) {
  std::vector<std::string> names;
  for (const uint32_t n : scalars) names.push_back(description.scalars[n].name);
  return listed(names);
}

/// Returns the stored scalars that are not among `converted`, as many at a time as are converted unasked: those of its centring first,
/// and the first of each name.
std::vector<std::vector<uint32_t>> othersThan(const GridDescription& description,
                                              const std::vector<uint32_t>& converted) {
  const Centring centring = description.scalars[converted.front()].centring;
  std::vector<std::vector<uint32_t>> others;
  for (const bool is_same : {true, false}) {
    std::vector<uint32_t> some;
    std::set<std::string> names;
    for (uint32_t n = 0; n < description.scalars.size(); ++n) {
      const GridScalar& scalar = description.scalars[n];
      if (scalar.derived || (scalar.centring == centring) != is_same || !names.insert(scalar.name).second ||
          std::ranges::count(converted, n) > 0)
        continue;
      some.push_back(n);
      if (some.size() == kMaxDefaultScalars) others.push_back(std::exchange(some, {}));
    }
    if (!some.empty()) others.push_back(std::move(some));
  }
  return others;
}

/// Converts the first other scalars that vary, in place of those of `options`, which are constant. If none varies, converts those of
/// `options` again.
ConvertReport convertOthers(const DataSource& source, const ConvertOptions& options,
                            const std::vector<std::string>& wanted, ConvertReport report_of_first,
                            Progress& progress) {
  const GridDescription& description = source.description();
  const std::vector<std::vector<uint32_t>> choices = othersThan(description, options.scalars);
  for (const std::vector<uint32_t>& scalars : choices) {
    ConvertOptions others = options;
    others.scalars = scalars;
    ConvertReport report = convertNarrow(source, others, wanted, progress);
    if (isConstant(options.output)) continue;
    const bool is_one = options.scalars.size() == 1;
    report.notes.push_back(fmt::format("{} {} constant, so {} took {} place",
                                       namesIn(description, options.scalars), is_one ? "is" : "are",
                                       namesIn(description, scalars), is_one ? "its" : "their"));
    return report;
  }
  return choices.empty() ? std::move(report_of_first) : convertNarrow(source, options, wanted, progress);
}

/// Says which of the time steps is converted, and how all of them are.
void noteTimeSteps(const std::vector<fs::path>& files, const GridDescription& description,
                   const KeptCacheEvents& events) {
  const auto times = timesText(description);
  if (!times) return;
  std::string names;
  for (const fs::path& file : files) names += file.string() + " ";
  events.say(fmt::format(
      "note: {}; {} is shown; all of them: curvisplat convert {}--steps all -o series.splats", *times,
      description.time_step == 0 ? "the first" : "the last, since the first is constant,", names));
}

/// Returns what `open` returns. Throws Interrupted soon after `progress` is stopped.
template <typename Open>
auto openStoppably(const Progress& progress, const Open& open) {
  try {
    const StoppableReads reading(progress);
    auto opened = open();
    progress.throwIfStopped();
    return opened;
  } catch (const Error&) {
    progress.throwIfStopped();  // readers may take a read that was stopped for a file of another kind
    throw;
  }
}

/// Makes a series beside its place, since a cache of its first steps looks complete. It is not moved when it
/// is complete, since a view may read it: a link takes the place.
void makeSeries(ConvertArguments& arguments, const fs::path& output, Progress& progress,
                const KeptCacheEvents& events, const std::vector<std::string>& scalars,
                ValuePrecision precision) {
  const auto folder = std::make_shared<PreviewFolder>(output.parent_path(), kSeries);
  arguments.output = folder->path() / output.filename();
  const std::vector<StepFiles> steps = openStoppably(progress, [&] { return stepsOf(arguments.grid); });
  SeriesOptions options;
  const std::string title = arguments.grid.grid.stem().string();
  options.convert = optionsFor(arguments.output, title);
  options.convert.precision = precision;
  options.is_kept = true;
  SeriesInput input = seriesInput(arguments, steps, steps);
  const auto of_files = input.scalars;
  input.scalars = [&](const GridDescription& description) {
    const bool is_alone = std::ranges::all_of(description.scalars, &GridScalar::derived);
    return is_alone ? scalarsOf(arguments, scalars, description) : of_files(description);
  };
  makePreviewOfFirstStep(input, optionsFor(output, title), progress, events);
  convertSeries(input, options, progress, [&](const SeriesEvent& event) {
    if (!event.converted) return;
    if (event.source) sayAll(events, *event.source, *event.converted);
    if (!events.preview) return;
    KeptPreview preview;
    preview.cache = arguments.output;
    preview.whole = output;
    preview.first_step = true;
    preview.folder = folder;
    events.preview(preview);
  });
  std::error_code error;
  if (fs::is_symlink(output, error)) fs::remove(output, error);  // to a series that someone has removed
  fs::create_directory_symlink(folder->path().filename() / output.filename(), output, error);
  if (error) throw Error("{}: cannot create the link: {}", output.string(), error.message());
  folder->keep();
}

}  // namespace

void makeKeptCache(const std::vector<fs::path>& files, const fs::path& output, Progress& progress,
                   const KeptCacheEvents& events, const std::vector<std::string>& scalars,
                   ValuePrecision precision) {
  for (const char* const name : {kPreview, kSeries})
    PreviewFolder::removeLeftOnes(output.parent_path(), name);
  ConvertArguments arguments;
  arguments.grid.grid = files.front();
  arguments.grid.solutions.assign(files.begin() + 1, files.end());
  arguments.output = output;
  if (hasSeveralStepFiles(arguments.grid))
    return makeSeries(arguments, output, progress, events, scalars, precision);
  ConvertOptions options = optionsFor(output, files.front().stem().string());
  options.precision = precision;
  std::unique_ptr<DataSource> source = openStoppably(progress, [&] { return openSource(arguments, output); });
  options.scalars = scalarsOf(arguments, scalars, source->description());
  makePreview(*source, options, false, progress, events);
  ConvertReport report = convertNarrow(*source, options, scalars, progress);
  const auto takeStep = [&](uint32_t step) {
    arguments.grid.time_step = step;
    const std::vector<GridScalar> before = source->description().scalars;
    source = openStoppably(progress, [&] { return openSource(arguments, output); });
    // Choosing scalars prints notes; it is repeated only if the step has other scalars.
    if (!std::ranges::equal(before, source->description().scalars, isSameScalar))
      options.scalars = scalarsOf(arguments, scalars, source->description());
  };
  const auto varies = [&] { return options.scalars.empty() || !isConstant(output); };
  const auto takeOthers = [&] {
    if (std::ranges::all_of(scalars, &std::string::empty))
      report = convertOthers(*source, options, scalars, std::move(report), progress);
  };
  // Cases that begin with a uniform medium are shown as they end; where that is uniform, too, by another scalar.
  const size_t steps = source->description().times.size();
  if (steps > 1 && !varies()) {
    takeStep(static_cast<uint32_t>(steps - 1));
    report = convertNarrow(*source, options, scalars, progress);
  }
  if (!varies()) takeOthers();
  if (steps > 1 && !varies()) {
    takeStep(0);
    report = convertNarrow(*source, options, scalars, progress);
    takeOthers();
  }
  sayAll(events, source->description(), report);
  noteTimeSteps(files, source->description(), events);
}

}  // namespace curvisplat
