#include "preprocess/formats/ensight/ensight_case.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <sstream>
#include <string_view>

#include "preprocess/formats/common/byte_source.h"
#include "preprocess/formats/common/text_reader.h"
#include "preprocess/grid/grid_source.h"
#include "stream/base/error.h"
#include "stream/base/name_list.h"
#include "stream/base/text.h"

namespace curvisplat {
namespace {

constexpr uint64_t kLooked = 2048;
constexpr double kMaxSteps = 1 << 20;

/// The steps of each file. Numbers are in the names where there are several.
struct FileSet {
  std::vector<double> numbers, steps;
};

struct TimeSet {
  std::vector<double> times, numbers;  // numbers: in the names of files
  double steps = 0, start = 0, increment = 1;
};

/// A line of GEOMETRY or VARIABLE: the sets of times and of files, if any, then words.
struct Entry {
  size_t time_set = 0;  // 0: none
  size_t file_set = 0;  // 0: none
  std::vector<std::string> words;
};

/// Words, of which those in quotation marks may have blanks; the marks are left out.
std::vector<std::string> unquotedWords(std::string_view text) {
  std::vector<std::string> words;
  while (!(text = trimmed(text)).empty()) {
    const bool quoted = text[0] == '"' && text.find('"', 1) != std::string_view::npos;
    const size_t end = quoted ? text.find('"', 1) : std::min(text.find_first_of(kWhiteSpace), text.size());
    words.emplace_back(text.substr(quoted ? 1 : 0, quoted ? end - 1 : end));
    text.remove_prefix(end + (quoted ? 1 : 0));
  }
  return words;
}

Entry entryOf(std::string_view value, size_t least) {
  Entry entry;
  const std::vector<std::string> words = unquotedWords(value);
  // Up to two whole numbers come first.
  size_t numbers = 0;
  for (; numbers < 2 && words.size() > least + numbers; ++numbers) {
    double number = 0;
    if (!parseNumber(words[numbers], number) || number < 1 || number > kMaxSteps) break;
    (numbers == 0 ? entry.time_set : entry.file_set) = static_cast<size_t>(number);
  }
  entry.words.assign(words.begin() + static_cast<ptrdiff_t>(numbers), words.end());
  return entry;
}

class CaseReader {
 public:
  CaseReader(const std::filesystem::path& path, const std::filesystem::path& folder)
      : path_(path), folder_(folder) {}
  EnsightCase run(std::optional<uint32_t> step);

 private:
  void readLines();
  void takeLine(std::string_view key, std::string_view value);
  void takeTime(std::string_view key, std::string_view value);
  void takeVariable(std::string_view key, std::string_view value);
  void takeFileSet(std::string_view key, std::string_view value);
  EnsightPlace placeOf(const Entry& entry, const std::string& name, double time) const;
  size_t stepOf(const Entry& entry, const std::string& name, double time) const;

  const std::filesystem::path &path_, &folder_;
  std::string section_, key_;
  std::string type_;
  std::optional<Entry> model_;
  struct Variable {
    EnsightVariable variable;
    Entry entry;
  };
  std::vector<Variable> variables_;
  std::map<size_t, TimeSet> sets_;
  TimeSet* set_ = nullptr;
  std::map<size_t, FileSet> file_sets_;
  FileSet* file_set_ = nullptr;
  std::vector<std::string> skipped_;
};

void CaseReader::readLines() {
  const auto file = std::make_shared<const PooledFile>(std::make_shared<OpenFiles>(), path_);
  TextReader text(file, 0, file->size());
  while (const auto line = text.line()) {
    const std::string_view words = trimmed(line->substr(0, line->find('#')));
    if (words.empty()) continue;
    const size_t colon = words.find(':');
    if (colon != std::string_view::npos) {
      takeLine(lowerCase(trimmed(words.substr(0, colon))), trimmed(words.substr(colon + 1)));
      continue;
    }
    double number = 0;
    if (parseNumber(wordsOf(words)[0], number))
      takeTime(key_, words);  // more numbers of the line above
    else
      section_ = lowerCase(words);
  }
}

void CaseReader::takeLine(std::string_view key, std::string_view value) {
  key_ = key;
  if (section_ == "format" && key == "type") type_ = lowerCase(value);
  if (section_ == "geometry" && key == "model") model_ = entryOf(value, 1);
  if (section_ == "geometry" && key != "model")
    skipped_.push_back(fmt::format("{} geometry", printable(key)));
  if (section_ == "variable") takeVariable(key, value);
  if (section_ == "time") takeTime(key, value);
  if (section_ == "file") takeFileSet(key, value);
}

void CaseReader::takeFileSet(std::string_view key, std::string_view value) {
  double number = 0;
  if (!parseNumber(wordsOf(value).empty() ? "" : wordsOf(value)[0], number) ||
      !(number >= 0 && number <= kMaxSteps))
    return;
  if (key == "file set") file_set_ = &file_sets_[static_cast<size_t>(number)];
  if (!file_set_) return;
  if (key == "filename index") file_set_->numbers.push_back(number);
  if (key == "number of steps") file_set_->steps.push_back(number);
}

void CaseReader::takeTime(std::string_view key, std::string_view value) {
  if (section_ != "time") return;
  std::vector<double> numbers;
  for (const std::string_view word : wordsOf(value)) {
    double number = 0;
    if (!parseNumber(word, number)) break;
    numbers.push_back(number);
  }
  if (numbers.empty()) return;
  if (key == "time set") {
    set_ = &sets_[numbers[0] >= 1 && numbers[0] <= kMaxSteps ? static_cast<size_t>(numbers[0]) : 1];
    return;
  }
  if (!set_)
    throw Error("{}: has '{}' before 'time set'; the file is damaged", path_.string(), printable(key));
  if (key == "number of steps") set_->steps = numbers[0];
  if (key == "filename start number") set_->start = numbers[0];
  if (key == "filename increment") set_->increment = numbers[0];
  if (key == "time values") set_->times.insert(set_->times.end(), numbers.begin(), numbers.end());
  if (key == "filename numbers") set_->numbers.insert(set_->numbers.end(), numbers.begin(), numbers.end());
}

void CaseReader::takeVariable(std::string_view key, std::string_view value) {
  Variable variable;
  const bool vector = key.starts_with("vector per ");
  if ((!vector && !key.starts_with("scalar per ")) || key.ends_with("measured node")) {
    if (!key.starts_with("constant ")) skipped_.push_back(fmt::format("'{}'", printable(key)));
    return;
  }
  variable.entry = entryOf(value, 2);
  if (variable.entry.words.size() < 2)
    throw Error("{}: '{}: {}' does not name a variable and its file; the file is damaged", path_.string(),
                printable(key), printable(value));
  variable.variable.name = variable.entry.words[0];
  variable.variable.components = vector ? 3 : 1;
  variable.variable.centring = key.ends_with("element") ? Centring::kCell : Centring::kNode;
  variables_.push_back(std::move(variable));
}

/// The last step of the entry's time set that is not later.
size_t CaseReader::stepOf(const Entry& entry, const std::string& name, double time) const {
  const auto found = sets_.find(std::max<size_t>(entry.time_set, 1));
  if (found == sets_.end() || found->second.times.empty())
    throw Error("{}: {} is of several steps, but there is no time set", path_.string(), printable(name));
  const std::vector<double>& times = found->second.times;
  const auto next = std::upper_bound(times.begin(), times.end(), time);
  return static_cast<size_t>(std::max<ptrdiff_t>(0, next - times.begin() - 1));
}

/// The place of the values of the time. Stars stand for the number of its step, or of the file that has it.
EnsightPlace CaseReader::placeOf(const Entry& entry, const std::string& name, double time) const {
  EnsightPlace place;
  std::string file = name;
  const size_t star = file.find('*');
  double number = 0;
  if (entry.file_set > 0) {
    const auto found = file_sets_.find(entry.file_set);
    if (found == file_sets_.end() || found->second.steps.empty())
      throw Error("{}: {} is of file set {}, which FILE does not have; the file is damaged", path_.string(),
                  printable(name), entry.file_set);
    const FileSet& set = found->second;
    auto step = static_cast<double>(stepOf(entry, name, time));
    size_t of_set = 0;
    while (of_set + 1 < set.steps.size() && step >= set.steps[of_set]) step -= set.steps[of_set++];
    if (step >= set.steps[of_set])
      throw Error("{}: file set {} has fewer steps than time set {}; the file is damaged", path_.string(),
                  entry.file_set, std::max<size_t>(entry.time_set, 1));
    place.step = static_cast<uint64_t>(step);
    place.steps = static_cast<uint64_t>(set.steps[of_set]);
    number = of_set < set.numbers.size() ? set.numbers[of_set] : 0;
  } else if (star != std::string::npos) {
    const size_t step = stepOf(entry, name, time);
    const TimeSet& set = sets_.at(std::max<size_t>(entry.time_set, 1));
    number =
        step < set.numbers.size() ? set.numbers[step] : set.start + static_cast<double>(step) * set.increment;
  }
  if (star != std::string::npos) {
    const size_t stars = std::min(file.find_first_not_of('*', star), file.size()) - star;
    if (!(number >= 0 && number < 1e15))
      throw Error("{}: the files of {} have the number {}; expected 0 or more", path_.string(),
                  printable(name), number);
    file = file.substr(0, star) + fmt::format("{:0{}}", static_cast<uint64_t>(number), stars) +
           file.substr(star + stars);
  }
  place.file = existingFile(path_.string() + ':', folder_, file);
  return place;
}

EnsightCase CaseReader::run(std::optional<uint32_t> step) {
  readLines();
  if (type_ != "ensight gold")
    throw Error(
        "{}: is of type '{}'; expected 'ensight gold' (EnSight 5 and 6 are not read: save it as Gold)",
        path_.string(), printable(type_));
  if (!model_ || model_->words.empty()) throw Error("{}: names no geometry (model:)", path_.string());
  EnsightCase result;
  for (const auto& [number, set] : sets_) {
    const bool finite =
        std::all_of(set.times.begin(), set.times.end(), [](double time) { return std::isfinite(time); });
    if (set.steps != static_cast<double>(set.times.size()) || !(set.steps <= kMaxSteps) || !finite ||
        !std::is_sorted(set.times.begin(), set.times.end()))
      throw Error(
          "{}: time set {} has {} times for {} steps, or times that are not finite or do not rise; the "
          "file is damaged",
          path_.string(), number, set.times.size(), numberText(set.steps));
    if (const auto equal = std::ranges::adjacent_find(set.times); equal != set.times.end())
      result.warnings.push_back(
          fmt::format("time set {} has several steps at time {:g}; the last one is read", number, *equal));
    result.times.insert(result.times.end(), set.times.begin(), set.times.end());
  }
  std::sort(result.times.begin(), result.times.end());
  result.times.erase(std::unique(result.times.begin(), result.times.end()), result.times.end());
  result.time_step = chosenTimeStep(path_.string(), result.times, step);
  const double time = result.times.empty() ? 0 : result.times[result.time_step];
  result.geometry = placeOf(*model_, model_->words[0], time);
  for (Variable& one : variables_) {
    one.variable.place = placeOf(one.entry, one.entry.words[1], time);
    result.variables.push_back(std::move(one.variable));
  }
  if (!skipped_.empty())
    result.warnings.push_back(
        fmt::format("left out: {}; scalars and vectors per node and per element are read", listed(skipped_)));
  return result;
}

}  // namespace

bool isEnsightCase(const InputFile& file) {
  std::string begin(static_cast<size_t>(std::min<uint64_t>(file.size(), kLooked)), '\0');
  file.readAt(0, std::span(begin.data(), begin.size()));
  if (begin.find('\0') != std::string::npos) return false;
  std::istringstream lines(begin);
  bool format = false;
  for (std::string line; std::getline(lines, line);) {
    const std::string words = lowerCase(trimmed(line));
    if (words.empty() || words[0] == '#') continue;
    if (format) return words.starts_with("type:") && words.find("ensight") != std::string::npos;
    if (words != "format") return false;
    format = true;
  }
  return false;
}

EnsightCase readEnsightCase(const std::filesystem::path& path, const std::filesystem::path& folder,
                            std::optional<uint32_t> step) {
  return CaseReader(path, folder).run(step);
}

}  // namespace curvisplat
