#include "tools/options/convert_arguments.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdio>
#include <set>
#include <system_error>

#include "preprocess/grid/refined_source.h"
#include "stream/base/error.h"
#include "stream/base/message.h"
#include "stream/base/process_usage.h"
#include "stream/cache/geometry_folder.h"
#include "tools/options/choices.h"
#include "tools/options/face_names.h"
#include "tools/options/grid_options.h"
#include "tools/options/value_precision.h"
#include "tools/output/output_paths.h"

namespace curvisplat {
namespace {

constexpr size_t kMaxDefaultScalars = 16;

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

/// Scalars that are not converted unasked, by the reason.
struct LeftOut {
  std::vector<std::string> other_centring, others;

  void printNotes(Centring centring) const {
    const auto print = [](const std::vector<std::string>& names, const std::string& why) {
      if (!names.empty())
        printMessage("note: left out: {}{} --scalar NAME,NAME", fmt::join(names, ", "), why);
    };
    const bool cells = centring == Centring::kCell;
    print(other_centring,
          fmt::format(", {}-centred: this cache holds the {}-centred scalars; convert the others to a second "
                      "cache with",
                      cells ? "node" : "cell", cells ? "cell" : "node"));
    print(others, "; choose scalars with");
  }
};

/// The scalars that the files store, which can share a cache with the first: each name once.
std::vector<uint32_t> storedScalars(const GridDescription& description) {
  std::vector<uint32_t> positions;
  LeftOut left_out;
  std::set<std::string> names;
  for (uint32_t n = 0; n < description.scalars.size(); ++n) {
    const GridScalar& scalar = description.scalars[n];
    if (scalar.derived) continue;
    const bool fits = positions.empty() || scalar.centring == description.scalars[positions[0]].centring;
    if (fits && positions.size() < kMaxDefaultScalars && names.insert(scalar.name).second)
      positions.push_back(n);
    else
      (fits ? left_out.others : left_out.other_centring).push_back(scalar.name);
  }
  if (!positions.empty()) left_out.printNotes(description.scalars[positions[0]].centring);
  return positions;
}

/// What --refine says, or how the cache is refined that is added to or continued. Throws UsageError if these differ.
uint32_t partsFor(const ConvertArguments& arguments, const std::filesystem::path& cache) {
  const bool adds = arguments.adds_steps || !arguments.added_scalars.empty();
  const bool continues = arguments.resume && !arguments.overwrite;
  std::error_code ignored;  // what is wrong with a cache is said where it is changed
  if (!(adds || continues) || !std::filesystem::exists(cache / "manifest.json", ignored))
    return arguments.refine.value_or(1);
  const uint32_t parts = readManifest(cache).refined;
  if (arguments.refine && *arguments.refine != parts)
    throw UsageError("--refine {}: {} was converted with --refine {}; leave the option out",
                     *arguments.refine, cache.string(), parts);
  return parts;
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
  return refinedBy(partsFor(arguments, cache), std::move(source), arguments.blank_value);
}

std::unique_ptr<DataSource> refinedBy(uint32_t parts, std::unique_ptr<DataSource> source,
                                      std::optional<double> blank_value) {
  if (parts == 1) return source;
  return refined(requireGrid(std::move(source), "cannot be refined; --refine is for structured grids"), parts,
                 blank_value);
}

std::vector<uint32_t> chooseScalars(const ConvertArguments& arguments, const std::vector<std::string>& names,
                                    const GridDescription& description) {
  try {
    std::vector<uint32_t> stored;
    std::vector<std::string> words;
    for (const std::string& name : names) {
      if (isScalar(description, name))
        words.push_back(name);
      else if (name == "all")
        stored = storedScalars(description);
      else
        for (const std::string& part : splitAtCommas(name)) words.push_back(part);
    }
    if (names.empty()) stored = storedScalars(description);
    if (words.empty() && !stored.empty()) return stored;
    for (const std::string& note : notesOnNumbers(description, words)) printMessage("note: {}", note);
    for (const uint32_t position : scalarsNamed(description, words))
      if (std::find(stored.begin(), stored.end(), position) == stored.end()) stored.push_back(position);
    return stored;
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
    checkOutputFile("--stats", arguments.statistics, gridAndCaches(arguments));
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
      const auto name = parseFaceName(text);
      const bool has_range = name && (name->ranges[0] || name->ranges[1] || name->ranges[2]);
      if (!name || name->at != FaceName::At::kIndex || has_range)
        throw UsageError(
            "--surface {}: expected an index plane such as k=10 or \"block 1:k=10\", indices from 0 (the "
            "outer "
            "faces go into the cache anyway)",
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

}  // namespace curvisplat
