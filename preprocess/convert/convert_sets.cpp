#include "preprocess/convert/convert_sets.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <map>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "preprocess/convert/memory_plan.h"
#include "preprocess/convert/mesh_origin.h"
#include "preprocess/convert/scan.h"
#include "preprocess/gather/mesh_reader.h"
#include "preprocess/grid/node_reader.h"
#include "stream/base/checksum.h"
#include "stream/base/file.h"
#include "stream/base/name_list.h"
#include "stream/base/ranks.h"
#include "stream/cache/series.h"

namespace curvisplat {
namespace {

using Scalars = std::vector<uint32_t>;

/// Scalars that have values at the same samples.
struct ScalarSet {
  Scalars scalars;
  uint64_t samples;  // that have values, and are blanked where one sample has to have values of all sets
};

struct ScalarSets {
  /// The largest one is the first, of several the one with the most values; then they are in the order of their first scalars.
  std::vector<ScalarSet> sets;
  Scalars without_values;  // at any sample
};

ScalarSets setsOf(const Scalars& scalars, const DifferingBlanks& differing) {
  ScalarSets found;
  std::vector<ScalarSet>& sets = found.sets;
  std::map<uint64_t, size_t> numbers;  // in `sets`, by BlankCounts::Lost::set
  for (size_t n = 0; n < scalars.size(); ++n) {
    const BlankCounts::Lost& lost = differing.lost()[n];
    if (lost.samples == 0 && !differing.isAnyDrawn()) {
      found.without_values.push_back(scalars[n]);
      continue;
    }
    const auto number = numbers.try_emplace(lost.set, sets.size()).first->second;
    if (number == sets.size()) sets.push_back({{}, lost.samples});
    sets[number].scalars.push_back(scalars[n]);
  }
  const auto largest = std::ranges::max_element(
      sets, {}, [](const ScalarSet& set) { return std::pair(set.scalars.size(), set.samples); });
  if (largest != sets.end()) std::rotate(sets.begin(), largest, largest + 1);
  return found;
}

/// Found without converting.
ScalarSets surveyedSets(const DataSource& source, const ConvertOptions& options, Progress& progress) {
  const auto* const grid = dynamic_cast<const GridSource*>(&source);
  const MemoryPlan plan =
      MemoryPlan::ofOptions(options.memory_bytes, options.scalars.size(), options.threads);
  progress.begin("scan", samplesOf(source.description()), "samples");
  try {
    const GridSurvey survey = grid ? surveyGrid(NodeReader(*grid, options.scalars, options.blank_value),
                                                plan.slab_bytes, {}, progress)
                                   : surveyMesh(MeshReader(dynamic_cast<const MeshSource&>(source),
                                                           options.scalars, options.blank_value),
                                                progress)
                                         .grid;
    if (survey.blanked.lost.empty()) return {{{options.scalars, 0}}, {}};
    return setsOf(options.scalars, DifferingBlanks(survey.blanked.lost, true));
  } catch (const DifferingBlanks& differing) {
    return setsOf(options.scalars, differing);
  }
}

std::vector<std::string> namesOf(const GridDescription& description, const Scalars& scalars) {
  std::vector<std::string> names;
  for (const uint32_t scalar : scalars) names.push_back(description.scalars[scalar].name);
  return names;
}

/// Converts the sets, each by itself.
class SetsConversion {
 public:
  SetsConversion(const DataSource& source, const ConvertOptions& options, ScalarSets found,
                 const ConvertScalars& convert)
      : description_(source.description()), options_(options), found_(std::move(found)), convert_(convert) {
    options_.scalars = found_.sets.front().scalars;
    options_.differing = DifferingScalars::kBlankAll;
  }

  ConvertReport run() {
    ConvertReport report = convert_(options_, [&](const std::filesystem::path& folder) {
      std::vector<OwnBlanks> made;
      for (size_t n = 1; n < found_.sets.size(); ++n)
        made.push_back(convertSet(found_.sets[n].scalars, folder / ownBlanksFolderName(n - 1)));
      return made;
    });
    addOwnBlanksTo(report);
    warnOfLeftOut(report);
    return report;
  }

 private:
  /// Converts scalars that have blanks of their own to a cache in `folder`, unless an interrupted conversion has. Returns what
  /// the manifest of the whole cache says of it.
  OwnBlanks convertSet(const Scalars& scalars, const std::filesystem::path& folder) {
    ConvertOptions options = options_;
    options.output = folder;
    options.scalars = scalars;
    options.temporary_folder = temporaryFolder(options_);
    options.overwrite = false;
    const std::filesystem::path manifest = folder / "manifest.json";
    std::vector<uint8_t> exists{options.resume && std::filesystem::exists(manifest)};
    exists = fromBytes<uint8_t>(options.ranks->broadcast(toBytes(exists)));
    if (exists[0] == 0) {
      const ConvertReport report = convert_(options, {});
      of_sets_.temporary_bytes = std::max(of_sets_.temporary_bytes, report.temporary_bytes);
      of_sets_.warnings.insert(of_sets_.warnings.end(), report.warnings.begin(), report.warnings.end());
    }
    const std::string text = readTextFile(manifest);
    const Manifest written = Manifest::fromJson(text, manifest);
    for (const FileInfo& file : written.files)
      of_sets_.files.push_back({folder.filename().string() + "/" + file.name, file.size});
    const bool one = scalars.size() == 1;
    of_sets_.notes.push_back(
        fmt::format("{} {} values at other samples than {}: {} of them; {} kept apart in the cache, and "
                    "--scalar draws {}",
                    listed(scalars), one ? "has" : "have", listed(options_.scalars),
                    written.nodes - written.blanked_nodes, one ? "it is" : "they are", one ? "it" : "each"));
    return {namesOf(description_, scalars), checksumOf(std::as_bytes(std::span(text)))};
  }

  void addOwnBlanksTo(ConvertReport& report) {
    report.files.insert(report.files.end(), of_sets_.files.begin(), of_sets_.files.end());
    report.notes.insert(report.notes.end(), of_sets_.notes.begin(), of_sets_.notes.end());
    report.temporary_bytes = std::max(report.temporary_bytes, of_sets_.temporary_bytes);
    for (std::string& warning : of_sets_.warnings)
      if (std::ranges::find(report.warnings, warning) == report.warnings.end())
        report.warnings.push_back(std::move(warning));
  }

  void warnOfLeftOut(ConvertReport& report) const {
    if (!found_.without_values.empty())
      report.warnings.push_back(
          fmt::format("left out: {}, without a value at any sample", listed(found_.without_values)));
  }

  std::string listed(const Scalars& scalars) const {
    return curvisplat::listed(namesOf(description_, scalars));
  }

  const GridDescription& description_;
  ConvertOptions options_;  // of the first set
  const ScalarSets found_;
  const ConvertScalars& convert_;
  ConvertReport of_sets_;  // of all others
};

}  // namespace

ConvertReport convertSets(const DataSource& source, const ConvertOptions& options,
                          const ConvertScalars& convert, Progress& progress) {
  if (options.differing == DifferingScalars::kBlankAll || options.scalars.size() < 2)
    return convert(options, {});
  const auto convert_each = [&](ScalarSets found) {
    return SetsConversion(source, options, std::move(found), convert).run();
  };
  // What an interrupted conversion has left is of the scalars that it kept.
  if (options.resume) return convert_each(surveyedSets(source, options, progress));
  try {
    return convert(options, {});
  } catch (const DifferingBlanks& differing) {
    return convert_each(setsOf(options.scalars, differing));
  }
}

}  // namespace curvisplat
