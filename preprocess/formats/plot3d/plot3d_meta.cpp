#include "preprocess/formats/plot3d/plot3d_meta.h"

#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <set>

#include "preprocess/formats/common/described_source.h"
#include "preprocess/formats/common/named_file.h"
#include "preprocess/formats/plot3d/plot3d_source.h"
#include "preprocess/grid/time_steps.h"
#include "stream/base/error.h"
#include "stream/base/json_document.h"
#include "stream/base/paths.h"
#include "stream/base/words.h"

namespace curvisplat {
namespace {

constexpr uint64_t kLargest = 1 << 20;

struct MetaStep {
  double time = 0;
  std::filesystem::path grid, q, function;  // empty: not named
};

/// The value of `field`, which must be one of `words`, ignoring case.
std::string wordOf(const JsonField& field, std::initializer_list<const char*> words) {
  const std::string text = field.isText() ? lowerCase(field.text()) : std::string();
  std::string all;
  for (const char* one : words) {
    if (text == one) return text;
    all += fmt::format("{}\"{}\"", all.empty() ? "" : " or ", one);
  }
  field.fail(all);
}

std::optional<bool> flagIn(const JsonField& meta, const char* name) {
  const auto field = meta.find(name);
  return field ? std::optional(field->flag()) : std::nullopt;
}

std::vector<std::string> unknownKeys(const JsonField& meta) {
  static const std::set<std::string> known{
      "auto-detect-format", "byte-order", "precision", "multi-grid", "format",    "blanking",
      "language",           "2D",         "R",         "gamma",      "functions", "filenames",
      "function-names"};
  std::vector<std::string> unknown = meta.names();
  std::erase_if(unknown, [](const std::string& name) { return known.contains(name); });
  return unknown;
}

std::filesystem::path fileIn(const JsonField& entry, const char* name, const std::filesystem::path& folder) {
  const auto field = entry.find(name);
  if (!field) return {};
  const std::string file = field->text();
  if (file.empty() || file.find('\0') != std::string::npos) field->fail("a file name");
  return folder / file;
}

std::vector<MetaStep> stepsOf(const JsonField& meta, const std::filesystem::path& folder) {
  const JsonField files = meta.at("filenames");
  std::vector<MetaStep> steps;
  for (const JsonField& entry : files.elements()) {
    const auto time = entry.find("time");
    MetaStep step{time ? time->number() : static_cast<double>(steps.size()), fileIn(entry, "xyz", folder),
                  fileIn(entry, "q", folder), fileIn(entry, "function", folder)};
    // A grid that does not change is named only in the first step.
    if (step.grid.empty() && !steps.empty()) step.grid = steps.back().grid;
    if (step.grid.empty()) entry.fail("the name of a grid file, \"xyz\"");
    steps.push_back(std::move(step));
  }
  if (steps.empty()) files.fail("files, one per time step");
  return steps;
}

template <typename Value>
void setIfOpen(std::optional<Value>& target, std::optional<Value> value) {
  if (!target) target = value;
}

/// Takes the file's settings of the layout where the user has set none.
void takeLayout(const JsonField& meta, Plot3dForce& force) {
  if (flagIn(meta, "2D").value_or(false)) meta.at("2D").fail("false (only 3-D files are read)");
  if (flagIn(meta, "auto-detect-format").value_or(false)) return;
  if (const auto format = meta.find("format"))
    setIfOpen(force.ascii, {wordOf(*format, {"binary", "ascii"}) == "ascii"});
  setIfOpen(force.multi_block, flagIn(meta, "multi-grid"));
  setIfOpen(force.blanking, flagIn(meta, "blanking"));
  if (force.ascii.value_or(false)) return;
  if (const auto order = meta.find("byte-order"))
    setIfOpen(force.byte_order,
              {wordOf(*order, {"little", "big"}) == "big" ? ByteOrder::kBig : ByteOrder::kLittle});
  // Whether Fortran's markers have 4 or 8 bytes is detected.
  if (const auto language = meta.find("language"); language && wordOf(*language, {"fortran", "c"}) == "c")
    setIfOpen(force.records, {RecordMarkers::kNone});
  if (const auto bits = meta.find("precision")) {
    if (bits->json() != 32 && bits->json() != 64) bits->fail("32 or 64");
    setIfOpen(force.precision_bytes, {bits->json() == 64 ? 8 : 4});
  }
}

}  // namespace

bool isPlot3dMeta(const InputFile& file) {
  std::string begin(static_cast<size_t>(std::min<uint64_t>(file.size(), 64)), '\0');
  file.readAt(0, std::span(begin.data(), begin.size()));
  const size_t first = begin.find_first_not_of(" \t\r\n");
  if (first == std::string::npos || begin[first] != '{') return false;
  return std::all_of(begin.begin(), begin.end(), [](char c) { return c >= ' ' || (c >= '\t' && c <= '\r'); });
}

std::unique_ptr<GridSource> openPlot3dMeta(const OpenGridOptions& options) {
  const JsonDocument document(readTextFile(options.grid, kLargest), options.grid.string(),
                              "a .p3d description, which is JSON");
  const JsonField meta = document.root();
  const std::vector<MetaStep> steps = stepsOf(meta, options.namesFolder());
  std::vector<double> times;
  for (const MetaStep& each : steps) times.push_back(each.time);
  const uint32_t number = chosenTimeStep(options.grid.string(), times, options.time_step);
  const MetaStep& step = steps[number];
  std::vector<std::string> warnings;
  for (const std::string& key : unknownKeys(meta))
    warnings.push_back(fmt::format("{}: unknown key '{}' is ignored", options.grid.string(), key));

  OpenGridOptions of_step = options;
  of_step.grid = step.grid;
  of_step.names_folder.reset();
  of_step.time_step.reset();
  takeLayout(meta, of_step.force);
  if (const auto names = meta.find("function-names"); names && of_step.function_names.empty())
    of_step.function_names = names->texts();
  existingFile(options.grid.string() + ':', step.grid);
  of_step.solutions.clear();
  for (const auto& solution : {step.q, step.function}) {
    if (solution.empty()) continue;
    if (isRegularFile(solution))
      of_step.solutions.push_back(solution);
    else
      warnings.push_back(fmt::format("{}: names {}, which does not exist; left out", options.grid.string(),
                                     solution.string()));
  }
  of_step.solutions.insert(of_step.solutions.end(), options.solutions.begin(), options.solutions.end());

  std::unique_ptr<GridSource> files = std::make_unique<Plot3dSource>(of_step);
  GridDescription description = files->description();
  description.files.push_back(options.grid.string());
  if (const auto gamma = meta.find("gamma")) description.gas.gamma = gamma->number();
  if (const auto constant = meta.find("R")) description.gas.constant = constant->number();
  description.times = std::move(times);
  description.time_step = number;
  description.warnings.insert(description.warnings.begin(), warnings.begin(), warnings.end());
  return described(std::move(files), std::move(description));
}

}  // namespace curvisplat
