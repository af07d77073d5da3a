#include "preprocess/formats/open/series_files.h"

#include <fmt/format.h>
#include <fnmatch.h>

#include <algorithm>
#include <cctype>
#include <charconv>
#include <initializer_list>
#include <map>
#include <set>
#include <utility>

#include "preprocess/formats/exodus/exodus_names.h"
#include "preprocess/formats/exodus/exodus_source.h"
#include "preprocess/formats/netcdf/fms_mosaic.h"
#include "preprocess/formats/netcdf/netcdf_tiles.h"
#include "preprocess/formats/open/open_grid.h"
#include "preprocess/formats/su2/su2_source.h"
#include "stream/base/error.h"
#include "stream/base/file.h"
#include "stream/base/text.h"

namespace curvisplat {
namespace {

namespace fs = std::filesystem;

bool isDigit(char c) {
  return std::isdigit(static_cast<unsigned char>(c)) != 0;
}

/// A number in a name: where it ends, and its value. Decimals: 0.0015, 1e-05.
struct NumberInName {
  size_t digits_end = 0;  // of the whole number
  size_t end = 0;         // with its decimals and its exponent
  double value = 0;
  std::string_view fraction;  // digits behind the point
  bool has_exponent = false;
};

/// The number that begins at `at`.
NumberInName numberAt(std::string_view text, size_t at) {
  NumberInName number;
  const auto skip_digits = [&](size_t from) {
    while (from < text.size() && isDigit(text[from])) ++from;
    return from;
  };
  number.digits_end = number.end = skip_digits(at);
  if (const size_t fraction = number.end + 1; number.end < text.size() && text[number.end] == '.') {
    const size_t end = skip_digits(fraction);
    if (end > fraction &&
        (end == text.size() || !std::isalpha(static_cast<unsigned char>(text[end])) || text[end] == 'e')) {
      number.fraction = text.substr(fraction, end - fraction);
      number.end = end;
    }
  }
  if (number.end + 1 < text.size() && text[number.end] == 'e' &&
      (text[number.end + 1] == '-' || text[number.end + 1] == '+')) {
    const size_t end = skip_digits(number.end + 2);
    number.has_exponent = end > number.end + 2;
    if (number.has_exponent) number.end = end;
  }
  std::from_chars(text.data() + at, text.data() + number.end, number.value);
  return number;
}

/// Whether a sign may stand at `at`: before a number and behind none.
bool hasSignAt(std::string_view text, size_t at) {
  return at + 1 < text.size() && text[at] == '-' && isDigit(text[at + 1]) &&
         (at == 0 || !isDigit(text[at - 1]));
}

/// How numbers in names are read.
struct NumberStyle {
  bool decimals = false, signs = false;
};

/// Natural order: runs of digits by the numbers that they are; with `decimals`, numbers with a point or an exponent, too.
bool comesBefore(const std::string& a, const std::string& b, const NumberStyle& style) {
  const bool decimals = style.decimals;
  size_t i = 0, j = 0;
  while (i < a.size() && j < b.size()) {
    if (const bool negative = style.signs && hasSignAt(a, i); style.signs && (negative || hasSignAt(b, j))) {
      if (negative != hasSignAt(b, j)) return negative;
      if (a.substr(i) == b.substr(j)) return false;
      return comesBefore(b.substr(j + 1), a.substr(i + 1), style);
    }
    if (decimals && isDigit(a[i]) && isDigit(b[j])) {
      const NumberInName of_a = numberAt(a, i), of_b = numberAt(b, j);
      if (of_a.value != of_b.value) return of_a.value < of_b.value;
      i = of_a.end;
      j = of_b.end;
    } else if (isDigit(a[i]) && isDigit(b[j])) {
      const auto number = [](const std::string& text, size_t& at) {
        const size_t end = numberAt(text, at).digits_end;
        const size_t first = std::min(text.find_first_not_of('0', at), end);
        at = end;
        return text.substr(first, end - first);
      };
      const std::string of_a = number(a, i), of_b = number(b, j);
      if (of_a.size() != of_b.size()) return of_a.size() < of_b.size();
      if (of_a != of_b) return of_a < of_b;
    } else {
      if (a[i] != b[j]) return a[i] < b[j];
      ++i;
      ++j;
    }
  }
  if (a.size() - i != b.size() - j) return a.size() - i < b.size() - j;
  return a < b;
}

/// Whether points in the names are those of decimal numbers (0.0005, 0.001, 0.0015), and not between two numbers (run1.9, run1.10):
/// there are exponents, or whole parts that differ, or fractions of several lengths of which one begins with a 0.
bool haveDecimals(const std::vector<fs::path>& paths) {
  std::set<size_t> lengths;
  std::set<std::string> wholes;
  bool zero = false, exponent = false;
  for (const fs::path& path : paths) {
    const std::string name = path.filename().string();
    for (size_t n = 0; n < name.size(); ++n) {
      if (!isDigit(name[n])) continue;
      const NumberInName number = numberAt(name, n);
      exponent = exponent || number.has_exponent;
      zero = zero || number.fraction.starts_with('0');
      // A whole number before the extension is a decimal without a fraction: Result-2.vtu.
      if (!number.fraction.empty() || number.end == name.rfind('.')) {
        lengths.insert(number.fraction.size());
        wholes.insert(name.substr(n, number.digits_end - n));
      }
      n = number.end - 1;
    }
  }
  const bool fractions = !lengths.empty() && *lengths.rbegin() > 0;
  return exponent || (fractions && (wholes.size() > 1 || (zero && lengths.size() > 1)));
}

/// Whether minus signs in the names are those of numbers (r-5, r0), and not the same ones in all (r-5, r-10).
bool haveSigns(const std::vector<fs::path>& paths) {
  std::set<size_t> counts;
  for (const fs::path& path : paths) {
    const std::string name = path.filename().string();
    size_t count = 0;
    for (size_t n = 0; n < name.size(); n = isDigit(name[n]) ? numberAt(name, n).end : n + 1)
      count += hasSignAt(name, n);
    counts.insert(count);
  }
  return counts.size() > 1;
}

/// The path as it is sorted: mesh.e-s002.2.0 comes after mesh.e.2.0.
std::string sortedAs(const fs::path& path) {
  std::string text = path.string();
  const ExodusName name = exodusName(path);
  if (!name.goes_on || !name.processor) return text;
  const size_t mark = text.rfind("-s"), end = text.find('.', mark);
  return text.substr(0, mark) + text.substr(end) + text.substr(mark, end - mark);
}

void sortNaturally(std::vector<fs::path>& paths) {
  const NumberStyle style{haveDecimals(paths), haveSigns(paths)};
  std::vector<std::pair<std::string, fs::path>> sorted;
  for (fs::path& path : paths) sorted.emplace_back(sortedAs(path), std::move(path));
  std::sort(sorted.begin(), sorted.end(),
            [&](const auto& a, const auto& b) { return comesBefore(a.first, b.first, style); });
  paths.clear();
  for (auto& [key, path] : sorted) paths.push_back(std::move(path));
  paths.erase(std::unique(paths.begin(), paths.end()), paths.end());
}

/// Whether the path is that of a NetCDF file, perhaps compressed, by its name.
bool isCalledNetcdf(fs::path path) {
  for (const char* compressed : {".gz", ".xz", ".zst"})
    if (path.extension() == compressed) path = path.stem();
  return path.extension() == ".nc" || path.extension() == ".nc4";
}

/// Whether the file is one of several parts of a map, of a processor each (netcdf_tiles.h).
bool isPartOfMap(const fs::path& path) {
  if (!isCalledNetcdf(path) || !isRegularFile(path)) return false;
  try {
    return NetcdfFile::recognises(InputFile(path)) && NetcdfDomain::of(NetcdfFile(path));
  } catch (const Error&) {
    return false;  // the reader says what is wrong
  }
}

/// The path with '#' for each number in its file name, decimals included: equal for the files of a series. The number of a tile stays: the
/// tiles of a cubed sphere are parts of one step.
std::string shapeOf(const fs::path& path, bool signs = false) {
  const std::string name = path.filename().string();
  std::string shape = path.parent_path().string() + "/";
  for (size_t n = 0; n < name.size(); ++n) {
    if (signs && hasSignAt(name, n)) continue;
    shape += isDigit(name[n]) ? '#' : name[n];
    if (isDigit(name[n])) n = numberAt(name, n).end - 1;
  }
  if (const auto tile = tileNumber(path); tile && isCalledNetcdf(path)) shape += fmt::format("/{}", *tile);
  return shape;
}

/// A file's name between its whole numbers, and these.
struct NameParts {
  std::vector<std::string> words, numbers;
};

NameParts partsOf(const std::string& name) {
  NameParts parts{{""}, {}};
  for (size_t n = 0; n < name.size(); ++n) {
    if (!isDigit(name[n])) {
      parts.words.back() += name[n];
      continue;
    }
    const size_t end = numberAt(name, n).digits_end;
    parts.numbers.push_back(name.substr(n, end - n));
    parts.words.emplace_back();
    n = end - 1;
  }
  return parts;
}

/// Whether a number behind this word is that of a processor or a block, and not a time: 2 surely, 1 if another number varies besides.
int isWordOfPieces(const std::string& before) {
  std::string word = lowerCase(before);
  word.erase(word.find_last_not_of("_-.") + 1);
  word.erase(0, word.find_last_of("_-. ") + 1);
  for (const char* sure :
       {"proc", "processor", "rank", "part", "piece", "partition", "subdomain", "domain", "block"})
    if (word == sure) return 2;
  return word == "p" || word == "pe" || word == "cpu" ? 1 : 0;
}

/// Finds the number that tells the pieces of a step apart in names of one shape, t0_p0 t0_p1 t1_p0 t1_p1: each step has all of them.
/// Returns that number of each file; nothing if all are steps.
std::vector<std::string> pieceNumbers(const std::vector<fs::path>& files) {
  const std::string ending = files.front().extension().string();
  if (std::ranges::none_of(
          std::initializer_list<const char*>{".vtu", ".vtk", ".vts", ".vtr", ".vti", ".cgns"},
          [&](const char* of_grids) { return ending == of_grids; }))
    return {};
  std::vector<NameParts> names;
  for (const fs::path& file : files) names.push_back(partsOf(file.filename().string()));
  if (std::ranges::any_of(
          names, [&](const NameParts& name) { return name.numbers.size() != names.front().numbers.size(); }))
    return {};
  for (size_t place = 0; place < names.front().numbers.size(); ++place) {
    const int word = isWordOfPieces(names.front().words[place]);
    std::set<std::string> pieces;
    std::set<std::vector<std::string>> steps;
    std::vector<std::string> found;
    for (const NameParts& name : names) {
      found.push_back(name.numbers[place]);
      pieces.insert(name.numbers[place]);
      std::vector<std::string> others = name.numbers;
      others.erase(others.begin() + static_cast<ptrdiff_t>(place));
      steps.insert(others);
    }
    if (pieces.size() > 1 && word + (steps.size() > 1) > 1 && word > 0 &&
        pieces.size() * steps.size() == files.size())
      return found;
  }
  return {};
}

/// Whether the file is one of several Exodus files of a run.
bool isOfExodusRun(const fs::path& path, const ExodusName& name) {
  return (name.goes_on || name.processor) && isRegularFile(path) && isExodus(InputFile(path));
}

/// The shapes of the files, the grid's first. The number at the end of the names stays where it tells the parts of a map apart.
std::vector<std::string> shapesOf(const OpenGridOptions& options) {
  std::vector<fs::path> files{options.grid};
  files.insert(files.end(), options.solutions.begin(), options.solutions.end());
  std::vector<std::string> shapes;
  std::map<std::string, std::vector<size_t>> alike;
  const bool signs = haveSigns(files);
  for (const fs::path& path : files) {
    const ExodusName name = exodusName(path);
    shapes.push_back(shapeOf(path, signs));
    if (isOfExodusRun(path, name)) {
      shapes.back() = shapeOf(path.parent_path() / name.run, signs);
      if (name.processor) shapes.back() += fmt::format("/{} of {}", *name.processor, name.processors);
    }
    alike[shapes.back()].push_back(shapes.size() - 1);
  }
  for (const auto& [shape, numbers] : alike) {
    if (numbers.size() < 2) continue;
    std::vector<fs::path> of_shape;
    for (const size_t n : numbers) of_shape.push_back(files[n]);
    const std::vector<std::string> pieces = pieceNumbers(of_shape);
    for (size_t n = 0; n < pieces.size(); ++n) shapes[numbers[n]] += "/" + pieces[n];
    if (isPartOfMap(files[numbers.front()]))
      for (const size_t n : numbers) {
        const std::string stem = files[n].stem().string();
        shapes[n] += "/" + stem.substr(stem.find_last_not_of("0123456789") + 1);
      }
  }
  return shapes;
}

/// A pattern for fnmatch(): "%04d" stands for a number. Empty if the path is no pattern.
std::string patternOf(const fs::path& path) {
  std::error_code ignored;
  if (fs::exists(path, ignored)) return "";
  const std::string name = path.filename().string();
  std::string pattern;
  bool is_pattern = name.find_first_of("*?[") != std::string::npos;
  for (size_t n = 0; n < name.size(); ++n) {
    size_t end = n + 1;
    while (name[n] == '%' && end < name.size() && isDigit(name[end])) ++end;
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
std::optional<uint64_t> numberOf(std::string_view text) {
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
    const auto number = numberOf(parts[n]);
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
    throw UsageError("{}: step {} is out of range; there are {} steps, from 0 to {}", option, selection.first,
                     count, count - 1);
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
  if (areZones(options)) return false;
  std::vector<std::string> shapes = shapesOf(options);
  std::sort(shapes.begin(), shapes.end());
  return std::adjacent_find(shapes.begin(), shapes.end()) != shapes.end();
}

std::vector<StepFiles> stepsByName(const OpenGridOptions& options) {
  if (areZones(options)) return {{options, options.grid.string()}};
  const Groups groups = groupsOf(options);
  std::vector<StepFiles> steps;
  for (size_t n = 0; n < groups.steps; ++n) {
    OpenGridOptions files = options;
    files.grid = fileAt(groups.grids, n);
    files.solutions.clear();
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
      fmt::join(others, ", "), others.size() == 1 ? "it" : "them");
}

}  // namespace curvisplat
