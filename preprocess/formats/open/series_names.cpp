#include "preprocess/formats/open/series_names.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <charconv>
#include <initializer_list>
#include <map>
#include <set>
#include <string_view>
#include <utility>

#include "preprocess/formats/exodus/exodus_names.h"
#include "preprocess/formats/exodus/exodus_source.h"
#include "preprocess/formats/netcdf/fms_mosaic.h"
#include "preprocess/formats/netcdf/netcdf_tiles.h"
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

}  // namespace

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

}  // namespace curvisplat
