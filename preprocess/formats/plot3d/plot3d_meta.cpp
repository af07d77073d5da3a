#include "preprocess/formats/plot3d/plot3d_meta.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <set>

#include "preprocess/formats/plot3d/plot3d_source.h"
#include "preprocess/grid/time_steps.h"
#include "stream/base/error.h"
#include "stream/base/json_text.h"
#include "stream/base/paths.h"

namespace curvisplat {
namespace {

using Json = nlohmann::json;

constexpr uint64_t kLargest = 1 << 20;

/// The contents of a .p3d file, with types checked.
class Meta {
 public:
  explicit Meta(const std::filesystem::path& path) : path_(path) {
    const std::string text = readTextFile(path, kLargest);
    requireShallowJson(text, path.string());
    try {
      json_ = Json::parse(text);
    } catch (const Json::exception& error) {
      throw Error("{}: not valid JSON (.p3d files are JSON): found {}", path.string(),
                  jsonFault(text, error));
    }
    if (!json_.is_object()) fail("", "an object", json_);
    readSteps();
  }

  struct Step {
    double time = 0;
    std::filesystem::path grid, q, function;  // empty: not named
  };
  const std::vector<Step>& steps() const { return steps_; }

  std::optional<bool> flag(const char* key) const {
    const Json* value = find(json_, key);
    if (!value) return std::nullopt;
    if (!value->is_boolean()) fail(key, "true or false", *value);
    return value->get<bool>();
  }
  std::optional<double> number(const char* key) const { return numberIn(json_, key); }
  /// The value of `key`, which must be one of `words`, ignoring case.
  std::optional<std::string> word(const char* key, std::initializer_list<const char*> words) const {
    const Json* value = find(json_, key);
    if (!value) return std::nullopt;
    std::string text = value->is_string() ? value->get<std::string>() : std::string();
    for (char& c : text) c = c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
    std::string all;
    for (const char* one : words) {
      if (text == one) return text;
      all += fmt::format("{}\"{}\"", all.empty() ? "" : " or ", one);
    }
    fail(key, all, *value);
  }
  std::vector<std::string> texts(const char* key) const {
    std::vector<std::string> out;
    const Json* values = find(json_, key);
    if (!values) return out;
    if (!values->is_array()) fail(key, "an array of strings", *values);
    for (const Json& value : *values) {
      if (!value.is_string()) fail(key, "an array of strings", *values);
      out.push_back(value.get<std::string>());
    }
    return out;
  }

  std::vector<std::string> unknownKeys() const {
    static const std::set<std::string> known{
        "auto-detect-format", "byte-order", "precision", "multi-grid", "format",    "blanking",
        "language",           "2D",         "R",         "gamma",      "functions", "filenames",
        "function-names"};
    std::vector<std::string> unknown;
    for (const auto& [key, value] : json_.items())
      if (!known.contains(key)) unknown.push_back(key);
    return unknown;
  }

  [[noreturn]] void fail(const std::string& key, const std::string& expected, const Json& found) const {
    std::string shown = found.dump(-1, ' ', false, Json::error_handler_t::replace);
    if (shown.size() > 60) shown = shown.substr(0, 60) + "...";
    throw Error("{0}: {1} is {3}; expected {2}", path_.string(),
                key.empty() ? "the .p3d description" : "'" + key + "'", expected, shown);
  }

 private:
  static const Json* find(const Json& in, const char* key) {
    const auto found = in.find(key);
    return found == in.end() || found->is_null() ? nullptr : &*found;
  }

  std::optional<double> numberIn(const Json& in, const char* key) const {
    const Json* value = find(in, key);
    if (!value) return std::nullopt;
    if (!value->is_number() || !std::isfinite(value->get<double>())) fail(key, "a finite number", *value);
    return value->get<double>();
  }

  std::filesystem::path fileIn(const Json& in, const char* key) const {
    const Json* value = find(in, key);
    if (!value) return {};
    const std::string name = value->is_string() ? value->get<std::string>() : std::string();
    if (name.empty() || name.find('\0') != std::string::npos) fail(key, "a file name", *value);
    return path_.parent_path() / name;
  }

  void readSteps() {
    const Json* filenames = find(json_, "filenames");
    if (!filenames || !filenames->is_array() || filenames->empty())
      fail("filenames", "an array of files, one per time step", filenames ? *filenames : Json());
    for (const Json& entry : *filenames) {
      if (!entry.is_object()) fail("filenames", "an array of objects", *filenames);
      Step step{numberIn(entry, "time").value_or(static_cast<double>(steps_.size())), fileIn(entry, "xyz"),
                fileIn(entry, "q"), fileIn(entry, "function")};
      // A grid that does not change is named only in the first step.
      if (step.grid.empty() && !steps_.empty()) step.grid = steps_.back().grid;
      if (step.grid.empty()) fail("xyz", "the name of a grid file", entry);
      steps_.push_back(std::move(step));
    }
  }

  const std::filesystem::path path_;
  Json json_;
  std::vector<Step> steps_;
};

template <typename Value>
void setIfOpen(std::optional<Value>& target, std::optional<Value> value) {
  if (!target) target = value;
}

/// Takes the file's settings of the layout where the user has set none.
void takeLayout(const Meta& meta, Plot3dForce& force) {
  if (meta.flag("2D").value_or(false)) meta.fail("2D", "false (only 3-D files are read)", Json(true));
  if (meta.flag("auto-detect-format").value_or(false)) return;
  if (const auto format = meta.word("format", {"binary", "ascii"}))
    setIfOpen(force.ascii, {*format == "ascii"});
  setIfOpen(force.multi_block, meta.flag("multi-grid"));
  setIfOpen(force.blanking, meta.flag("blanking"));
  if (force.ascii.value_or(false)) return;
  if (const auto order = meta.word("byte-order", {"little", "big"}))
    setIfOpen(force.byte_order, {*order == "big" ? ByteOrder::kBig : ByteOrder::kLittle});
  // Whether Fortran's markers have 4 or 8 bytes is detected.
  if (const auto language = meta.word("language", {"fortran", "c"}); language == "c")
    setIfOpen(force.records, {RecordMarkers::kNone});
  if (const auto bits = meta.number("precision")) {
    if (*bits != 32 && *bits != 64) meta.fail("precision", "32 or 64", Json(*bits));
    setIfOpen(force.precision_bytes, {*bits == 64 ? 8 : 4});
  }
}

/// A Plot3dSource with the times and the gas of the .p3d file.
class MetaSource final : public GridSource {
 public:
  MetaSource(std::unique_ptr<GridSource> files, GridDescription description)
      : files_(std::move(files)), description_(std::move(description)) {}

  const GridDescription& description() const override { return description_; }
  void read(uint32_t block, const NodeBox& box, std::span<const uint32_t> scalars,
            NodeArrays& out) const override {
    files_->read(block, box, scalars, out);
  }
  bool readFringe(uint32_t block, const NodeBox& box, std::vector<uint8_t>& out) const override {
    return files_->readFringe(block, box, out);
  }

 private:
  std::unique_ptr<GridSource> files_;
  GridDescription description_;
};

}  // namespace

bool isPlot3dMeta(const InputFile& file) {
  std::string begin(static_cast<size_t>(std::min<uint64_t>(file.size(), 64)), '\0');
  file.readAt(0, std::span(begin.data(), begin.size()));
  const size_t first = begin.find_first_not_of(" \t\r\n");
  if (first == std::string::npos || begin[first] != '{') return false;
  return std::all_of(begin.begin(), begin.end(), [](char c) { return c >= ' ' || (c >= '\t' && c <= '\r'); });
}

std::unique_ptr<GridSource> openPlot3dMeta(const OpenGridOptions& options) {
  const Meta meta(options.grid);
  std::vector<double> times;
  for (const Meta::Step& each : meta.steps()) times.push_back(each.time);
  const uint32_t number = chosenTimeStep(options.grid.string(), times, options.time_step);
  const Meta::Step& step = meta.steps()[number];
  std::vector<std::string> warnings;
  for (const std::string& key : meta.unknownKeys())
    warnings.push_back(fmt::format("{}: unknown key '{}' is ignored", options.grid.string(), key));

  OpenGridOptions of_step = options;
  of_step.grid = step.grid;
  of_step.time_step.reset();
  takeLayout(meta, of_step.force);
  if (of_step.function_names.empty()) of_step.function_names = meta.texts("function-names");
  if (!isRegularFile(step.grid))
    throw Error("{}: names the grid {}, which does not exist", options.grid.string(), step.grid.string());
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

  auto files = std::make_unique<Plot3dSource>(of_step);
  GridDescription description = files->description();
  description.files.push_back(options.grid.string());
  if (const auto gamma = meta.number("gamma")) description.gas.gamma = gamma;
  if (const auto constant = meta.number("R")) description.gas.constant = constant;
  description.times = std::move(times);
  description.time_step = number;
  description.warnings.insert(description.warnings.begin(), warnings.begin(), warnings.end());
  return std::make_unique<MetaSource>(std::move(files), std::move(description));
}

}  // namespace curvisplat
