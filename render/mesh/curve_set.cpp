#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <limits>
#include <optional>
#include <system_error>

#include "render/mesh/curve_set.h"
#include "stream/base/error.h"
#include "stream/base/text.h"

namespace curvisplat {

std::pair<float, float> CurveSet::range() const {
  float low = std::numeric_limits<float>::infinity(), high = -low;
  for (const float value : values) {
    if (!std::isfinite(value)) continue;
    low = std::min(low, value);
    high = std::max(high, value);
  }
  return low <= high ? std::pair(low, high) : std::pair(0.0f, 0.0f);
}

CurveSet curveSetOf(const std::vector<glm::dvec3>& points, std::vector<uint32_t> begins,
                    std::vector<float> values) {
  CurveSet set;
  if (!points.empty()) set.origin = points.front();
  set.positions.reserve(points.size());
  for (const glm::dvec3& point : points) set.positions.emplace_back(point - set.origin);
  set.begins = std::move(begins);
  set.values = std::move(values);
  return set;
}

namespace {

constexpr size_t kMaxColumns = 1000;
constexpr double kMaxCoordinate = 1e38;  // differences of two are finite in single precision

class Rows {
 public:
  Rows(std::string_view text, const std::filesystem::path& path) : text_(text), path_(path) {}

  /// The words of the next line, none of an empty one; false at the end.
  bool next(std::vector<std::string_view>& words) {
    words.clear();
    if (at_ >= text_.size()) return false;
    ++number_;
    const size_t end = std::min(text_.find('\n', at_), text_.size());
    std::string_view line = text_.substr(at_, end - at_);
    at_ = end + 1;
    line = line.substr(0, line.find('#'));
    const bool has_commas = line.find_first_of(",;") != std::string_view::npos;
    for (bool more = !line.empty(); more;) {
      const size_t stop = std::min(line.find_first_of(has_commas ? ",;" : " \t\r"), line.size());
      const std::string_view word = trimmed(line.substr(0, stop));
      if (has_commas || !word.empty()) words.push_back(word);
      if (words.size() > kMaxColumns) fail("has more than {} columns", kMaxColumns);
      more = stop < line.size();
      line.remove_prefix(std::min(stop + 1, line.size()));
    }
    if (words.size() == 1 && words[0].empty()) words.clear();
    return true;
  }

  template <typename... Args>
  [[noreturn]] void fail(fmt::format_string<Args...> format, Args&&... args) const {
    std::string what = fmt::format(format, std::forward<Args>(args)...);
    std::replace_if(
        what.begin(), what.end(), [](unsigned char c) { return c < 32 || c == 127; }, '?');
    constexpr size_t kLongest = 400;
    if (what.size() > kLongest) what = what.substr(0, kLongest) + "...";
    throw Error("{}: line {}: {}", path_.string(), number_, what);
  }
  std::optional<double> number(std::string_view word) const {
    double value = 0;
    const auto [end, error] =
        std::from_chars(word.data() + word.starts_with('+'), word.data() + word.size(), value);
    if (word.empty() || error != std::errc() || end != word.data() + word.size()) return std::nullopt;
    return value;
  }

 private:
  static std::string_view trimmed(std::string_view word) {
    constexpr std::string_view kAround = " \t\r\"";
    const size_t begin = word.find_first_not_of(kAround);
    if (begin == std::string_view::npos) return {};
    return word.substr(begin, word.find_last_not_of(kAround) - begin + 1);
  }

  std::string_view text_;
  const std::filesystem::path& path_;
  size_t at_ = 0, number_ = 0;
};

/// The meaning of the columns.
struct Columns {
  std::array<size_t, 3> position{0, 1, 2};
  std::optional<size_t> id, scalar;
  size_t count = 3;
};

Columns columnsOf(const Rows& rows, const std::vector<std::string_view>& names, const std::string& scalar) {
  Columns columns;
  columns.count = names.size();
  std::vector<std::string> scalars;
  std::array<bool, 3> found{};
  for (size_t n = 0; n < names.size(); ++n) {
    const std::string name(names[n]), lower = lowerCase(name);
    if (name == scalar) columns.scalar = n;
    if (lower == "id" || lower == "line" || lower == "trajectory") columns.id = n;
    const size_t axis = lower.size() == 1 ? std::string_view("xyz").find(lower) : std::string_view::npos;
    if (axis < 3) {
      columns.position[axis] = n;
      found[axis] = true;
    } else {
      scalars.push_back(name);
    }
  }
  if (!found[0] || !found[1] || !found[2])
    rows.fail("has no columns x, y and z among {}; name them so", fmt::join(names, ", "));
  if (!scalar.empty() && !columns.scalar)
    rows.fail("has no column '{}'{}; it has {}", scalar, didYouMean(scalar, scalars),
              scalars.empty() ? "x, y and z only" : fmt::format("{}", fmt::join(scalars, ", ")));
  return columns;
}

}  // namespace

CurveSet parseCurveText(std::string_view text, const std::filesystem::path& path, const std::string& scalar,
                        bool as_points) {
  Rows rows(text, path);
  std::vector<glm::dvec3> points;
  std::vector<uint32_t> begins{0};
  std::vector<float> values;
  std::optional<Columns> columns;
  std::string id;
  const auto end_line = [&] {
    if (begins.back() < points.size()) begins.push_back(static_cast<uint32_t>(points.size()));
  };
  for (std::vector<std::string_view> words; rows.next(words);) {
    if (words.empty()) {
      end_line();
      continue;
    }
    if (!columns) {
      if (!rows.number(words[0])) {
        columns = columnsOf(rows, words, scalar);
        continue;
      }
      if (!scalar.empty())
        rows.fail("has no names of its columns; a first line such as x,y,z,{} names them", scalar);
      columns = Columns();
      columns->count = words.size();
      if (words.size() < 3) rows.fail("has {} columns; expected x, y and z", words.size());
    }
    if (words.size() != columns->count)
      rows.fail("has {} columns; expected {}", words.size(), columns->count);
    glm::dvec3 point;
    for (int axis = 0; axis < 3; ++axis) {
      const std::string_view word = words[columns->position[static_cast<size_t>(axis)]];
      const auto number = rows.number(word);
      if (!number || !(std::abs(*number) <= kMaxCoordinate))
        rows.fail("found '{}' for {}; expected a number up to {:g}", word, "xyz"[axis], kMaxCoordinate);
      point[axis] = *number;
    }
    if (columns->id && words[*columns->id] != id) {
      end_line();
      id = words[*columns->id];
    }
    if (points.size() >= std::numeric_limits<uint32_t>::max() - 1) rows.fail("has too many points");
    points.push_back(point);
    if (columns->scalar) {
      const std::string_view word = words[*columns->scalar];
      const auto number = rows.number(word);
      if (!number && !word.empty()) rows.fail("found '{}' for {}; expected a number", word, scalar);
      values.push_back(static_cast<float>(number.value_or(std::numeric_limits<double>::quiet_NaN())));
    }
    if (as_points) end_line();
  }
  end_line();
  if (points.empty()) throw Error("{}: has no points; expected lines of x,y,z", path.string());
  return curveSetOf(points, std::move(begins), std::move(values));
}

}  // namespace curvisplat
