#include "preprocess/formats/open/series_files.h"

#include <fmt/format.h>
#include <fnmatch.h>

#include <algorithm>
#include <cctype>
#include <charconv>
#include <map>
#include <utility>

#include "preprocess/formats/exodus/exodus_names.h"
#include "preprocess/formats/gmsh/gmsh_source.h"
#include "preprocess/formats/open/open_grid.h"
#include "preprocess/formats/open/series_names.h"
#include "preprocess/formats/su2/su2_source.h"
#include "stream/base/error.h"
#include "stream/base/file.h"
#include "stream/base/name_list.h"

namespace curvisplat {
namespace {

namespace fs = std::filesystem;

/// A pattern for fnmatch(): "%04d" stands for a number. Empty if the path is no pattern.
std::string patternOf(const fs::path& path) {
  std::error_code ignored;
  if (fs::exists(path, ignored)) return "";
  const std::string name = path.filename().string();
  std::string pattern;
  bool is_pattern = name.find_first_of("*?[") != std::string::npos;
  for (size_t n = 0; n < name.size(); ++n) {
    size_t end = n + 1;
    while (name[n] == '%' && end < name.size() && std::isdigit(static_cast<unsigned char>(name[end]))) ++end;
    if (name[n] == '%' && end < name.size() && name[end] == 'd') {
      pattern += "[-0-9]*";
      is_pattern = true;
      n = end;
    } else {
      pattern += name[n];
    }
  }
  return is_pattern ? pattern : "";
}

/// "q.splats", where the steps q.* are converted to, and what an interrupted conversion has left.
bool isCache(const fs::directory_entry& entry) {
  std::error_code error;
  return entry.path().filename().string().find(".splats") != std::string::npos && entry.is_directory(error);
}

std::vector<fs::path> filesLike(const fs::path& path, const std::string& pattern) {
  std::vector<fs::path> files;
  std::error_code error;
  const fs::path folder = folderOf(path);
  for (const auto& entry : fs::directory_iterator(folder, error)) {
    const std::string name = entry.path().filename().string();
    if (isCache(entry)) continue;
    if (fnmatch(pattern.c_str(), name.c_str(), FNM_PERIOD) == 0)
      files.push_back(path.has_parent_path() ? folder / name : fs::path(name));
  }
  if (files.empty()) throw Error("{}: no file matches this pattern", path.string());
  sortNaturally(files);
  return files;
}

/// Whether these are a SU2 mesh of several zones and a restart file for each of them: one step, though the names of the
/// restart files differ in a number alone.
bool areZones(const OpenGridOptions& options) {
  if (options.solutions.size() < 2 || !isRegularFile(options.grid)) return false;
  const InputFile mesh(options.grid);
  return isSu2(mesh) && su2Zones(mesh) == options.solutions.size();
}

/// Whether the names that differ in a number alone are not those of steps.
bool areOneStep(const OpenGridOptions& options) {
  return areZones(options) || (!options.solutions.empty() && gmshFiles(options.grid) > 1);
}

/// The files of a series as its steps use them.
struct Groups {
  std::vector<fs::path> grids;                   // one, or one a step
  std::vector<std::vector<fs::path>> solutions;  // each one, or one a step
  size_t steps = 1;
};

Groups groupsOf(const OpenGridOptions& options) {
  Groups groups;
  groups.grids = {options.grid};
  std::map<std::string, size_t> group_of_shape;
  const std::vector<std::string> shapes = shapesOf(options);
  for (size_t n = 0; n < options.solutions.size(); ++n) {
    const fs::path& path = options.solutions[n];
    const std::string& shape = shapes[n + 1];
    if (shape == shapes[0]) {
      groups.grids.push_back(path);
      continue;
    }
    const auto [found, is_new] = group_of_shape.emplace(shape, groups.solutions.size());
    if (is_new) groups.solutions.emplace_back();
    groups.solutions[found->second].push_back(path);
  }
  sortNaturally(groups.grids);
  for (auto& group : groups.solutions) sortNaturally(group);
  const auto count = [&](const std::vector<fs::path>& files) {
    if (files.size() == 1) return;
    if (groups.steps > 1 && groups.steps != files.size())
      throw Error(
          "{}: has {} files of this kind, but {} of another; a series needs one of each kind for every step",
          files.front().string(), files.size(), groups.steps);
    groups.steps = files.size();
  };
  count(groups.grids);
  for (const auto& group : groups.solutions) count(group);
  return groups;
}

const fs::path& fileAt(const std::vector<fs::path>& files, size_t step) {
  return files.size() == 1 ? files.front() : files[step];
}

/// A number, or `otherwise` for an empty text.
std::optional<uint64_t> parsedNumber(std::string_view text) {
  uint64_t number = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  if (error != std::errc() || end != text.data() + text.size()) return std::nullopt;
  return number;
}

std::vector<StepFiles> stepsAt(size_t times, const StepFiles& files) {
  if (times <= 1) return {files};
  std::vector<StepFiles> steps(times, files);
  for (size_t time = 0; time < times; ++time) {
    steps[time].name += fmt::format(", time step {}", time);
    steps[time].options.time_step = static_cast<uint32_t>(time);
  }
  return steps;
}

/// The file is opened for its steps and then for each of them.
OpenGridOptions indexed(OpenGridOptions options) {
  options.index = std::make_shared<FileIndex>();
  return options;
}

}  // namespace

StepSelection parseSteps(const std::string& option, const std::string& text) {
  StepSelection selection;
  if (text == "all") return selection;
  std::vector<std::string_view> parts;
  for (size_t begin = 0; begin <= text.size();) {
    const size_t end = std::min(text.find(':', begin), text.size());
    parts.push_back(std::string_view(text).substr(begin, end - begin));
    begin = end + 1;
  }
  const auto fail = [&] {
    throw UsageError("{} {}: expected all, FIRST, FIRST:LAST or FIRST:LAST:STRIDE, such as 0:100:5", option,
                     text);
  };
  if (parts.size() > 3 || (parts.size() == 1 && parts[0].empty())) fail();
  for (size_t n = 0; n < parts.size(); ++n) {
    if (parts[n].empty()) continue;
    const auto number = parsedNumber(parts[n]);
    if (!number || (n == 2 && *number == 0)) fail();
    if (n == 0) selection.first = *number;
    if (n == 1 || parts.size() == 1) selection.last = *number;
    if (n == 2) selection.stride = *number;
  }
  if (selection.last && *selection.last < selection.first) fail();
  return selection;
}

std::vector<uint64_t> selectedSteps(const std::string& option, const StepSelection& selection,
                                    uint64_t count) {
  std::vector<uint64_t> numbers;
  const uint64_t end = selection.last && *selection.last < count ? *selection.last + 1 : count;
  for (uint64_t step = selection.first; step < end; step += std::min(selection.stride, count))
    numbers.push_back(step);
  if (numbers.empty())
    throw UsageError("{}: step {} is out of range; {}", option, selection.first,
                     count == 1 ? "there is one, step 0"
                                : fmt::format("there are {} steps, from 0 to {}", count, count - 1));
  return numbers;
}

void expandPatterns(OpenGridOptions& options) {
  std::vector<fs::path> solutions;
  if (const std::string pattern = patternOf(options.grid); !pattern.empty()) {
    const std::vector<fs::path> grids = filesLike(options.grid, pattern);
    options.grid = grids.front();
    solutions.assign(grids.begin() + 1, grids.end());
  }
  for (const fs::path& path : options.solutions) {
    const std::string pattern = patternOf(path);
    if (pattern.empty()) {
      solutions.push_back(path);
      continue;
    }
    const std::vector<fs::path> files = filesLike(path, pattern);
    solutions.insert(solutions.end(), files.begin(), files.end());
  }
  options.solutions = std::move(solutions);
}

bool hasSeveralStepFiles(const OpenGridOptions& options) {
  if (areOneStep(options)) return false;
  std::vector<std::string> shapes = shapesOf(options);
  std::sort(shapes.begin(), shapes.end());
  return std::adjacent_find(shapes.begin(), shapes.end()) != shapes.end();
}

std::vector<StepFiles> stepsByName(const OpenGridOptions& options) {
  if (areOneStep(options)) return {{options, options.grid.string()}};
  const Groups groups = groupsOf(options);
  std::vector<StepFiles> steps;
  OpenGridOptions of_each = options;
  of_each.solutions.clear();
  for (size_t n = 0; n < groups.steps; ++n) {
    OpenGridOptions files = of_each;
    files.grid = fileAt(groups.grids, n);
    for (const auto& group : groups.solutions) files.solutions.push_back(fileAt(group, n));
    // The others of an Exodus run are given, too; those of other processors are not.
    files.is_part = groups.steps > 1 && !exodusName(files.grid).processor;
    const bool names_grid = groups.grids.size() > 1 || files.solutions.empty();
    std::string name = files.grid.string();
    for (size_t g = 0; !names_grid && g < groups.solutions.size(); ++g)
      if (groups.solutions[g].size() > 1 || groups.steps == 1) name = files.solutions[g].string();
    steps.push_back({std::move(files), name});
  }
  return steps;
}

std::vector<StepFiles> stepsIn(const StepFiles& files) {
  try {
    const StepFiles of_index{indexed(files.options), files.name};
    return stepsAt(openData(of_index.options)->description().times.size(), of_index);
  } catch (const Error&) {
    return {files};  // the error is reported where the step is converted, or left out there
  }
}

std::vector<StepFiles> stepsOf(const OpenGridOptions& options) {
  std::vector<StepFiles> files = stepsByName(options);
  files.front().options = indexed(std::move(files.front().options));
  const size_t times = openData(files.front().options)->description().times.size();
  // Files of one kind are alike. Those of a kind that has no times, of which there may be many, are not opened.
  if (times == 0) return files;
  std::vector<StepFiles> steps = stepsAt(times, files.front());
  for (size_t n = 1; n < files.size(); ++n)
    for (StepFiles& step : stepsIn(files[n])) steps.push_back(std::move(step));
  return steps;
}

std::string noteOnLaterScalars(const GridDescription& first, const OpenGridOptions& later) {
  // Cases of OpenFOAM know the fields of all times; PLOT3D's text would be read as a whole, and has the same scalars.
  for (const char* format : {"OpenFOAM", "PLOT3D"})
    if (first.format.starts_with(format)) return "";
  std::vector<std::string> others;
  try {
    const auto source = openData(later);
    for (const GridScalar& scalar : source->description().scalars)
      if (std::none_of(first.scalars.begin(), first.scalars.end(),
                       [&](const GridScalar& known) { return known.name == scalar.name; }))
        others.push_back(scalar.name);
  } catch (const Error&) {
    return "";  // reported where the step is read
  }
  if (others.empty()) return "";
  return fmt::format(
      "the last step has {}, which the first one lacks: begin at a step that has {} (--steps FIRST:LAST)",
      listed(others), others.size() == 1 ? "it" : "them");
}

}  // namespace curvisplat
