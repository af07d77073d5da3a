#include "preprocess/formats/plot3d/plot3d_source.h"

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <set>

#include "preprocess/formats/common/byte_source.h"
#include "preprocess/formats/common/described_source.h"
#include "preprocess/formats/plot3d/plot3d_detect.h"
#include "preprocess/grid/grid_source.h"
#include "stream/base/error.h"
#include "stream/base/file.h"
#include "stream/base/json_document.h"
#include "stream/base/text.h"

namespace curvisplat {
namespace {

const std::vector<GridScalar>& qScalars() {
  static const std::vector<GridScalar> scalars = {
      {"density", "", {"rho"}, 0},
      {"momentum_x", "", {"xmomentum", "rhou"}, 0},
      {"momentum_y", "", {"ymomentum", "rhov"}, 0},
      {"momentum_z", "", {"zmomentum", "rhow"}, 0},
      {"energy", "", {"stagnationenergy", "rhoe"}, 0},
  };
  return scalars;
}

/// The lines of a .nam file. FieldView's suffix after a semicolon (the name of the vector) is cut off.
std::vector<std::string> variableNames(const std::filesystem::path& path) {
  std::vector<std::string> names;
  const std::string text = readTextFile(path, 1 << 20);
  for (size_t begin = 0; begin < text.size();) {
    const size_t end = std::min(text.find('\n', begin), text.size());
    const std::string_view line = std::string_view(text).substr(begin, end - begin);
    const std::string_view name = trimmed(line.substr(0, line.find(';')));
    if (!name.empty()) names.emplace_back(name);
    begin = end + 1;
  }
  return names;
}

}  // namespace

Plot3dSource::Plot3dSource(const OpenGridOptions& options)
    : grid_path_(options.grid), function_names_(options.function_names), grid_(openGridFile(options)) {
  for (const std::filesystem::path& path : options.solutions) addSolution(path, options);
  makeNamesUnique();
}

Plot3dFile Plot3dSource::openGridFile(const OpenGridOptions& options) {
  DetectedPlot3d detected =
      detectPlot3dGrid(std::make_shared<InputFile>(options.grid), options.force, options.temporary_folder);
  description_.coordinate_bytes = detected.written_precision_bytes;
  Plot3dFile file(std::move(detected.fit));
  for (const Plot3dBlock& block : file.blocks())
    description_.blocks.push_back({fmt::format("block {}", description_.blocks.size() + 1), block.ni,
                                   block.nj, block.nk, file.layout().blanking});
  description_.format = "PLOT3D";
  describe(options.grid, file);
  return file;
}

void Plot3dSource::addSolution(const std::filesystem::path& path, const OpenGridOptions& options) {
  Plot3dFile file(detectPlot3dSolution(std::make_shared<InputFile>(path), options.force,
                                       options.temporary_folder, grid_path_, grid_.blocks())
                      .fit);
  describe(path, file);
  for (uint32_t component = 0; component < file.components(); ++component)
    components_.push_back({solutions_.size(), component});
  if (file.layout().kind != Plot3dKind::kFunction) {
    description_.scalars.insert(description_.scalars.end(), qScalars().begin(), qScalars().end());
    if (file.layout().kind == Plot3dKind::kOverflow) addOverflowScalars(file);
    for (uint32_t block = 0; block < file.blocks().size(); ++block) {
      description_.flow.push_back(file.conditions(block));
      description_.flow.back().file = path.string();
    }
  } else {
    addFunctionNames(path, file);
  }
  solutions_.push_back(std::move(file));
  solution_paths_.push_back(path);
}

/// Adds the scalars of an OVERFLOW file that follow the five of every Q file.
void Plot3dSource::addOverflowScalars(const Plot3dFile& file) {
  const auto add = [&](std::string name) {
    GridScalar scalar;
    scalar.name = std::move(name);
    description_.scalars.push_back(std::move(scalar));
  };
  if (const double gamma = file.freestreamGamma(); gamma > 1 && gamma < 10) description_.gas.gamma = gamma;
  if (file.components() == 5) return;
  add("gamma");
  for (uint32_t n = 6; n < file.components(); ++n)
    add(n - 6 < file.species() ? fmt::format("species_{}", n - 5)
                               : fmt::format("turbulence_{}", n - 5 - file.species()));
  description_.warnings.push_back(
      fmt::format("{}: gamma varies between nodes; derived quantities use one value (--gamma)",
                  description_.files.back()));
}

void Plot3dSource::addFunctionNames(const std::filesystem::path& path, const Plot3dFile& file) {
  std::filesystem::path names_path = path;
  names_path.replace_extension(".nam");
  std::vector<std::string> names = function_names_;
  if (!names.empty()) names_path = path;
  std::error_code none_there;
  if (names.empty() && std::filesystem::exists(names_path, none_there)) names = variableNames(names_path);
  if (!names.empty()) {
    if (names.size() != file.components())
      description_.warnings.push_back(fmt::format("{}: has {} names for the {} variables of {}",
                                                  names_path.string(), names.size(), file.components(),
                                                  path.string()));
  }
  for (uint32_t n = 0; n < file.components(); ++n) {
    GridScalar scalar;
    scalar.number = n + 1;
    scalar.name = n < names.size() ? names[n] : std::to_string(n + 1);
    description_.scalars.push_back(std::move(scalar));
  }
}

void Plot3dSource::describe(const std::filesystem::path& path, const Plot3dFile& file) {
  description_.files.push_back(path.string());
  description_.format += fmt::format("{} {} {}: {}", description_.files.size() == 1 ? "" : ";",
                                     curvisplat::describe(file.layout().kind), path.filename().string(),
                                     curvisplat::describe(file.layout()));
  if (file.trailingBytes() == 0) return;
  if (file.layout().ascii)
    description_.warnings.push_back(fmt::format("{}: {} trailing numbers ignored", path.filename().string(),
                                                file.trailingBytes() / sizeof(double)));
  else
    description_.warnings.push_back(
        fmt::format("{}: {} trailing bytes ignored", path.filename().string(), file.trailingBytes()));
}

void Plot3dSource::makeNamesUnique() {
  std::vector<GridScalar>& scalars = description_.scalars;
  std::multiset<std::string> names;
  for (const GridScalar& scalar : scalars) names.insert(scalar.name);
  std::set<std::string> unique;
  for (size_t n = 0; n < scalars.size(); ++n) {
    if (names.count(scalars[n].name) > 1)
      scalars[n].name = solution_paths_[components_[n].file].stem().string() + ":" + scalars[n].name;
    if (!unique.insert(scalars[n].name).second)
      throw Error("{}: two scalars have the name {}; rename the file, or a variable in its .nam file",
                  solution_paths_[components_[n].file].string(), scalars[n].name);
  }
}

bool Plot3dSource::readFringe(uint32_t block, const NodeBox& box, std::vector<uint8_t>& out) const {
  if (!grid_.layout().blanking) return false;
  std::vector<int32_t> iblank(static_cast<size_t>(nodesOf(description_.blocks[block], box)));
  grid_.readIblank(block, box, iblank);
  // -n: interpolated from block n. From its own one at a cut, where it meets itself.
  const int64_t own = -int64_t{block} - 1;
  out.resize(iblank.size());
  std::transform(iblank.begin(), iblank.end(), out.begin(),
                 [&](int32_t value) { return static_cast<uint8_t>(value < 0 && value != own); });
  return true;
}

void Plot3dSource::read(uint32_t block, const NodeBox& box, std::span<const uint32_t> scalars,
                        NodeArrays& out) const {
  CURVISPLAT_CHECK_OP(block, <, description_.blocks.size());
  const auto nodes = static_cast<size_t>(nodesOf(description_.blocks[block], box));
  std::vector<double>* const coordinates[] = {&out.x, &out.y, &out.z};
  for (uint32_t axis = 0; axis < 3; ++axis) {
    coordinates[axis]->resize(nodes);
    grid_.read(block, axis, box, *coordinates[axis]);
  }
  if (grid_.layout().blanking) {
    out.blank.resize(nodes);
    grid_.readBlank(block, box, out.blank);
  } else {
    out.blank.assign(nodes, 0);
  }
  out.scalars.resize(scalars.size());
  for (size_t n = 0; n < scalars.size(); ++n) {
    CURVISPLAT_CHECK_OP(scalars[n], <, components_.size());
    const Component& component = components_[scalars[n]];
    out.scalars[n].resize(nodes);
    solutions_[component.file].read(block, component.component, box, out.scalars[n]);
  }
}

namespace {

constexpr uint64_t kLargest = 1 << 20;

struct MetaStep {
  double time = 0;
  std::filesystem::path grid, q, function;  // as they are named; empty: not named
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

std::filesystem::path fileIn(const JsonField& entry, const char* name) {
  const auto field = entry.find(name);
  if (!field) return {};
  const std::string file = field->text();
  if (file.empty() || file.find('\0') != std::string::npos) field->fail("a file name");
  return file;
}

std::vector<MetaStep> stepsOf(const JsonField& meta) {
  const JsonField files = meta.at("filenames");
  std::vector<MetaStep> steps;
  for (const JsonField& entry : files.elements()) {
    const auto time = entry.find("time");
    MetaStep step{time ? time->number() : static_cast<double>(steps.size()), fileIn(entry, "xyz"),
                  fileIn(entry, "q"), fileIn(entry, "function")};
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

std::unique_ptr<DataSource> openPlot3dMeta(const OpenGridOptions& options) {
  const JsonDocument document(readTextFile(options.grid, kLargest), options.grid.string(),
                              "a .p3d description, which is JSON");
  const JsonField meta = document.root();
  const std::vector<MetaStep> steps = stepsOf(meta);
  std::vector<double> times;
  for (const MetaStep& each : steps) times.push_back(each.time);
  const uint32_t number = chosenTimeStep(options.grid.string(), times, options.time_step);
  const MetaStep& step = steps[number];
  std::vector<std::string> warnings;
  for (const std::string& key : unknownKeys(meta))
    warnings.push_back(fmt::format("{}: unknown key '{}' is ignored", options.grid.string(), key));

  OpenGridOptions of_step = options;
  const std::string who = options.grid.string() + ':';
  of_step.grid = existingFile(who, options.namesFolder(), step.grid);
  of_step.names_folder.reset();
  of_step.time_step.reset();
  takeLayout(meta, of_step.force);
  if (const auto names = meta.find("function-names"); names && of_step.function_names.empty())
    of_step.function_names = names->texts();
  of_step.solutions.clear();
  for (const auto& named : {step.q, step.function}) {
    if (named.empty()) continue;
    const std::filesystem::path solution = namedFile(who, options.namesFolder(), named);
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
