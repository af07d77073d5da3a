#include "preprocess/formats/vtk/vtk_curves.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <set>
#include <span>

#include "preprocess/formats/common/temporary_folder.h"
#include "preprocess/formats/vtk/vtk_legacy.h"
#include "preprocess/formats/vtk/vtk_xml.h"
#include "stream/base/error.h"
#include "stream/base/file.h"
#include "stream/base/name_list.h"
#include "stream/base/text.h"

namespace curvisplat {
namespace {

constexpr uint64_t kTuplesAtOnce = 65536;
constexpr double kMaxCoordinate = 1e38;  // differences of two are finite in single precision
constexpr uint64_t kMaxCurvePoints = std::numeric_limits<uint32_t>::max() - 1;

/// All tuples of an array's wanted components, one after the other.
std::vector<std::vector<double>> allOf(const VtkArray& array, std::span<const int> components) {
  std::vector<std::vector<double>> values(components.size());
  std::vector<std::vector<double>> chunk(components.size(), std::vector<double>(kTuplesAtOnce));
  for (uint64_t first = 0; first < array.tuples; first += kTuplesAtOnce) {
    const uint64_t count = std::min(kTuplesAtOnce, array.tuples - first);
    std::vector<WantedComponent<double>> wanted;
    for (size_t c = 0; c < components.size(); ++c) wanted.push_back({components[c], chunk[c].data()});
    readTuples<double>(array, first, count, wanted);
    for (size_t c = 0; c < components.size(); ++c)
      values[c].insert(values[c].end(), chunk[c].begin(), chunk[c].begin() + static_cast<ptrdiff_t>(count));
  }
  return values;
}

/// The component of an array that a scalar's name means: "U:mag", "U:x", "U:0", and "p" of one component.
std::optional<int> componentIn(const VtkArray& array, const std::string& scalar) {
  if (!scalar.starts_with(array.name)) return std::nullopt;
  const std::string rest = scalar.substr(array.name.size());
  if (rest.empty()) return array.components == 1 ? std::optional(0) : std::nullopt;
  constexpr std::array<const char*, 3> kAxes{":x", ":y", ":z"};
  if (array.components > 1 && rest == ":mag") return kMagnitude;
  for (uint32_t c = 0; c < array.components; ++c)
    if (rest == fmt::format(":{}", c) || (c < 3 && array.components <= 3 && rest == kAxes[c]))
      return static_cast<int>(c);
  return std::nullopt;
}

class Collector {
 public:
  Collector(std::string file, const std::string& scalar, bool as_points)
      : file_(std::move(file)), scalar_(scalar), as_points_(as_points) {}

  void add(const VtkLines& lines) {
    const auto& [piece, cells, first_cell] = lines;
    std::vector<double> of_points, of_cells;
    if (!scalar_.empty() && !valuesOf(piece.point_data, of_points)) valuesOf(piece.cell_data, of_cells);
    const auto points = allOf(std::get<VtkPoints>(piece.nodes), std::array{0, 1, 2});
    const auto addPoint = [&](uint64_t n, double of_cell) {
      if (n >= points[0].size()) fail("a cell refers to a point that does not exist");
      const glm::dvec3 at(points[0][n], points[1][n], points[2][n]);
      for (int axis = 0; axis < 3; ++axis)
        if (!(std::abs(at[axis]) <= kMaxCoordinate))
          fail(fmt::format("a point has the coordinate {:g}; expected a number up to {:g}", at[axis],
                           kMaxCoordinate));
      if (curves_.points.size() >= kMaxCurvePoints) fail("has too many points");
      curves_.points.push_back(at);
      if (!scalar_.empty())
        curves_.values.push_back(static_cast<float>(of_points.empty() ? of_cell : of_points[n]));
    };
    const auto endLine = [&] { curves_.begins.push_back(static_cast<uint32_t>(curves_.points.size())); };
    constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
    if (as_points_) {
      for (uint64_t n = 0; n < points[0].size(); ++n) {
        addPoint(n, kNone);
        endLine();
      }
      return;
    }
    if (cells.cells == 0) return;
    constexpr std::array kFirst{0};
    const auto ends = allOf(cells.ends, kFirst)[0], connectivity = allOf(cells.connectivity, kFirst)[0];
    const auto types = cells.types.bytes ? allOf(cells.types, kFirst)[0] : std::vector<double>();
    double begin = 0;
    for (size_t n = 0; n < ends.size(); ++n) {
      const double first = begin + (cells.counted ? 1 : 0);
      if (!(ends[n] >= begin && ends[n] <= static_cast<double>(connectivity.size())))
        fail("the offsets of its cells do not increase");
      begin = ends[n];
      constexpr double kLine = 3, kPolyLine = 4;
      if (!types.empty() && types[n] != kLine && types[n] != kPolyLine) continue;
      if (!(ends[n] - first >= 2)) continue;
      const double value = of_cells.empty() ? kNone : of_cells.at(first_cell + n);
      for (auto at = static_cast<size_t>(first); at < static_cast<size_t>(ends[n]); ++at) {
        if (!(connectivity[at] >= 0)) fail("a cell refers to a point that does not exist");
        addPoint(static_cast<uint64_t>(connectivity[at]), value);
      }
      endLine();
    }
  }

  VtkCurves finish() {
    if (curves_.points.empty())
      fail(as_points_ ? "has no points" : "has no lines; --points draws the points of a file");
    if (!scalar_.empty() && !found_)
      fail(fmt::format(
          "has no scalar '{}'{}; {}", scalar_, didYouMean(scalar_, std::vector(names_.begin(), names_.end())),
          names_.empty() ? "it has none" : "it has " + listed(std::vector(names_.begin(), names_.end()))));
    return std::move(curves_);
  }

 private:
  bool valuesOf(const std::vector<VtkArray>& arrays, std::vector<double>& values) {
    for (const VtkArray& array : arrays) {
      if (array.components == 1)
        names_.insert(array.name);
      else
        names_.insert({array.name + ":mag"});
      const auto component = componentIn(array, scalar_);
      if (!component) continue;
      values = allOf(array, std::array{*component})[0];
      found_ = true;
      return true;
    }
    return false;
  }
  [[noreturn]] void fail(const std::string& what) const { throw Error("{}: {}", file_, what); }

  const std::string file_;
  const std::string& scalar_;
  const bool as_points_;
  bool found_ = false;
  std::set<std::string> names_;
  VtkCurves curves_;
};

}  // namespace

bool isVtkCurveFile(const std::filesystem::path& path) {
  const std::string extension = extensionOf(path);
  return extension == ".vtp" || extension == ".vtu" || extension == ".vtk";
}

VtkCurves readVtkCurves(const std::filesystem::path& path, const std::string& scalar, bool as_points) {
  const VtkFiles files(systemTemporaryFolder());
  Collector collector(path.string(), scalar, as_points);
  if (extensionOf(path) == ".vtk")
    collector.add(readVtkLegacyLines(files, path));
  else
    for (const VtkLines& lines : readXmlLines(VtkXmlFile(files, path))) collector.add(lines);
  return collector.finish();
}

}  // namespace curvisplat
