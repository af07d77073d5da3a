#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <limits>
#include <numeric>
#include <optional>
#include <system_error>

#include "render/mesh/curve_set.h"
#include "stream/base/error.h"
#include "stream/base/name_list.h"
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

uint64_t CurveSet::bytes() const {
  return positions.size() * sizeof(positions[0]) + begins.size() * sizeof(begins[0]) +
         values.size() * sizeof(values[0]) + times.size() * sizeof(times[0]);
}

CurveSet curveSetOf(const std::vector<glm::dvec3>& points, std::vector<uint32_t> begins,
                    std::vector<float> values, std::vector<double> times) {
  CurveSet set;
  if (!points.empty()) set.origin = points.front();
  set.positions.reserve(points.size());
  for (const glm::dvec3& point : points) set.positions.emplace_back(point - set.origin);
  set.begins = std::move(begins);
  set.values = std::move(values);
  set.times = std::move(times);
  return set;
}

CurveSet pointsOf(CurveSet set) {
  set.begins.resize(set.positions.size() + 1);
  std::iota(set.begins.begin(), set.begins.end(), 0u);
  return set;
}

namespace {

/// The way from one place to another around the middle of a sphere.
struct SphereArc {
  glm::dvec3 from, across;  // directions; across: at right angles to the first, towards the other one
  double angle, radius_from, radius_to;

  SphereArc(const glm::dvec3& a, const glm::dvec3& b)
      : from(glm::normalize(a)), radius_from(glm::length(a)), radius_to(glm::length(b)) {
    const glm::dvec3 to = glm::normalize(b), normal = glm::cross(from, to);
    angle = std::atan2(glm::length(normal), glm::dot(from, to));
    // Opposite places are joined by a pole, or, if they are the poles, by longitude 0. Places are floats from
    // the set's first point on, so that opposite ones are so to some 1e-7.
    constexpr double kOpposite = 1e-6, kPole = 1 - 1e-10;
    const glm::dvec3 by = std::abs(from.z) < kPole ? glm::dvec3(0, 0, 1) : glm::dvec3(1, 0, 0);
    const glm::dvec3 towards = glm::length(normal) < kOpposite ? by : to;
    across = glm::normalize(towards - glm::dot(towards, from) * from);
  }
  glm::dvec3 at(double part) const {
    return std::lerp(radius_from, radius_to, part) *
           (std::cos(part * angle) * from + std::sin(part * angle) * across);
  }
};

/// Appends points of a set to another one of the same origin.
class PartOfSet {
 public:
  explicit PartOfSet(const CurveSet& whole) : whole_(whole) {
    part_.origin = whole.origin;
    part_.positions.reserve(whole.positions.size());
  }

  void add(size_t point) { addBetween(point, point, 0); }
  /// The place a part of the way from a point to the next.
  void addBetween(size_t point, size_t next, double part) {
    const auto mixed = static_cast<float>(part);
    part_.positions.push_back(glm::mix(whole_.positions[point], whole_.positions[next], mixed));
    addValues(point, next, part);
  }
  void addOn(const SphereArc& arc, size_t point, size_t next, double part) {
    part_.positions.emplace_back(arc.at(part) - whole_.origin);
    addValues(point, next, part);
  }
  /// The place between the point before `next` and it at a time; nothing where they are one.
  void addAt(double time, size_t next) {
    const double from = whole_.times[next - 1], to = whole_.times[next];
    if (from < to) addBetween(next - 1, next, (time - from) / (to - from));
  }
  void endLine() {
    const auto end = static_cast<uint32_t>(part_.positions.size());
    if (part_.begins.back() < end) part_.begins.push_back(end);
  }
  CurveSet finish() { return std::move(part_); }

 private:
  void addValues(size_t point, size_t next, double part) {
    if (!whole_.times.empty())
      part_.times.push_back(whole_.times[point] + part * (whole_.times[next] - whole_.times[point]));
    if (whole_.values.empty()) return;
    const float from = whole_.values[point], to = whole_.values[next];
    part_.values.push_back(part == 0 ? from : from + static_cast<float>(part) * (to - from));
  }

  const CurveSet& whole_;
  CurveSet part_;
};

}  // namespace

CurveSet alongSphere(const CurveSet& set) {
  constexpr double kMaxSagitta = 2e-5;
  double widest = 2 * std::acos(1 - kMaxSagitta);
  const auto arcTo = [&](size_t next) {
    return SphereArc(set.origin + glm::dvec3(set.positions[next - 1]),
                     set.origin + glm::dvec3(set.positions[next]));
  };
  const auto piecesOf = [&](const SphereArc& arc) {
    uint64_t pieces = 1;
    while (arc.angle > widest * static_cast<double>(pieces)) pieces *= 2;
    return pieces;
  };
  const auto added = [&] {
    uint64_t count = 0;
    for (size_t line = 0; line < set.lines(); ++line)
      for (size_t next = size_t{set.begins[line]} + 1; next < set.begins[line + 1]; ++next)
        count += piecesOf(arcTo(next)) - 1;
    return count;
  };
  const uint64_t points = set.positions.size(), room = std::numeric_limits<uint32_t>::max() - 1 - points;
  while (added() > std::min(4 * points + (uint64_t{1} << 20), room)) widest *= 2;
  PartOfSet whole(set);
  for (size_t line = 0; line < set.lines(); ++line) {
    for (size_t n = set.begins[line]; n < set.begins[line + 1]; ++n) {
      if (n > set.begins[line]) {
        const SphereArc arc = arcTo(n);
        const uint64_t pieces = piecesOf(arc);
        for (uint64_t piece = 1; piece < pieces; ++piece)
          whole.addOn(arc, n - 1, n, static_cast<double>(piece) / static_cast<double>(pieces));
      }
      whole.add(n);
    }
    whole.endLine();
  }
  return whole.finish();
}

CurveSet partBetween(const CurveSet& set, double from, double to) {
  PartOfSet part(set);
  for (size_t line = 0; line < set.lines(); ++line) {
    const size_t begin = set.begins[line], end = set.begins[line + 1];
    const auto timeOf = [&](size_t n) { return set.times[n]; };
    for (size_t n = begin; n < end; ++n) {
      if (n > begin && timeOf(n - 1) < from && timeOf(n) > from) part.addAt(from, n);
      if (timeOf(n) >= from && timeOf(n) <= to) part.add(n);
      if (n > begin && timeOf(n - 1) < to && timeOf(n) > to && to > from) part.addAt(to, n);
    }
    part.endLine();
  }
  return part.finish();
}

CurveSet placesAt(const CurveSet& set, double time) {
  PartOfSet part(set);
  for (size_t line = 0; line < set.lines(); ++line) {
    const auto begin = set.times.begin() + set.begins[line], end = set.times.begin() + set.begins[line + 1];
    const auto next = std::lower_bound(begin, end, time);
    if (next == end) continue;
    const auto n = static_cast<size_t>(next - set.times.begin());
    if (*next == time)
      part.add(n);
    else if (next != begin)
      part.addAt(time, n);
    part.endLine();
  }
  return part.finish();
}

namespace {

constexpr size_t kMaxColumns = 1000;
constexpr double kMaxCoordinate = 1e38;  // differences of two are finite in single precision
constexpr const char *kAxisNames[] = {"x", "y", "z"},
                     *kGeographicNames[] = {"longitude", "latitude", "height"};

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

constexpr size_t kNoColumn = std::numeric_limits<size_t>::max();

/// The meaning of the columns.
struct Columns {
  std::array<size_t, 3> position{0, 1, 2};  // kNoColumn: of a height that is not given
  std::optional<size_t> id, scalar, time;
  bool geographic = false;    // longitude, latitude and a height
  double kilometres = 0.001;  // of the height's unit, upwards
  size_t count = 3;
};

Columns columnsOf(const Rows& rows, const std::vector<std::string_view>& names, const std::string& scalar) {
  Columns columns;
  columns.count = names.size();
  std::vector<std::string> scalars;
  std::array<size_t, 3> along{kNoColumn, kNoColumn, kNoColumn}, on_globe = along;
  for (size_t n = 0; n < names.size(); ++n) {
    const std::string name(names[n]), lower = lowerCase(name);
    if (name == scalar) columns.scalar = n;
    if (lower == "id" || lower == "line" || lower == "trajectory") columns.id = n;
    if (lower == "time") columns.time = n;
    const size_t axis = lower.size() == 1 ? std::string_view("xyz").find(lower) : std::string_view::npos;
    const bool is_depth = lower == "depth";
    if (axis < 3)
      along[axis] = n;
    else if (lower == "lon" || lower == "longitude")
      on_globe[0] = n;
    else if (lower == "lat" || lower == "latitude")
      on_globe[1] = n;
    else
      scalars.push_back(name);
    if (is_depth || lower == "height" || lower == "altitude") {
      on_globe[2] = n;
      columns.kilometres = is_depth ? -0.001 : 0.001;
    }
  }
  columns.geographic = std::find(along.begin(), along.end(), kNoColumn) != along.end();
  if (columns.geographic && (on_globe[0] == kNoColumn || on_globe[1] == kNoColumn))
    rows.fail("has no columns x, y and z, nor lon and lat, among {}; name them so",
              listed(std::vector<std::string>(names.begin(), names.end())));
  columns.position = columns.geographic ? on_globe : along;
  if (!scalar.empty() && !columns.scalar)
    rows.fail("has no column '{}'{}; it has {}", scalar, didYouMean(scalar, scalars),
              scalars.empty() ? "x, y and z only" : listed(scalars));
  return columns;
}

}  // namespace

CurveSet parseCurveText(std::string_view text, const std::filesystem::path& path, const std::string& scalar,
                        const std::optional<Globe>& globe) {
  Rows rows(text, path);
  std::vector<glm::dvec3> points;
  std::vector<uint32_t> begins{0};
  std::vector<float> values;
  std::vector<double> times;
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
        if (columns->geographic) requireGlobe(globe, path);
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
    glm::dvec3 point(0.0);
    for (int axis = 0; axis < 3; ++axis) {
      const size_t column = columns->position[static_cast<size_t>(axis)];
      if (column == kNoColumn) continue;
      const auto number = rows.number(words[column]);
      if (!number || !(std::abs(*number) <= kMaxCoordinate))
        rows.fail("found '{}' for {}; expected a number up to {:g}", words[column],
                  columns->geographic ? kGeographicNames[axis] : kAxisNames[axis], kMaxCoordinate);
      point[axis] = *number;
    }
    if (columns->geographic) {
      if (std::abs(point.x) > kMaxLongitude || std::abs(point.y) > kMaxLatitude)
        rows.fail("found longitude {} and latitude {}; expected degrees", numberText(point.x),
                  numberText(point.y));
      if (std::abs(point.z) > kMaxMetres) rows.fail("found {:g} for height; expected metres", point.z);
      point = globe->placeAt({point.x, point.y, columns->kilometres * point.z});
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
    if (columns->time) {
      const auto number = rows.number(words[*columns->time]);
      if (!number || !std::isfinite(*number))
        rows.fail("found '{}' for time; expected a number", words[*columns->time]);
      if (begins.back() + 1 < points.size() && *number < times.back())
        rows.fail("found the time {:g} after {:g}; expected times that do not decrease along a line", *number,
                  times.back());
      times.push_back(*number);
    }
  }
  end_line();
  if (points.empty()) throw Error("{}: has no points; expected lines of x,y,z", path.string());
  CurveSet set = curveSetOf(points, std::move(begins), std::move(values), std::move(times));
  set.on_sphere = columns->geographic && globe->sphere();
  return set;
}

}  // namespace curvisplat
