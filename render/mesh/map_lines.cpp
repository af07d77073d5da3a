// Lines of maps: GeoJSON and shapefiles. Declared in curve_set.h.
#include <fmt/format.h>
#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <bit>
#include <cmath>
#include <cstring>
#include <limits>
#include <string>
#include <utility>

#include "render/mesh/curve_set.h"
#include "stream/base/error.h"
#include "stream/base/json_document.h"
#include "stream/base/text.h"

namespace curvisplat {

void requireGlobe(const std::optional<Globe>& globe, const std::filesystem::path& path) {
  constexpr double kMaxRadius = 1e30, kMaxScale = 1e15;  // places at any height have single precision
  if (globe && (globe->radius_km > kMaxRadius || std::abs(globe->vertical_scale) > kMaxScale))
    throw Error("{}: cannot be placed on a sphere of radius {:g} with heights {:g} times as large",
                path.string(), globe->radius_km, globe->vertical_scale);
  if (globe && globe->degrees()) return;
  throw Error(
      "{}: has longitudes and latitudes, but {}; --globe RADIUS,VERTICAL_SCALE says that it lies on a sphere "
      "around 0,0,0",
      path.string(),
      globe ? "the grid of the cache is placed by lengths"
            : "the cache does not say where its grid has them");
}

namespace {

constexpr double kLongest = 0.5;  // degrees, of a straight piece
constexpr uint64_t kMaxPoints = std::numeric_limits<uint32_t>::max() - 1;

/// Places lines between longitudes and latitudes: straight in these, as GeoJSON says.
class MapLines {
 public:
  MapLines(const std::filesystem::path& path, const Globe& globe, const GeographicBox& box)
      : path_(path), globe_(globe), box_(box) {}

  /// `at`: degrees east and north, metres of height.
  void add(const glm::dvec3& at) {
    if (!(std::abs(at.x) <= kMaxLongitude && std::abs(at.y) <= kMaxLatitude))
      throw Error("{}: found longitude {} and latitude {}; expected degrees", path_.string(),
                  numberText(at.x), numberText(at.y));
    if (!(std::abs(at.z) <= kMaxMetres))
      throw Error("{}: found {} for height; expected metres", path_.string(), numberText(at.z));
    if (before_) {
      const double degrees = std::max(std::abs(at.x - before_->x), std::abs(at.y - before_->y));
      const int pieces = std::max(1, static_cast<int>(std::ceil(degrees / kLongest)));
      for (int piece = 1; piece < pieces; ++piece)
        addPoint(glm::mix(*before_, at, static_cast<double>(piece) / pieces));
    }
    addPoint(at);
    before_ = at;
  }
  void endLine() {
    cut();
    before_.reset();
  }

  CurveSet finish() {
    endLine();
    if (points_.empty() && !outside_) throw Error("{}: has no lines, polygons or points", path_.string());
    return curveSetOf(points_, std::move(begins_), {});
  }

 private:
  bool isInside(const glm::dvec3& at) const {
    if (!(at.y >= box_.lower.y && at.y <= box_.upper.y)) return false;
    // How far east of the box's western side it is, once around the Earth.
    const double width = box_.upper.x - box_.lower.x, east = at.x - box_.lower.x;
    return width >= 360 || east - 360 * std::floor(east / 360) <= width;
  }
  void addPoint(const glm::dvec3& at) {
    if (!isInside(at)) {
      outside_ = true;
      return cut();
    }
    const glm::dvec3 place = globe_.placeAt({at.x, at.y, 0.001 * at.z});
    // A flat map is cut where its longitudes begin again.
    const double half = 180 * std::numbers::pi / 180 * globe_.radius_km;
    if (!globe_.sphere() && begins_.back() < points_.size() && std::abs(place.x - points_.back().x) > half)
      cut();
    if (points_.size() >= kMaxPoints) throw Error("{}: has too many points", path_.string());
    points_.push_back(place);
  }
  void cut() {
    if (begins_.back() < points_.size()) begins_.push_back(static_cast<uint32_t>(points_.size()));
  }

  const std::filesystem::path& path_;
  const Globe& globe_;
  const GeographicBox box_;
  std::optional<glm::dvec3> before_;
  bool outside_ = false;  // some points are
  std::vector<glm::dvec3> points_;
  std::vector<uint32_t> begins_{0};
};

void addPosition(const JsonField& position, MapLines& lines) {
  const std::vector<double> numbers = position.numbers();
  if (numbers.size() < 2) position.fail("a longitude and a latitude");
  lines.add({numbers[0], numbers[1], numbers.size() > 2 ? numbers[2] : 0.0});
}

void addLine(const JsonField& positions, MapLines& lines) {
  for (const JsonField& position : positions.elements()) addPosition(position, lines);
  lines.endLine();
}

/// `depth`: of the lists around the positions of a line; 0 of a point.
void addCoordinates(const JsonField& coordinates, int depth, MapLines& lines) {
  if (depth == 1) return addLine(coordinates, lines);
  if (depth == 0) {
    addPosition(coordinates, lines);
    return lines.endLine();
  }
  for (const JsonField& part : coordinates.elements()) addCoordinates(part, depth - 1, lines);
}

void addGeoJson(const JsonField& object, MapLines& lines) {
  const JsonField type = object.at("type");
  const std::string name = type.text();
  if (name == "FeatureCollection") {
    for (const JsonField& feature : object.at("features").elements()) addGeoJson(feature, lines);
  } else if (name == "Feature") {
    if (const auto geometry = object.find("geometry")) addGeoJson(*geometry, lines);
  } else if (name == "GeometryCollection") {
    for (const JsonField& geometry : object.at("geometries").elements()) addGeoJson(geometry, lines);
  } else if (name == "MultiPoint") {
    for (const JsonField& point : object.at("coordinates").elements()) addCoordinates(point, 0, lines);
  } else {
    const std::pair<const char*, int> depths[] = {
        {"Point", 0}, {"LineString", 1}, {"MultiLineString", 2}, {"Polygon", 2}, {"MultiPolygon", 3}};
    for (const auto& [of, depth] : depths)
      if (name == of) return addCoordinates(object.at("coordinates"), depth, lines);
    type.fail("a type of GeoJSON");
  }
}

// ------------------------------------------------------------------------------------------ shapefiles
//
// Source: ESRI Shapefile Technical Description, July 1998. Lengths in words of two bytes, big-endian; the rest little-endian.

constexpr size_t kShapefileHeader = 100, kRecordHeader = 8;
constexpr uint32_t kFileCode = 9994;

class ShapeBytes {
 public:
  ShapeBytes(std::string_view bytes, const std::filesystem::path& path) : bytes_(bytes), path_(path) {}

  uint32_t big(size_t at) const {
    uint32_t value = 0;
    for (size_t n = 0; n < 4; ++n) value = value << 8 | byte(at + n);
    return value;
  }
  uint32_t little(size_t at) const {
    uint32_t value = 0;
    for (size_t n = 4; n-- > 0;) value = value << 8 | byte(at + n);
    return value;
  }
  double number(size_t at) const {
    return std::bit_cast<double>(uint64_t{little(at + 4)} << 32 | little(at));
  }
  size_t size() const { return bytes_.size(); }
  [[noreturn]] void fail(const std::string& what) const { throw Error("{}: {}", path_.string(), what); }

 private:
  uint8_t byte(size_t at) const {
    if (at >= bytes_.size()) fail("is truncated");
    return static_cast<uint8_t>(bytes_[at]);
  }
  std::string_view bytes_;
  const std::filesystem::path& path_;
};

/// A record's contents in [at, end).
void addShape(const ShapeBytes& bytes, size_t at, size_t end, MapLines& lines) {
  // Types with heights and measures are 10 and 20 more.
  enum : uint32_t { kNull = 0, kPoint = 1, kPolyLine = 3, kPolygon = 5, kMultiPoint = 8 };
  const uint32_t type = bytes.little(at) % 10;
  const auto addAt = [&](size_t place) {
    if (place + 16 > end) bytes.fail("a shape is longer than its record");
    lines.add({bytes.number(place), bytes.number(place + 8), 0});
  };
  if (type == kNull) return;
  if (type == kPoint) {
    addAt(at + 4);
    return lines.endLine();
  }
  constexpr size_t kBox = 36;  // type and bounding box
  if (type == kMultiPoint) {
    const uint32_t points = bytes.little(at + kBox);
    for (size_t n = 0; n < points; ++n) {
      addAt(at + kBox + 4 + 16 * n);
      lines.endLine();
    }
    return;
  }
  if (type != kPolyLine && type != kPolygon)
    bytes.fail(fmt::format("has shapes of type {}; expected lines, polygons or points", bytes.little(at)));
  const size_t parts = bytes.little(at + kBox), points = bytes.little(at + kBox + 4), first = at + kBox + 8;
  if (4 * parts + 16 * points > end - std::min(end, first)) bytes.fail("a shape is longer than its record");
  size_t part = 0;
  for (size_t n = 0; n < points; ++n) {
    for (; part < parts && bytes.little(first + 4 * part) == n; ++part) lines.endLine();
    addAt(first + 4 * parts + 16 * n);
  }
  lines.endLine();
}

}  // namespace

CurveSet parseGeoJson(std::string_view text, const std::filesystem::path& path, const Globe& globe,
                      const GeographicBox& box) {
  const JsonDocument document(text, path.string(), "GeoJSON");
  MapLines lines(path, globe, box);
  addGeoJson(document.root(), lines);
  return lines.finish();
}

CurveSet parseShapefile(std::string_view bytes, const std::filesystem::path& path, const Globe& globe,
                        const GeographicBox& box) {
  const ShapeBytes file(bytes, path);
  if (file.size() < kShapefileHeader || file.big(0) != kFileCode) file.fail("is not a shapefile");
  MapLines lines(path, globe, box);
  for (size_t at = kShapefileHeader; at < file.size();) {
    const size_t begin = at + kRecordHeader, end = begin + 2 * size_t{file.big(at + 4)};
    if (end > file.size()) file.fail("is truncated");
    if (end < begin + 4) file.fail("a record has no shape");
    addShape(file, begin, end, lines);
    at = end;
  }
  return lines.finish();
}

}  // namespace curvisplat
