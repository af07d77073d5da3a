#include "tools/options/convert_arguments.h"

#include <CLI/CLI.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <exception>
#include <map>
#include <memory>
#include <set>
#include <string>
#include <system_error>
#include <utility>

#include "preprocess/formats/common/temporary_folder.h"
#include "preprocess/formats/derived/derived_source.h"
#include "preprocess/gather/halved_mesh.h"
#include "preprocess/gradients/gradient_mesh.h"
#include "preprocess/grid/grid_views.h"
#include "preprocess/grid/parallel.h"
#include "preprocess/mesh/mesh_source.h"
#include "preprocess/survey/cell_bends.h"
#include "stream/base/error.h"
#include "stream/base/memory.h"
#include "stream/base/mutex.h"
#include "stream/base/name_list.h"
#include "stream/base/progress.h"
#include "stream/cache/faces_file.h"
#include "stream/cache/series.h"
#include "tools/options/default_scalars.h"
#include "tools/options/grid_surfaces.h"
#include "tools/options/option_parsers.h"
#include "tools/output/start_checks.h"

namespace curvisplat {
namespace {

constexpr const char* kByNeed = "auto";  // of --refine
constexpr const char* kGroup = "PLOT3D layout (default: detected)";
constexpr const char* kGlobeGroup = "Longitude-latitude grids (NetCDF), in kilometres";

/// Adds an option that accepts the keys of `values` and sets `target` to the value of the given key.
template <typename Value>
CLI::Option* addChoice(CLI::App& app, const char* name, const char* help,
                       const std::map<std::string, Value>& values, std::optional<Value>& target) {
  std::vector<std::string> keys;
  for (const auto& [key, value] : values) keys.push_back(key);
  return app
      .add_option_function<std::string>(
          name, [values, &target](const std::string& key) { target = values.at(key); }, help)
      ->check(CLI::IsMember(keys));
}

void addGlobeOptions(CLI::App& app, GlobeOptions& globe) {
  // A flag with an optional value: an option would take the next argument, the grid file, as its value.
  const std::string sphere_help = "Project to a sphere (default); --sphere=KM sets its radius";
  CLI::Option* const sphere =
      app.add_flag("--sphere{6371}", sphere_help)
          ->each([&globe](const std::string& radius) {
            globe.shape = GlobeOptions::Shape::kSphere;
            const char* const end = radius.data() + radius.size();
            const auto [parsed, error] = std::from_chars(radius.data(), end, globe.radius_km);
            if (error != std::errc{} || parsed != end || !(globe.radius_km > 0) ||
                !std::isfinite(globe.radius_km))
              throw CLI::ValidationError(radius +
                                         " is not a radius; expected kilometres above zero, such as 6371");
          })
          ->group(kGlobeGroup);
  app.add_flag_callback(
         "--flat", [&globe] { globe.shape = GlobeOptions::Shape::kFlat; },
         "Project to a flat map (equirectangular)")
      ->group(kGlobeGroup)
      ->excludes(sphere);
  app.add_option("--vertical-scale", globe.vertical_scale, "Vertical exaggeration factor (default 1)")
      ->check(CLI::Number)
      ->group(kGlobeGroup);
}

}  // namespace

void addGridOptions(CLI::App& app, OpenGridOptions& options) {
  app.add_option("--time-step", options.time_step,
                 "Time step to read from the grid's files, counted from 0 (default 0)");
  app.add_option("--select", options.select,
                 "Value to read of a dimension of NetCDF that is neither space nor time: month=3 "
                 "(of its coordinate; without one, counted from 0)")
      ->type_name("DIMENSION=VALUE")
      ->take_all()
      ->allow_extra_args(false);
  addChoice<bool>(app, "--order",
                  "own: cells of higher order are cut by their polynomials; 1: they are drawn by their "
                  "corners (default own)",
                  {{"own", true}, {"1", false}}, options.cut_curved);
  addGlobeOptions(app, options.globe);
  Plot3dForce& force = options.force;
  addChoice<ByteOrder>(app, "--byte-order", "Byte order of binary files",
                       {{"little", ByteOrder::kLittle}, {"big", ByteOrder::kBig}}, force.byte_order)
      ->group(kGroup);
  addChoice<RecordMarkers>(
      app, "--records", "Size of Fortran record markers in bytes; none: C binary",
      {{"none", RecordMarkers::kNone}, {"4", RecordMarkers::kBytes4}, {"8", RecordMarkers::kBytes8}},
      force.records)
      ->group(kGroup);
  addChoice<int>(app, "--precision", "Floating-point precision", {{"single", 4}, {"double", 8}},
                 force.precision_bytes)
      ->group(kGroup);
  addChoice<bool>(app, "--blocks", "multi: the file begins with a block count",
                  {{"single", false}, {"multi", true}}, force.multi_block)
      ->group(kGroup);
  addChoice<bool>(app, "--iblank", "Whether the grid file has an iblank array",
                  {{"no", false}, {"yes", true}}, force.blanking)
      ->group(kGroup);
  CLI::Option* const ascii = app.add_flag_callback(
                                    "--ascii", [&force] { force.ascii = true; }, "Read as ASCII")
                                 ->group(kGroup);
  app.add_flag_callback(
         "--binary", [&force] { force.ascii = false; }, "Read as binary")
      ->group(kGroup)
      ->excludes(ascii);
}

void addGasOptions(CLI::App& app, GasModel& gas) {
  constexpr const char* kGasGroup = "Gas model of derived scalars";
  app.add_option("--gamma", gas.gamma, "Ratio of specific heats (default: from the files, else 1.4)")
      ->group(kGasGroup);
  app.add_option("--gas-constant", gas.constant, "Specific gas constant R (default: from the files, else 1)")
      ->group(kGasGroup);
}

std::unique_ptr<DataSource> openWithDerived(const OpenGridOptions& grid, const DerivedOptions& derived) {
  std::unique_ptr<DataSource> source = openData(grid);
  if (auto* const mesh = dynamic_cast<MeshSource*>(source.get())) {
    source.release();
    return std::make_unique<GradientMesh>(
        std::make_unique<DerivedMeshSource>(std::unique_ptr<MeshSource>(mesh), derived), derived,
        grid.temporary_folder.empty() ? systemTemporaryFolder() : grid.temporary_folder);
  }
  return std::make_unique<DerivedSource>(requireGrid(std::move(source), ""), derived);
}

namespace {

bool isScalar(const GridDescription& description, const std::string& name) {
  try {
    scalarsNamed(description, {name});
    return true;
  } catch (const UsageError&) {
    return false;
  }
}

std::vector<std::string> splitAtCommas(const std::string& text) {
  std::vector<std::string> parts;
  for (size_t begin = 0; begin <= text.size();) {
    const size_t end = std::min(text.find(',', begin), text.size());
    if (end > begin) parts.push_back(text.substr(begin, end - begin));
    begin = end + 1;
  }
  return parts;
}

/// The refinement of the cache that is added to or continued, if there is one. Throws UsageError if --refine
/// asks for another one.
std::optional<Refinement> refinementOf(const ConvertArguments& arguments,
                                       const std::filesystem::path& cache) {
  if (arguments.refinement) return arguments.refinement;
  const bool adds = arguments.adds_steps || !arguments.added_scalars.empty();
  const bool continues = arguments.resume && !arguments.overwrite;
  std::error_code ignored;  // what is wrong with a cache is said where it is changed
  if (!(adds || continues) || !std::filesystem::exists(cache / "manifest.json", ignored)) return {};
  const Refinement found = readManifest(cache).refinement;
  if (arguments.refine)
    if (const auto parts = parseRefinement("--refine", *arguments.refine);
        parts && Refinement(*parts) != found)
      throw UsageError("--refine {}: {} was converted with --refine {}; leave the option out", *parts,
                       cache.string(), found.isUniform() ? fmt::to_string(found.parts()) : kByNeed);
  return found;
}

unsigned threadsFor(unsigned given) {
  return given > 0 ? given : static_cast<unsigned>(tbb::info::default_concurrency());
}

/// The refinement of all steps of a series, found where a step is opened first.
class RefinementOnce {
 public:
  template <typename Find>
  const Refinement& get(const Find& find) {
    const MutexLock lock(mutex_);
    if (!found_) found_ = find();
    return *found_;
  }

 private:
  Mutex mutex_;
  std::optional<Refinement> found_ GUARDED_BY(mutex_);
};

/// Does what chooseScalars() does, but calls say(note) instead of printing, and throws UsageError.
template <typename Say>
std::vector<uint32_t> positionsOf(const ConvertArguments& arguments, const std::vector<std::string>& names,
                                  const GridDescription& description, const Say& say) {
  std::vector<uint32_t> stored;
  std::vector<std::string> words;
  for (const std::string& name : names) {
    const bool is_one = isScalar(description, name);  // its name may have commas
    for (const std::string& part : is_one ? std::vector{name} : splitAtCommas(name))
      if (part == "all" && !isScalar(description, part))
        stored = defaultScalars(description, arguments.unusable_scalars, say);
      else
        words.push_back(part);
  }
  if (names.empty()) stored = defaultScalars(description, arguments.unusable_scalars, say);
  if (words.empty() && !stored.empty()) return stored;
  for (const std::string& note : notesOnNumbers(description, words)) say(note);
  for (const uint32_t position : scalarsNamed(description, words))
    if (std::find(stored.begin(), stored.end(), position) == stored.end()) stored.push_back(position);
  return stored;
}

/// The scalars that will be converted; none if a name is wrong: chooseScalars() reports it.
std::vector<uint32_t> scalarsToConvert(const ConvertArguments& arguments,
                                       const GridDescription& description) {
  try {
    return positionsOf(arguments, arguments.scalars, description, [](const std::string&) {});
  } catch (const UsageError&) {
    return {};
  }
}

}  // namespace

void takeScalarsFromSolutions(ConvertArguments& arguments) {
  std::vector<std::string>& scalars =
      arguments.added_scalars.empty() ? arguments.scalars : arguments.added_scalars;
  if (scalars.empty()) return;
  std::erase_if(arguments.grid.solutions, [&](const std::filesystem::path& path) {
    std::error_code ignored;
    const bool is_name = path.string().find_first_of("./") == std::string::npos;
    if (!is_name || std::filesystem::exists(path, ignored)) return false;
    scalars.push_back(path.string());
    return true;
  });
}

std::unique_ptr<DataSource> openSource(const ConvertArguments& arguments,
                                       const std::filesystem::path& cache) {
  OpenGridOptions grid = arguments.grid;
  grid.temporary_folder =
      arguments.temporary_folder.empty() ? cache.parent_path() : arguments.temporary_folder;
  if (grid.temporary_folder.empty()) grid.temporary_folder = ".";
  // A reader that has several grids takes that of the scalars; it passes over names that it does not know.
  for (const auto* words : {&arguments.scalars, &arguments.added_scalars})
    for (const std::string& word : *words) {
      grid.scalars.push_back(word);
      const std::vector<std::string> parts = splitAtCommas(word);
      if (parts.size() > 1) grid.scalars.insert(grid.scalars.end(), parts.begin(), parts.end());
    }
  std::unique_ptr<DataSource> source = openWithDerived(grid, {arguments.gas, arguments.blank_value});
  if (const auto refinement = refinementOf(arguments, cache))
    return refinedBy(*refinement, std::move(source), arguments.blank_value);
  const auto parts = parseRefinement("--refine", arguments.refine.value_or(kByNeed));
  const Refinement refinement =
      parts ? Refinement(*parts)
            : refinementByNeed(*source, scalarsToConvert(arguments, source->description()), arguments.threads,
                               arguments.blank_value);
  return refinedBy(refinement, std::move(source), arguments.blank_value);
}

std::unique_ptr<DataSource> refinedBy(const Refinement& refinement, std::unique_ptr<DataSource> source,
                                      std::optional<double> blank_value) {
  if (!refinement.cutsCells()) return source;
  const GridDescription& description = source->description();
  const std::string name = description.files.empty() ? "the grid" : description.files.front();
  if (auto* const mesh = dynamic_cast<MeshSource*>(source.get())) {
    const uint32_t parts = refinement.parts();
    if (!refinement.isUniform() || !std::has_single_bit(parts))
      throw Error("{}: is an unstructured grid, whose cells are cut into 2, 4, 8 or 16 parts along each edge",
                  name);
    source.release();
    std::unique_ptr<MeshSource> cut(mesh);
    for (uint32_t n = 1; n < parts; n *= 2) cut = halved(std::move(cut), blank_value);
    return cut;
  }
  std::unique_ptr<GridSource> grid = requireGrid(std::move(source), "cannot be refined");
  const size_t blocks = grid->description().blocks.size();
  if (!refinement.isUniform() && refinement.ofBlocks().size() != blocks)
    throw Error("{}: has {} blocks; the cells of the cache's {} blocks were cut by --refine auto", name,
                blocks, refinement.ofBlocks().size());
  return refined(std::move(grid), refinement, blank_value);
}

Refinement refinementByNeed(const DataSource& source, const std::vector<uint32_t>& scalars, unsigned threads,
                            std::optional<double> blank_value) {
  if (const auto* const mesh = dynamic_cast<const MeshSource*>(&source))
    return isHalvedByNeed(*mesh) ? Refinement(2) : Refinement();
  const auto* const grid = dynamic_cast<const GridSource*>(&source);
  if (!grid) return {};
  const ConversionThreads bound(threadsFor(threads));
  Refinement refinement = refinementByNeed(*grid, scalars, blank_value);
  returnFreedMemory();
  return refinement;
}

std::string noteOnCuts(const GridDescription& description, std::string_view how_to_avoid) {
  if (!description.refinement.cutsCells()) return {};
  if (!description.pieces.empty())
    return fmt::format("cells beside larger or smaller ones are halved along each edge; {} leaves them whole",
                       how_to_avoid);
  uint64_t nodes = 0, in_files = 0;
  for (size_t n = 0; n < description.blocks.size(); ++n) {
    const GridBlock& block = description.blocks[n];
    const auto [i, j, k] = description.refinement.nodeInFiles(n, {block.ni - 1, block.nj - 1, block.nk - 1});
    nodes += block.nodes();
    in_files += (i + 1) * (j + 1) * (k + 1);
  }
  return fmt::format(
      "cells that bend or grow steeply, or end in stairs, are cut: {} nodes of the files become {}; {} "
      "leaves them whole",
      in_files, nodes, how_to_avoid);
}

std::vector<std::string> notesOnCells(const DataSource& source, const ConvertArguments& arguments) {
  std::vector<std::string> notes;
  if (!arguments.refine)
    if (std::string note = noteOnCuts(source.description()); !note.empty()) notes.push_back(std::move(note));
  const auto* const grid = dynamic_cast<const GridSource*>(&source);
  if (!grid) return notes;
  const ConversionThreads bound(threadsFor(arguments.threads));
  if (std::string note = noteOnCells(*grid, arguments.refine.value_or(kByNeed) == kByNeed); !note.empty())
    notes.push_back(std::move(note));
  return notes;
}

std::optional<uint32_t> parseRefinement(const std::string& option, const std::string& text) {
  if (text == kByNeed) return {};
  uint32_t parts = 0;
  const char* const end = text.data() + text.size();
  const auto [parsed, error] = std::from_chars(text.data(), end, parts);
  if (error != std::errc{} || parsed != end || parts < 1 || parts > kMaxRefinement)
    throw UsageError("{} {}: expected 1 to {}, or auto", option, text, kMaxRefinement);
  return parts;
}

std::vector<uint32_t> chooseScalars(const ConvertArguments& arguments, const std::vector<std::string>& names,
                                    const GridDescription& description) {
  try {
    return positionsOf(arguments, names, description,
                       [](const std::string& note) { printMessage("note: {}", note); });
  } catch (const UsageError& error) {
    throw Error("{}: {}", arguments.grid.grid.string(), error.what());
  }
}

std::vector<std::filesystem::path> gridAndCaches(const ConvertArguments& arguments) {
  std::vector<std::filesystem::path> paths = arguments.grid.solutions;
  paths.push_back(arguments.grid.grid);
  paths.insert(paths.end(), {arguments.to, arguments.output});
  return paths;
}

void checkStatisticsFile(const ConvertArguments& arguments) {
  if (!arguments.statistics.empty())
    checkJsonOutput("--stats", arguments.statistics, gridAndCaches(arguments));
}

void applyGridUse(const ConvertArguments& arguments, ConvertOptions& options) {
  if (arguments.overlap) {
    requireChoice("--overlap", *arguments.overlap, {"owner", "all"});
    options.overlap = *arguments.overlap == "all" ? Overlap::kAll : Overlap::kOwner;
  }
  options.precision = parseValuePrecision("--value-precision", arguments.precision);
  options.surfaces = !arguments.no_surfaces;
  if (arguments.no_surfaces && !arguments.planes.empty())
    throw UsageError("--no-surfaces contradicts --surface {}; give one of them", arguments.planes.front());
  for (const std::string& list : arguments.planes)
    for (const std::string& text : splitAtCommas(list)) {
      if (text == kBlanks) {
        options.blank_faces = true;
        continue;
      }
      const auto name = parseFaceName(text);
      const bool has_range = name && (name->ranges[0] || name->ranges[1] || name->ranges[2]);
      if (!name || name->at != FaceName::At::kIndex || has_range)
        throw UsageError(
            "--surface {}: expected an index plane such as k=10 or \"block 1:k=10\", indices from 0, or "
            "blanks "
            "(the outer faces go into the cache anyway)",
            text);
      const IndexPlane plane{name->block, name->axis, name->index};
      if (std::find(options.planes.begin(), options.planes.end(), plane) == options.planes.end())
        options.planes.push_back(plane);
    }
}

double secondsOf(const Progress& progress) {
  double seconds = 0;
  for (const Progress::Phase& phase : progress.phases()) seconds += phase.seconds;
  return seconds;
}

void addPhases(const Progress& progress, nlohmann::json& json) {
  json["seconds"] = secondsOf(progress);
  for (const Progress::Phase& phase : progress.phases())
    json["phases"].push_back({{"name", phase.name},
                              {"seconds", phase.seconds},
                              {"cpu_seconds", phase.usage.cpu_seconds},
                              {"steps", phase.steps},
                              {"unit", phase.unit},
                              {"bytes_read", phase.usage.bytes_read},
                              {"bytes_written", phase.usage.bytes_written},
                              {"peak_memory_bytes", phase.usage.peak_memory_bytes}});
}

uint64_t totalBytes(std::span<const FileReport> files) {
  uint64_t bytes = 0;
  for (const FileReport& file : files) bytes += file.bytes;
  return bytes;
}

double mebibytes(uint64_t bytes) {
  return static_cast<double>(bytes) / static_cast<double>(1 << 20);
}

std::string peakMemoryText() {
  const uint64_t bytes = ProcessUsage::now().peak_memory_bytes;
  return bytes > 0 ? fmt::format(", peak memory {:.0f} MiB", mebibytes(bytes)) : "";
}

std::vector<StepFiles> chosenSteps(const ConvertArguments& arguments, const std::string& option) {
  const std::vector<StepFiles> all = stepsOf(arguments.grid);
  StepSelection selection = parseSteps(option, arguments.steps.value_or("all"));
  if (arguments.every) selection.stride *= *arguments.every;
  std::vector<StepFiles> chosen;
  for (const uint64_t step : selectedSteps(option, selection, all.size())) chosen.push_back(all[step]);
  return chosen;
}

Refinement refinementOfSteps(const ConvertArguments& arguments, const std::filesystem::path& cache,
                             const std::vector<StepFiles>& steps) {
  if (const auto of_cache = refinementOf(arguments, cache)) return *of_cache;
  if (const auto parts = parseRefinement("--refine", arguments.refine.value_or(kByNeed)))
    return Refinement(*parts);
  std::exception_ptr failure;
  for (const StepFiles& step : steps) try {
      ConvertArguments of_step = arguments;
      of_step.grid = step.options;
      return openSource(of_step, cache)->description().refinement;
    } catch (const Error&) {  // with --keep-going, the step is left out
      if (!failure) failure = std::current_exception();
    }
  if (failure) std::rethrow_exception(failure);
  return {};
}

namespace {

/// The steps that show whether all have a scalar: of one file or folder all of them, since what a solver writes besides differs from
/// one time to the next; of other files, which are alike but for the initial one and may be many, the second and the last.
std::vector<uint64_t> tellingSteps(const std::vector<StepFiles>& steps) {
  std::vector<uint64_t> telling;
  for (uint64_t step = 1; step < steps.size(); ++step)
    if (step == 1 || step + 1 == steps.size() || steps[step].options.grid == steps.front().options.grid)
      telling.push_back(step);
  return telling;
}

/// The stored scalars of the first step that later ones lack. Warns of them.
std::set<std::string> missingLater(const GridDescription& first, const std::vector<StepFiles>& steps) {
  std::set<std::string> missing;
  for (const uint64_t step : tellingSteps(steps)) try {
      const auto source = openData(steps[step].options);
      std::set<std::string> there;
      for (const GridScalar& scalar : source->description().scalars) there.insert(scalar.name);
      std::vector<std::string> lost;
      for (const GridScalar& scalar : first.scalars)
        if (!scalar.derived && !there.contains(scalar.name) && missing.insert(scalar.name).second)
          lost.push_back(scalar.name);
      if (!lost.empty())
        printMessage("warning: left out: {}: the first step has {}, step {} ({}) does not", listed(lost),
                     lost.size() == 1 ? "it" : "them", step, steps[step].name);
    } catch (const Interrupted&) {
      throw;
    } catch (const Error&) {  // which is reported where the step is converted
    }
  return missing;
}

}  // namespace

SeriesInput seriesInput(const ConvertArguments& arguments, const std::vector<StepFiles>& steps,
                        const std::vector<StepFiles>& all) {
  SeriesInput input;
  const auto first = std::make_shared<RefinementOnce>();
  input.count = steps.size();
  input.name = [&](uint64_t step) { return steps[step].name; };
  input.open = [&, first](uint64_t step) {
    const std::filesystem::path& cache = arguments.adds_steps ? arguments.to : arguments.output;
    ConvertArguments of_step = arguments;
    of_step.refinement = first->get([&] { return refinementOfSteps(arguments, cache, steps); });
    of_step.grid = steps[step].options;
    return openSource(of_step, cache);
  };
  input.scalars = [&](const GridDescription& description) {
    ConvertArguments of_all = arguments;
    const bool names_them = !arguments.scalars.empty() && !std::ranges::count(arguments.scalars, "all");
    // --keep-going leaves out steps instead.
    if (!names_them && !arguments.keep_going) of_all.unusable_scalars = missingLater(description, all);
    return chooseScalars(of_all, arguments.scalars, description);
  };
  return input;
}

}  // namespace curvisplat
