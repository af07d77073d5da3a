#include "preprocess/formats/netcdf/cf_trajectories.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <optional>
#include <span>
#include <utility>

#include "preprocess/formats/netcdf/cf_coordinates.h"
#include "preprocess/formats/netcdf/cf_dimensions.h"
#include "preprocess/formats/netcdf/netcdf_files.h"
#include "preprocess/formats/netcdf/zarr_file.h"
#include "stream/base/error.h"
#include "stream/base/name_list.h"
#include "stream/base/text.h"

namespace curvisplat {
namespace {

constexpr size_t kAtOnce = size_t{1} << 18;  // observations of a variable
constexpr uint64_t kMaxPoints = std::numeric_limits<uint32_t>::max() - 1;
constexpr double kMaxKilometres = 1e15;

/// Observations of a variable: along lines and along the places of a line, either of which it may not have.
struct Observed {
  const NetcdfVariable* variable = nullptr;
  double factor = 1;

  explicit operator bool() const { return variable != nullptr; }
};

struct Observation {
  glm::dvec3 place;
  double time;
  float value;
};

class TrajectoryReader {
 public:
  TrajectoryReader(const NetcdfFiles& files, const std::string& scalar)
      : files_(files), scalar_name_(scalar) {
    findPlaces();
    findLines();
    findFurther();
  }

  CfTrajectories read() {
    const size_t lines = line_dim_ ? lengthOf(*line_dim_) : 1;
    const size_t along = along_dim_ ? lengthOf(*along_dim_) : 1;
    if (along_dim_ && (counts_ || numbers_)) {
      readRagged(along);
    } else {
      const size_t block =
          std::clamp<size_t>(kAtOnce / std::max<size_t>(along, 1), 1, std::max<size_t>(lines, 1));
      for (size_t line = 0; line < lines; line += block)
        readLines({line, std::min(lines, line + block)}, along);
    }
    if (result_.points.empty()) fail("has no places along its trajectories");
    return std::move(result_);
  }

 private:
  struct Range {
    size_t begin, end;
    size_t size() const { return end - begin; }
  };

  [[noreturn]] void fail(const std::string& what) const {
    throw Error("{}: {}", files_.path().string(), what);
  }
  size_t lengthOf(size_t dim) const { return static_cast<size_t>(files_.dimensions()[dim].length); }
  bool has(const NetcdfVariable& variable, size_t dim) const {
    return std::find(variable.dims.begin(), variable.dims.end(), dim) != variable.dims.end();
  }

  /// Longitude and latitude, or x and y, of the same one or two dimensions.
  void findPlaces() {
    for (const auto& [first, second] :
         {std::pair(CfRole::kLongitude, CfRole::kLatitude), {CfRole::kX, CfRole::kY}})
      for (const NetcdfVariable& x : files_.variables()) {
        if (cfRole(files_, x) != first || x.dims.empty() || x.dims.size() > 2) continue;
        for (const NetcdfVariable& y : files_.variables())
          if (!x_ && cfRole(files_, y) == second && y.dims == x.dims) {
            result_.degrees = first == CfRole::kLongitude;
            x_ = {&x, horizontalFactor(x)};
            y_ = {&y, horizontalFactor(y)};
          }
        if (x_) return;
      }
    fail("has no trajectories: no longitude and latitude, or x and y, of one or two common dimensions");
  }
  double horizontalFactor(const NetcdfVariable& variable) const {
    const std::string unit = variable.text("units");
    return result_.degrees ? degreesOf(unit) : kilometresOf(unit).value_or(1e-3);
  }

  /// Finds which dimension numbers lines, and which the places along one.
  void findLines() {
    const std::vector<size_t>& dims = x_.variable->dims;
    const auto withAttribute = [&](const char* attribute, const std::string& value) {
      const auto found =
          std::find_if(files_.variables().begin(), files_.variables().end(),
                       [&](const NetcdfVariable& of) { return of.numeric && of.text(attribute) == value; });
      return found == files_.variables().end() ? nullptr : &*found;
    };
    if (dims.size() == 2) {
      const bool time_first = isTime(files_, dims[0], 2), time_second = isTime(files_, dims[1], 2);
      const NetcdfVariable* const id = withIds();
      const bool lines_second =
          id && id->dims.size() == 1 ? id->dims[0] == dims[1] : time_first && !time_second;
      line_dim_ = dims[lines_second ? 1 : 0];
      along_dim_ = dims[lines_second ? 0 : 1];
      return;
    }
    along_dim_ = dims[0];
    const std::string& name = files_.dimensions()[dims[0]].name;
    if ((counts_ = withAttribute("sample_dimension", name)) && counts_->dims.size() == 1 &&
        counts_->dims != dims)
      return;
    counts_ = nullptr;
    const NetcdfVariable* const id = withIds();
    for (const NetcdfVariable& variable : files_.variables())
      if (variable.numeric && variable.dims == dims &&
          (variable.attributes.contains("instance_dimension") || &variable == id))
        numbers_ = &variable;
  }
  const NetcdfVariable* withIds() const {
    const auto found = std::find_if(
        files_.variables().begin(), files_.variables().end(),
        [](const NetcdfVariable& variable) { return variable.text("cf_role") == "trajectory_id"; });
    return found == files_.variables().end() ? nullptr : &*found;
  }

  /// Whether a variable has values of the observations, or of the lines.
  bool isObserved(const NetcdfVariable& variable) const {
    if (!variable.numeric || variable.dims.empty()) return false;
    if (counts_ && variable.dims == counts_->dims) return true;
    return std::all_of(variable.dims.begin(), variable.dims.end(),
                       [&](size_t dim) { return dim == along_dim_ || dim == line_dim_; });
  }

  void findFurther() {
    std::vector<std::string> names;
    for (const NetcdfVariable& variable : files_.variables()) {
      if (!isObserved(variable)) continue;
      names.push_back(variable.name);
      if (variable.name == scalar_name_) scalar_.variable = &variable;
      const CfRole role = cfRole(files_, variable);
      // Its own time of each place is preferred to that of all.
      if (role == CfRole::kTime && has(variable, *along_dim_) &&
          (!time_ || variable.dims.size() > time_.variable->dims.size()))
        time_.variable = &variable;
      const std::string name = lowerCase(variable.name);
      const bool vertical = role == CfRole::kVertical || name == "z" || name == "depth" || name == "height" ||
                            name == "altitude" || name == "alt";
      if (!vertical || height_ || &variable == x_.variable || &variable == y_.variable) continue;
      const std::string unit = variable.text("units");
      const auto length = isUnitless(unit) ? std::optional(1e-3) : kilometresOf(unit);
      if (!length)
        fail(fmt::format("{} is in {}; expected a depth or height in a unit of length", variable.name, unit));
      height_ = {&variable, growsDownwards(variable) ? -*length : *length};
    }
    if (!scalar_name_.empty() && !scalar_)
      fail(fmt::format("has no variable '{}'{} along its trajectories; it has {}", scalar_name_,
                       didYouMean(scalar_name_, names), listed(names)));
    if (time_) result_.time_unit = {time_.variable->text("units"), time_.variable->text("calendar")};
  }

  /// Whether a contiguous ragged array has one value of a line, as it has one count.
  bool isOfCounts(const Observed& of) const { return counts_ && of && !has(*of.variable, *along_dim_); }
  /// These values; empty if there are none.
  std::vector<double> valuesOfCounts(const Observed& of) const {
    if (!isOfCounts(of)) return {};
    std::vector<double> values(lengthOf(counts_->dims[0]));
    files_.read(*of.variable, {{0}, {values.size()}}, values);
    for (double& value : values) value *= of.factor;
    return values;
  }

  /// Values of lines and places along them, [line][place]; of ragged arrays `lines` is {0, 1}, and values of their lines are left out.
  std::vector<double> valuesOf(const Observed& of, const Range& lines, const Range& along) const {
    const size_t count = lines.size() * along.size();
    if (!of || isOfCounts(of)) return std::vector<double>(count, 0.0);
    NetcdfBox box;
    for (const size_t dim : of.variable->dims) {
      const Range& range = dim == line_dim_ ? lines : along;
      box.start.push_back(range.begin);
      box.count.push_back(range.size());
    }
    std::vector<double> stored(box.values());
    files_.read(*of.variable, box, stored);
    const bool has_lines = line_dim_ && has(*of.variable, *line_dim_),
               has_along = has(*of.variable, *along_dim_);
    const bool transposed = has_lines && has_along && of.variable->dims[0] == *along_dim_;
    std::vector<double> values(count);
    for (size_t line = 0; line < lines.size(); ++line)
      for (size_t n = 0; n < along.size(); ++n) {
        const size_t at = transposed               ? n * lines.size() + line
                          : has_lines && has_along ? line * along.size() + n
                          : has_lines              ? line
                                                   : n;
        values[line * along.size() + n] = of.factor * stored[at];
      }
    return values;
  }

  /// The observations of a box; those that are missing have a place that is NaN.
  std::vector<Observation> observations(const Range& lines, const Range& along) const {
    const std::vector<double> x = valuesOf(x_, lines, along), y = valuesOf(y_, lines, along),
                              z = valuesOf(height_, lines, along), time = valuesOf(time_, lines, along);
    const std::vector<double> values = valuesOf(scalar_, lines, along);
    std::vector<Observation> all(x.size());
    for (size_t n = 0; n < all.size(); ++n) {
      const bool there = result_.degrees
                             ? isOnEarth(x[n], y[n])
                             : std::abs(x[n]) <= kMaxKilometres && std::abs(y[n]) <= kMaxKilometres;
      const bool whole = there && std::abs(z[n]) <= kMaxKilometres && std::isfinite(time[n]);
      const double nowhere = std::numeric_limits<double>::quiet_NaN();
      all[n] = {whole ? glm::dvec3(x[n], y[n], z[n]) : glm::dvec3(nowhere), time[n],
                static_cast<float>(values[n])};
    }
    return all;
  }

  static void setHeight(Observation& one, double kilometres) {
    one.place.z = kilometres;
    if (!(std::abs(kilometres) <= kMaxKilometres)) one.place.x = std::numeric_limits<double>::quiet_NaN();
  }

  void readLines(const Range& lines, size_t along) {
    std::vector<std::vector<Observation>> of_lines(lines.size());
    const size_t block = std::max<size_t>(1, kAtOnce / lines.size());
    for (size_t begin = 0; begin < along; begin += block) {
      const Range part{begin, std::min(along, begin + block)};
      const std::vector<Observation> read = observations(lines, part);
      for (size_t line = 0; line < lines.size(); ++line)
        addTo(of_lines[line], std::span(read).subspan(line * part.size(), part.size()));
    }
    for (std::vector<Observation>& line : of_lines) addLine(line);
  }

  /// A place that is missing ends a line; of several in a row the first is kept.
  static void addTo(std::vector<Observation>& line, std::span<const Observation> more) {
    for (const Observation& one : more)
      if (!std::isnan(one.place.x) || (!line.empty() && !std::isnan(line.back().place.x)))
        line.push_back(one);
  }

  /// Ragged arrays: the places of all lines along one dimension, by counts or by the numbers of lines.
  void readRagged(size_t along) {
    const std::vector<double> counts = valuesOfCounts({counts_}), scalars = valuesOfCounts(scalar_),
                              heights = valuesOfCounts(height_);
    std::map<double, std::vector<Observation>> lines;
    size_t line = 0, left = 0;
    const auto nextLine = [&] {
      while (left == 0 && line < counts.size()) {
        const double count = counts[line++];
        if (!(count >= 0 && count <= static_cast<double>(along)))
          fail(fmt::format("{} is {} for a trajectory; expected up to {} observations", counts_->name,
                           numberText(count), along));
        left = static_cast<size_t>(count);
      }
      return left > 0;
    };
    for (size_t begin = 0; begin < along; begin += kAtOnce) {
      const Range part{begin, std::min(along, begin + kAtOnce)};
      std::vector<Observation> read = observations({0, 1}, part);
      const std::vector<double> numbers =
          numbers_ ? valuesOf({numbers_}, {0, 1}, part) : std::vector<double>(part.size());
      for (size_t n = 0; n < read.size(); ++n) {
        double number = numbers[n];
        if (counts_) {
          if (!nextLine()) break;  // what no trajectory counts
          --left;
          number = static_cast<double>(line - 1);
          if (!scalars.empty()) read[n].value = static_cast<float>(scalars[line - 1]);
          if (!heights.empty()) setHeight(read[n], heights[line - 1]);
        }
        if (!std::isnan(number)) addTo(lines[number], {&read[n], 1});
      }
    }
    for (auto& [number, observed] : lines) addLine(observed);
  }

  void addLine(std::vector<Observation>& line) {
    const auto earlier = [](const Observation& a, const Observation& b) { return a.time < b.time; };
    if (time_ && !std::is_sorted(line.begin(), line.end(), earlier)) {
      std::erase_if(line, [](const Observation& one) { return std::isnan(one.place.x); });
      std::stable_sort(line.begin(), line.end(), earlier);
    }
    const auto end = [&] {
      const auto points = static_cast<uint32_t>(result_.points.size());
      if (result_.begins.back() < points) result_.begins.push_back(points);
    };
    for (const Observation& one : line) {
      if (std::isnan(one.place.x)) {
        end();
        continue;
      }
      if (result_.points.size() >= kMaxPoints) fail("has too many points");
      result_.points.push_back(one.place);
      if (time_) result_.times.push_back(one.time);
      if (scalar_) result_.values.push_back(one.value);
    }
    end();
  }

  const NetcdfFiles& files_;
  const std::string& scalar_name_;
  Observed x_, y_, height_, time_, scalar_;
  std::optional<size_t> line_dim_, along_dim_;
  const NetcdfVariable* counts_ = nullptr;   // of contiguous ragged arrays
  const NetcdfVariable* numbers_ = nullptr;  // of indexed ones: of the line of each place
  CfTrajectories result_;
};

}  // namespace

bool isTrajectoryFile(const std::filesystem::path& path) {
  return isNetcdf(path);
}

CfTrajectories readCfTrajectories(const std::filesystem::path& path, const std::string& scalar) {
  OpenGridOptions options;
  options.grid = path;
  const NetcdfFiles files(options);
  return TrajectoryReader(files, scalar).read();
}

}  // namespace curvisplat
