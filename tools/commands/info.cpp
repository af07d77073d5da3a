// `curvisplat info`: prints the contents of a cache or a grid, or what this machine can draw with
// (--system).
#include <fmt/format.h>
#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <glm/common.hpp>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "preprocess/formats/open/open_grid.h"
#include "render/automatic/first_choice.h"
#include "render/backend/backend.h"
#include "stream/base/error.h"
#include "stream/base/name_list.h"
#include "stream/base/progress.h"
#include "stream/base/text.h"
#include "stream/cache/cache_reader.h"
#include "stream/cache/cache_verify.h"
#include "stream/cache/partial_folder.h"
#include "stream/cache/value_histogram.h"
#include "stream/model/kernel.h"
#include "stream/model/refinement.h"
#include "tools/commands/commands.h"
#include "tools/commands/info_grid.h"
#include "tools/commands/info_probe.h"
#include "tools/commands/info_steps.h"
#include "tools/options/convert_arguments.h"
#include "tools/options/frame_sequence.h"
#include "tools/options/grid_surfaces.h"
#include "tools/options/shared_options.h"
#include "tools/output/command_run.h"
#include "tools/output/results.h"
#include "tools/output/start_checks.h"
#include "tools/window/window.h"

namespace curvisplat {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

/// Prints the drawing back ends and the window system of this machine, for --system.
void printSystem(bool json) {
  const SystemReport report = examineBackends();
  const WindowReport window = examineWindow();
  const unsigned cores = std::thread::hardware_concurrency();
  if (json) {
    Json out = {{"cores", cores}, {"auto", report.automatic}};
    out["backends"] = Json::array();
    for (const BackendReport& backend : report.backends)
      out["backends"].push_back({{"name", backend.word}, {"works", backend.works}, {"found", backend.found}});
    out["window"] = {
        {"opens", window.opens}, {"display", window.display}, {"glfw", window.glfw}, {"found", window.found}};
    fmt::print("{}\n", out.dump(2));
    return;
  }
  fmt::print("cores      {}\n", cores);
  for (const BackendReport& backend : report.backends)
    fmt::print("{:<10} {}{}\n", backend.word, backend.works ? "" : "not available: ", backend.found);
  fmt::print("auto       {}\n", report.automatic);
  fmt::print("display    {}\n", window.display);
  fmt::print("GLFW       {}\n", window.glfw);
  fmt::print("window     {}{}\n", window.opens ? "OpenGL " : "not available: ", window.found);
}

struct InfoOptions {
  GasModel gas;
  OpenGridOptions grid;  // grid.grid is a cache if it is a directory
  bool json = false;
  bool verify = false;
  bool system = false;
  ProbeArguments probe;
  StepArguments steps;
};

struct LevelSummary {
  uint64_t bricks = 0, leaves = 0, splats = 0;
  uint64_t geometry_bytes = 0, values_bytes = 0;  // values of all variables
  double largest_error = 0;
};

std::vector<LevelSummary> levelsOf(const CacheReader& reader) {
  std::vector<LevelSummary> levels(reader.manifest().levels);
  const auto bricks = reader.bricks();
  for (size_t n = 0; n < bricks.size(); ++n) {
    LevelSummary& level = levels[bricks[n].cell.level];
    ++level.bricks;
    level.leaves += bricks[n].isLeaf();
    level.splats += bricks[n].splats;
    level.geometry_bytes += bricks[n].geometry.length;
    level.largest_error = std::max(level.largest_error, double{bricks[n].error});
    for (size_t v = 0; v < reader.manifest().variables.size(); ++v)
      level.values_bytes += reader.brickVariables(v)[n].values.length;
  }
  return levels;
}

uint64_t totalBytes(const Manifest& manifest) {
  uint64_t bytes = 0;
  for (const FileInfo& file : manifest.files) bytes += file.size;
  return bytes;
}

double bytesPerSample(const Manifest& manifest, uint64_t bytes) {
  return static_cast<double>(bytes) / static_cast<double>(manifest.nodes - manifest.blanked_nodes);
}

/// The histograms of all scalars, each from `read`; null where the cache has none.
template <typename Read>
Json histogramsAsJson(const CacheReader& reader, const Read& read) {
  Json json = Json::array();
  for (size_t v = 0; v < reader.manifest().variables.size(); ++v) {
    const std::optional<ValueHistogram> of = read(v);
    json.push_back(of ? Json{{"min", of->lower},
                             {"max", of->upper},
                             {"volume", of->volume},
                             {"shares", of->shares},
                             {"percentiles", of->percentiles}}
                      : Json(nullptr));
  }
  return json;
}

/// A line on how a scalar's values are spread, if the cache says so.
void printSpread(const char* of, const std::optional<ValueHistogram>& histogram) {
  if (!histogram || !(histogram->lower < histogram->upper)) return;
  fmt::print(
      "           of samples, weighed by volume{}: 1 % below {:.4g}, 50 % below {:.4g}, 99 % below "
      "{:.4g}{}\n",
      of, histogram->percentile(0.01), histogram->percentile(0.5), histogram->percentile(0.99),
      histogram->percentiles.empty()
          ? fmt::format(" (to {:.2g}: the cache was made by an earlier program)", histogram->binWidth())
          : "");
}

/// The range that a picture has without --range, and what stored values are wrong in parts of it.
struct PictureError {
  double lower = 0, upper = 0, largest = 0, typical = 0;
};

/// The error of a picture at a splat's standard deviation from its centre, where most of what is seen of it
/// is. nullopt for a constant.
std::optional<PictureError> pictureErrorOf(const CacheReader& reader, size_t variable,
                                           const StreamErrors& errors) {
  if (isNearlyConstant(reader.manifest().variables[variable])) return std::nullopt;
  const std::pair<double, double> range = FirstChoice(reader, variable, glm::dvec3(1)).function().range;
  if (!(range.second > range.first)) return std::nullopt;
  const double changes = kKernelSigma * std::sqrt(3.0);  // of three independent components
  const auto part = [&](double value, double slope) {
    return std::hypot(value, changes * slope) / (range.second - range.first);
  };
  return PictureError{range.first, range.second, part(errors.means.largest, errors.slopes.largest),
                      part(errors.means.typical, errors.slopes.typical)};
}

void printPictureError(const CacheReader& reader, size_t variable, const StreamErrors& errors) {
  if (const auto error = pictureErrorOf(reader, variable, errors))
    fmt::print(
        "           errors in a picture over {:.4g} .. {:.4g}, its range by default: typically {:.2g} % of "
        "it "
        "({:.0f} dB), at most {:.2g} %\n",
        error->lower, error->upper, 100 * error->typical, -20 * std::log10(std::max(error->typical, 1e-15)),
        100 * std::min(error->largest, 1.0));
}

/// Results of --verify and --probe.
struct Findings {
  CacheVerification verification;
  Probe probe;
};

/// `positions`: of the cache; a set of scalars with blanks of its own has no values after its last step.
Probe probed(const CacheReader& reader, const std::vector<StepPosition>& positions,
             const InfoOptions& options) {
  Probe probe{parseProbe(options.probe),
              options.probe.of_source,
              {options.grid, options.gas},
              options.steps.severalSteps(),
              {}};
  if (probe.of_source) setSource(reader, options.probe.source, probe.source.grid);
  if (!options.probe.plot.empty()) {
    const OpenGridOptions& source = probe.source.grid;
    std::vector<fs::path> inputs = options.grid.solutions;
    inputs.insert(inputs.end(), source.solutions.begin(), source.solutions.end());
    inputs.insert(inputs.end(), {options.grid.grid, source.grid});
    checkOutputFile("-o", options.probe.plot, inputs);
  }
  bool doubted = false;
  for (const StepPosition& position : positions) {
    ProbedStep of_step{position.step, 0, {}};
    if (position.step < reader.series().steps.size()) {
      const CacheReader at = reader.at(position);
      of_step.time = reader.series().steps[position.step].time;
      std::string doubt;
      of_step.found = valuesAt(at, probe.asked.points, probe.of_source ? &probe.source : nullptr, &doubt);
      if (!doubt.empty() && !doubted)
        printMessage("warning: {}{}", positions.size() > 1 ? fmt::format("step {}: ", position.step) : "",
                     doubt);
      doubted |= !doubt.empty();
    } else {
      of_step.found.resize(probe.asked.points.size());
    }
    probe.steps.push_back(std::move(of_step));
  }
  return probe;
}

Findings examine(const CacheReader& reader, const std::vector<StepPosition>& positions,
                 const InfoOptions& options) {
  Findings found;
  if (options.verify) {
    Progress progress{progressBar()};
    found.verification = verifySteps(reader, progress);
  }
  if (options.probe.any()) found.probe = probed(reader, positions, options);
  return found;
}

/// The faces that `render --surface` names. None, with a warning, where they are damaged: the rest is printed, and
/// --verify goes on.
std::vector<std::string> facesOf(const CacheReader& reader) try {
  return faceNamesOf(reader);
} catch (const Error& error) {
  printMessage("warning: the faces cannot be read: {}", error.what());
  return {};
}

Json cacheAsJson(const CacheReader& reader, const InfoOptions& options, const Findings& found) {
  const Manifest& manifest = reader.manifest();
  Json json = Json::parse(manifest.toJson());
  if (reader.series().steps.size() > 1) {
    json["steps"] = stepsAsJson(reader);
    json["series_bytes"] = seriesBytes(reader);
    json["series_histograms"] =
        histogramsAsJson(reader, [&](size_t v) { return seriesHistogram(reader, v); });
  }
  json["histograms"] = histogramsAsJson(reader, [&](size_t v) { return stepHistogram(reader, v); });
  json["stored_within"] = Json::array();
  json["stored_errors"] = Json::array();
  json["picture_errors"] = Json::array();
  for (size_t v = 0; v < manifest.variables.size(); ++v) {
    const auto [means, slopes] = storedErrors(reader, v);
    json["stored_within"].push_back(means.largest);
    json["stored_errors"].push_back({{"values", {{"largest", means.largest}, {"typical", means.typical}}},
                                     {"slopes", {{"largest", slopes.largest}, {"typical", slopes.typical}}}});
    const auto picture = pictureErrorOf(reader, v, {means, slopes});
    json["picture_errors"].push_back(picture ? Json{{"range", {picture->lower, picture->upper}},
                                                    {"largest", picture->largest},
                                                    {"typical", picture->typical}}
                                             : Json(nullptr));
  }
  json["faces"] = facesOf(reader);
  json["bytes"] = totalBytes(manifest);
  json["bytes_per_node"] = bytesPerSample(manifest, totalBytes(manifest));
  json["bricks_by_level"] = Json::array();
  for (const LevelSummary& level : levelsOf(reader))
    json["bricks_by_level"].push_back({{"bricks", level.bricks},
                                       {"leaves", level.leaves},
                                       {"splats", level.splats},
                                       {"geometry_bytes", level.geometry_bytes},
                                       {"values_bytes", level.values_bytes},
                                       {"error", level.largest_error}});
  if (options.verify) {
    json["findings"] = found.verification.findings;
    json["notes"] = found.verification.notes;
  }
  return json;
}

/// The first ones and the last.
std::string sourcesText(const std::vector<std::string>& names) {
  constexpr size_t kFirst = 8;
  const bool all = names.size() <= kFirst + 2;
  std::string text;
  for (size_t n = 0; n < (all ? names.size() : kFirst); ++n) text += " " + names[n];
  if (!all) text += fmt::format(" ... ({} more) {}", names.size() - kFirst - 1, names.back());
  return text;
}

/// Prints the files of the step that the reader is at.
void printFiles(const CacheReader& reader) {
  const Manifest& m = reader.manifest();
  const uint64_t steps = reader.series().steps.size();
  const auto line = [&](const std::string& name, uint64_t bytes) {
    printLine("{:<18} {:>12} {:>18.3f}", name, bytes, bytesPerSample(m, bytes));
  };
  fmt::print("\nfile                      bytes   per drawn sample\n");
  uint64_t bytes = 0;
  for (const FileInfo& file : m.files) {
    if (isOfAnotherStep(file.name, reader.step())) continue;
    bytes += file.size;
    line(file.name, file.size);
  }
  line(steps == 1 ? "all" : "this step", bytes);
  if (steps == 1) return;
  const uint64_t of_series = seriesBytes(reader);
  fmt::print("{:<18} {:>12} {:>18.3f} and step\n", "all steps", of_series,
             bytesPerSample(m, of_series) / static_cast<double>(steps));
}

void printRefinement(const Manifest& m) {
  const Refinement& refinement = m.refinement;
  if (!refinement.cutsCells()) return;
  std::map<CellCuts, uint64_t> blocks;
  for (size_t n = 0; n < m.blocks.size(); ++n) ++blocks[refinement.ofBlock(n)];
  const bool same = blocks.size() == 1;
  for (const auto& [parts, count] : blocks)
    fmt::print("refined    each cell of the files' grid is {} here{}\n", textOf(parts),
               same ? "" : fmt::format(", in {}", countText(count, "block")));
}

void printCacheAsText(const CacheReader& reader, const InfoOptions& options, const Findings& found) {
  const Manifest& m = reader.manifest();
  printLine("{}", m.title);
  printLine("written by {} from{}", m.program, sourcesText(m.sources));
  printLine("{}", m.reader);
  fmt::print("\n");
  fmt::print("bounds     {} .. {}\n           {} .. {}\n           {} .. {}\n", m.lower.x + 0.0,
             m.upper.x + 0.0, m.lower.y + 0.0, m.upper.y + 0.0, m.lower.z + 0.0, m.upper.z + 0.0);
  fmt::print("volume     {:.8g}\n", m.volume);
  fmt::print("samples    {} at {} in {}, {} blanked\n", m.nodes, m.cells ? "cell centres" : "nodes",
             countText(m.blocks.size(), "block"), m.blanked_nodes);
  printRefinement(m);
  fmt::print("splats     {} at the finest level\n", m.splats);
  if (const std::vector<std::string> faces = facesOf(reader); !faces.empty())
    printLine("faces      {}", listed(faces));
  printSteps(reader);
  for (size_t v = 0; v < m.variables.size(); ++v) {
    const auto [means, slopes] = storedErrors(reader, v);
    printLine("scalar     {}{}: {}, rounded within {:.1e}", m.variables[v].name,
              m.variables[v].unit.empty() ? "" : fmt::format(" [{}]", m.variables[v].unit),
              rangeText(m.variables[v].min, m.variables[v].max, 6), means.largest);
    fmt::print(
        "           errors of stored values: at most {:.1e}, typically {:.1e}; of changes within a sample: "
        "{:.1e}, {:.1e}\n",
        means.largest, means.typical, slopes.largest, slopes.typical);
    printPictureError(reader, v, {means, slopes});
    printSpread("", stepHistogram(reader, v));
    if (reader.series().steps.size() > 1) printSpread(", all steps", seriesHistogram(reader, v));
  }
  fmt::print("\nlevel    bricks    leaves        splats   geometry B     values B      error\n");
  const std::vector<LevelSummary> levels = levelsOf(reader);
  for (size_t n = 0; n < levels.size(); ++n)
    fmt::print("{:>5} {:>9} {:>9} {:>13} {:>12} {:>12} {:>10.3g}\n", n, levels[n].bricks, levels[n].leaves,
               levels[n].splats, levels[n].geometry_bytes, levels[n].values_bytes, levels[n].largest_error);
  printFiles(reader);
  if (options.verify && found.verification.findings.empty())
    fmt::print("\nverified: all {} bricks are intact{}\n", m.bricks,
               reader.series().steps.size() > 1
                   ? fmt::format(", at all {} time steps", reader.series().steps.size())
                   : "");
  for (const std::string& finding : found.verification.findings) printLine("finding: {}", finding);
  for (const std::string& note : found.verification.notes) printLine("note: {}", note);
}

void printCacheInfo(const InfoOptions& options) {
  if (options.probe.of_source && !options.probe.any())
    throw UsageError("--source: is read at points; add --probe X,Y,Z or --probe-line");
  if (!options.grid.solutions.empty())
    throw UsageError("{}: is a splat cache, but solution files were given as well; give only the cache",
                     options.grid.grid.string());
  std::vector<CacheReader> readers;  // the cache, and those of scalars with blanks of their own
  readers.push_back(openAtStep(options.grid.grid, options.steps));
  for (size_t n = 0; n < readers[0].seriesManifest().own_blanks.size(); ++n)
    readers.push_back(readers[0].ownBlanks(n));
  std::vector<Findings> found;
  const std::vector<StepPosition> positions = chosenSteps(options.steps, readers[0]);
  for (const CacheReader& reader : readers) found.push_back(examine(reader, positions, options));
  Json json;
  if (options.json) json = cacheAsJson(readers[0], options, found[0]);
  for (size_t n = 1; n < readers.size() && options.json; ++n)
    json["own_blanks"][n - 1] = cacheAsJson(readers[n], options, found[n]);
  std::vector<Probe> probes;
  for (Findings& of_reader : found) probes.push_back(std::move(of_reader.probe));
  const Probe joined = joinedProbe(readers, std::move(probes));
  if (options.json && options.probe.any()) json["probe"] = probeAsJson(readers, joined);
  if (!options.probe.plot.empty()) plotLine(readers, joined, options.probe.plot);
  if (options.json) fmt::print("{}\n", json.dump(2, ' ', false, Json::error_handler_t::replace));
  if (options.probe.any() && !options.json) printProbe(readers, joined);
  for (size_t n = 0; n < readers.size() && !options.json; ++n) {
    if (options.probe.any() && !options.verify) continue;
    if (n > 0) {
      fmt::print("\n");
      printLine("values at other samples: {}",
                fmt::join(readers[0].seriesManifest().own_blanks[n - 1].variables, ", "));
    }
    printCacheAsText(readers[n], options, found[n]);
  }
  if (hasUnfinished(options.grid.grid))
    printMessage("note: a conversion that replaces this cache is in progress or was interrupted");
  size_t findings = 0;
  for (const Findings& of_reader : found) findings += of_reader.verification.findings.size();
  if (findings > 0)
    throw Error("{}: the cache is damaged ({}); convert the grid again", options.grid.grid.string(),
                countText(findings, "finding"));
  if (options.probe.any() && joined.isOutside()) {
    glm::dvec3 lower = readers[0].manifest().lower, upper = readers[0].manifest().upper;
    for (const CacheReader& reader : readers) {
      lower = glm::min(lower, reader.manifest().lower);
      upper = glm::max(upper, reader.manifest().upper);
    }
    const glm::dvec3& point = joined.asked.points.front();
    throw Error(
        "{}: the point {}, {}, {} is outside of the data, which lies in x {:.6g} to {:.6g}, y {:.6g} to "
        "{:.6g}, z {:.6g} to {:.6g}",
        options.grid.grid.string(), point.x, point.y, point.z, lower.x, upper.x, lower.y, upper.y, lower.z,
        upper.z);
  }
}

void printInfo(const InfoOptions& options) {
  if (options.system != options.grid.grid.empty())
    throw UsageError("info: expected exactly one of a cache, a grid file and --system");
  if (options.system) return printSystem(options.json);
  const fs::path& path = options.grid.grid;
  const bool is_cache = fs::is_directory(path) && !isGridFolder(path);
  if (is_cache || (!fs::exists(path) && hasUnfinished(path))) return printCacheInfo(options);
  if (options.verify || options.probe.any())
    throw UsageError("{}: is not a splat cache (a directory); --verify and --probe need one",
                     options.grid.grid.string());
  printGridInfo(options.grid, {options.gas, std::nullopt}, options.json);
}

void addProbeOptions(CLI::App& info, InfoOptions& options) {
  constexpr const char* kProbe = "Probe";
  CLI::Option* const probe =
      info.add_option(
              "--probe", options.probe.at,
              "Print the values at x,y,z and the nearest node or cell (block, i, j, k) alone, with exit "
              "status 1 if the point is outside the data; or a table of the values at all points of a "
              "file, whose lines begin with x,y,z")
          ->group(kProbe);
  CLI::Option* const line = info.add_option("--probe-line", options.probe.line,
                                            "Print a table of the values at N points from x,y,z to x,y,z")
                                ->group(kProbe)
                                ->type_name("FROM TO N")
                                ->expected(3)
                                ->excludes(probe);
  addSourceOption(info, options.probe.source)->group(kProbe);
  info.add_option("-o,--output", options.probe.plot, "Draw the values along the line into this PNG file")
      ->group(kProbe)
      ->needs(line);
  addStepsOption(info, options.steps.steps, "; the values of each are printed")->group(kProbe);
}

}  // namespace

void addInfo(CLI::App& app) {
  CLI::App* info = app.add_subcommand("info", "Print the contents of a cache or a grid");
  const auto options = std::make_shared<InfoOptions>();
  info->add_option("PATH", options->grid.grid, "Splat cache (a directory) or grid file");
  info->add_option("SOLUTION", options->grid.solutions, "Further files of the grid, as for convert");
  info->add_flag("--json", options->json, "Print one JSON object");
  info->add_flag("--system", options->system, "Print the drawing back ends of this machine instead");
  info->add_flag("--verify", options->verify,
                 "Read the whole cache and check it; exit with status 1 if it is damaged");
  addProbeOptions(*info, *options);
  addStepOptions(*info, options->steps, "Time steps");
  addGridOptions(*info, options->grid);
  addGasOptions(*info, options->gas);
  info->callback([options, info] {
    options->probe.of_source = info->count("--source") > 0;
    std::erase(options->probe.source, "");  // what CLI11 makes of an option without values
    printInfo(*options);
  });
}

}  // namespace curvisplat
