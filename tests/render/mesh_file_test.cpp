// Surfaces from files: what is read, and what is refused.
#include "render/mesh/triangle_mesh.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <glm/geometric.hpp>
#include <limits>
#include <string>

#include "render/mesh/curve_set.h"
#include "stream/base/error.h"
#include "tests/support/expect_error.h"

namespace curvisplat {
namespace {

RawMesh parse(const std::string& text, const std::string& name) {
  return parseMesh(std::as_bytes(std::span(text)), name);
}

std::string refusalOf(const std::string& text, const std::string& name) {
  return curvisplat::errorOf([&] { parse(text, name); });
}

template <typename T>
void append(std::string& bytes, T value, bool reversed = false) {
  char raw[sizeof value];
  std::memcpy(raw, &value, sizeof value);
  if (reversed) std::reverse(raw, raw + sizeof value);
  bytes.append(raw, sizeof value);
}

const float kCorners[4][3] = {{0, 0, 0}, {2, 0, 0}, {2, 1, 0.5f}, {0, 1, 0.5f}};

std::string binaryStl() {
  std::string bytes(80, ' ');
  bytes.replace(0, 5, "solid");  // as some programs write
  append(bytes, uint32_t{2});
  for (const auto& triangle : {std::array{0, 1, 2}, std::array{0, 2, 3}}) {
    for (int n = 0; n < 3; ++n) append(bytes, 0.0f);
    for (const int corner : triangle)
      for (const float x : kCorners[corner]) append(bytes, x);
    append(bytes, uint16_t{0});
  }
  return bytes;
}

const std::string kAsciiStl =
    "solid a quad\n facet normal 0 0 1\n  outer loop\n   vertex 0 0 0\n   vertex 2 0 0\n   vertex 2 1 0.5\n"
    "  endloop\n endfacet\n facet normal 0 0 1\n  outer loop\n   vertex 0 0 0\n   vertex 2 1 0.5\n"
    "   vertex 0 1 5e-1\n  endloop\n endfacet\nendsolid a quad\n";

const std::string kAsciiPly =
    "ply\r\nformat ascii 1.0\r\ncomment made by hand\r\nelement vertex 4\r\nproperty float x\r\n"
    "property double y\r\nproperty float z\r\nproperty uchar red\r\nelement face 1\r\n"
    "property list uchar int vertex_indices\r\nend_header\r\n0 0 0 255\r\n2 0 0 255\r\n2 1 0.5 255\r\n"
    "0 1 0.5 255\r\n4 0 1 2 3\r\n";

std::string binaryPly(bool big) {
  std::string bytes = std::string("ply\nformat binary_") + (big ? "big" : "little") +
                      "_endian 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n"
                      "element face 1\nproperty uchar flags\nproperty list uchar uint vertex_index\n"
                      "end_header\n";
  for (const auto& corner : kCorners)
    for (const float x : corner) append(bytes, x, big);
  append(bytes, uint8_t{7});
  append(bytes, uint8_t{4});
  for (uint32_t n = 0; n < 4; ++n) append(bytes, n, big);
  return bytes;
}

const std::string kObj =
    "# a quad\nmtllib a.mtl\nv 0 0 0\nv 2 0 0\nvn 0 0 1\nv 2 1 0.5\nv 0 1 0.5\nf 1/1/1 2//1 -2 4/4\n";

const std::pair<std::string, std::string> kFiles[] = {{binaryStl(), "a.stl"},     {kAsciiStl, "b.STL"},
                                                      {kAsciiPly, "c.ply"},       {binaryPly(false), "d.ply"},
                                                      {binaryPly(true), "e.ply"}, {kObj, "f.obj"}};

TEST(MeshFile, ReadsEveryFormat) {
  for (const auto& [text, name] : kFiles) {
    const TriangleMesh mesh = meshOf(parse(text, name));
    ASSERT_EQ(mesh.triangles.size(), 2u) << name;
    EXPECT_EQ(mesh.positions.size(), 4u) << name;
    const glm::vec3 normal = glm::normalize(glm::vec3(0, -0.5f, 1));
    for (const glm::vec3& n : mesh.normals) EXPECT_NEAR(std::abs(glm::dot(n, normal)), 1, 1e-6) << name;
    double area = 0;
    for (const auto& [a, b, c] : mesh.triangles)
      area += 0.5 * double{glm::length(glm::cross(mesh.positions[b] - mesh.positions[a],
                                                  mesh.positions[c] - mesh.positions[a]))};
    EXPECT_NEAR(area, 2 * std::hypot(1, 0.5), 1e-6) << name;
  }
}

TEST(MeshFile, RefusesEveryTruncatedFile) {
  for (const auto& [text, name] : kFiles) {
    // What may be missing: the end of the last line, and of the last number.
    const size_t last = name.ends_with("obj") ? 0
                                              : text.size() - (name.ends_with("c.ply") ? 3
                                                               : name.ends_with("STL") ? 8
                                                                                       : 1);
    for (size_t length = 0; length < last; ++length)
      EXPECT_NE(refusalOf(text.substr(0, length), name), "") << name << " of " << length << " bytes";
  }
}

TEST(MeshFile, NamesTheWrongLine) {
  const std::pair<std::pair<std::string, std::string>, std::string> refused[] = {
      {{"", "a.stl"}, "a.stl: is empty; STL, PLY and OBJ files can be read"},
      {{"hello", "a.txt"},
       "a.txt: unknown surface format (extension '.txt'); STL, PLY and OBJ files can be read"},
      {{binaryStl().substr(0, 130), "a.stl"}, "a.stl: line 1 has no finite number where one is expected"},
      {{std::string(80, ' ') + std::string(4, '\xff') + "x", "a.stl"},
       "a.stl: is truncated: 4294967295 triangles take 214748364834 bytes (found 85)"},
      {{"v 0 0 0\nv 1 0 nan\n", "a.obj"},
       "a.obj: line 2 has no finite number where one is expected (found 'nan')"},
      {{"v 0 0 0\nv 1 0 0\nf 1 2 3\n", "a.obj"}, "a.obj: line 3: a face refers to vertex 3, but there are 2"},
      {{"v 0 0 0\nf 1 1\n", "a.obj"}, "a.obj: line 2: a face has 2 vertices (expected 3 or more)"},
      {{"v 0 0 0\n", "a.obj"}, "a.obj: has no triangles, so there is nothing to draw"},
      {{"ply\nformat ascii 1.0\nelement vertex 1000000000000\nproperty float x\nend_header\n1\n", "a.ply"},
       "a.ply: is truncated: 1000000000000 vertex need 2000000000000 bytes or more (found 3)"},
      {{"ply\nformat ascii 1.0\nelement vertex 1\nproperty quad x\nend_header\n1\n", "a.ply"},
       "a.ply: a property has the type 'quad', which PLY files do not have"},
      {{"ply\nformat middle 1.0\nend_header\n", "a.ply"},
       "a.ply: the format is 'middle' (expected ascii, binary_little_endian or binary_big_endian)"},
      {{"solid\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nendloop\nendfacet\nendsolid\n", "a.stl"},
       "a.stl: line 6: a facet has 1 vertices (expected 3)"}};
  for (const auto& [file, words] : refused) {
    const std::string refusal = refusalOf(file.first, file.second);
    if (file.first.size() == 130) continue;  // of which the text may say anything
    EXPECT_TRUE(refusal.starts_with(words)) << refusal << "\n  expected " << words;
    EXPECT_EQ(refusal.find('\n'), std::string::npos) << refusal;
  }
}

TEST(TriangleMesh, KeepsEdgesSharp) {
  RawMesh cube;
  for (int n = 0; n < 8; ++n) cube.positions.emplace_back(n & 1, n >> 1 & 1, n >> 2);
  const uint32_t faces[6][4] = {{0, 1, 3, 2}, {4, 5, 7, 6}, {0, 1, 5, 4},
                                {2, 3, 7, 6}, {0, 2, 6, 4}, {1, 3, 7, 5}};
  for (const auto& f : faces) {
    cube.triangles.push_back({f[0], f[1], f[2]});
    cube.triangles.push_back({f[0], f[2], f[3]});
  }
  const TriangleMesh mesh = meshOf(cube);
  EXPECT_EQ(mesh.positions.size(), 24u);
  for (const auto& [a, b, c] : mesh.triangles) {
    const glm::vec3 n = glm::normalize(
        glm::cross(mesh.positions[b] - mesh.positions[a], mesh.positions[c] - mesh.positions[a]));
    for (const uint32_t corner : {a, b, c}) EXPECT_NEAR(std::abs(glm::dot(mesh.normals[corner], n)), 1, 1e-6);
  }
}

TEST(TriangleMesh, SmoothsWhatIsCurved) {
  RawMesh sphere;
  constexpr uint32_t kAround = 48, kUp = 24;
  for (uint32_t j = 0; j <= kUp; ++j)
    for (uint32_t i = 0; i < kAround; ++i) {
      const double theta = M_PI * j / kUp, phi = 2 * M_PI * i / kAround;
      sphere.positions.emplace_back(std::sin(theta) * std::cos(phi), std::sin(theta) * std::sin(phi),
                                    std::cos(theta));
    }
  for (uint32_t j = 0; j < kUp; ++j)
    for (uint32_t i = 0; i < kAround; ++i) {
      const uint32_t a = j * kAround + i, b = j * kAround + (i + 1) % kAround;
      // Either way round.
      sphere.triangles.push_back(i % 2 ? std::array{a, b, b + kAround} : std::array{b, a, b + kAround});
      sphere.triangles.push_back({a, b + kAround, a + kAround});
    }
  const TriangleMesh mesh = meshOf(sphere);
  for (size_t n = 0; n < mesh.positions.size(); ++n) {
    const glm::dvec3 at = mesh.origin + glm::dvec3(mesh.positions[n]);
    if (std::abs(at.z) < 0.9999) {
      EXPECT_GT(std::abs(glm::dot(at, glm::dvec3(mesh.normals[n]))), 0.99) << n;
    }
  }
}

CurveSet curves(const std::string& text, const std::string& scalar = "", bool as_points = false) {
  const CurveSet set = parseCurveText(text, "a.csv", scalar);
  return as_points ? pointsOf(set) : set;
}
std::string refusalOfCurves(const std::string& text, const std::string& scalar = "") {
  return curvisplat::errorOf([&] { curves(text, scalar); });
}

TEST(CurveText, LinesEndAtAnotherIdOrAnEmptyLine) {
  const std::string text =
      "# of a tracer\nid,x,y,z,speed\n7,1,2,3,0.5\r\n7,1,2,4,\n8,5,5,5,1e1\n\n8,6,5,5,2\n";
  const CurveSet set = curves(text, "speed");
  EXPECT_EQ(set.begins, (std::vector<uint32_t>{0, 2, 3, 4}));
  EXPECT_EQ(set.origin, glm::dvec3(1, 2, 3));
  EXPECT_EQ(set.positions[3], glm::vec3(5, 3, 2));
  EXPECT_EQ(set.values[2], 10);
  EXPECT_TRUE(std::isnan(set.values[1]));
  EXPECT_EQ(set.range(), std::pair(0.5f, 10.0f));
  EXPECT_EQ(curves(text, "", true).begins.size(), 5u);
  EXPECT_TRUE(curves(text).values.empty());
  // Without names, and with spaces.
  EXPECT_EQ(curves("1 2 3\n 4\t5 6 \n\n\n7 8 9\n").begins, (std::vector<uint32_t>{0, 2, 3}));
  EXPECT_EQ(curves("Z;Y;X\n1;2;3").origin, glm::dvec3(3, 2, 1));
}

TEST(CurveText, RefusesWhatItCannotRead) {
  const std::string head = "x,y,z,speed\n";
  EXPECT_EQ(refusalOfCurves(head + "1,2,3,4\n1,2,3\n"), "a.csv: line 3: has 3 columns; expected 4");
  for (const auto& [line, found] :
       {std::pair("1,2,three,4", "'three' for z"), std::pair("1,nan,3,4", "'nan' for y"),
        std::pair("1e39,2,3,4", "'1e39' for x")})
    EXPECT_EQ(refusalOfCurves(head + line),
              std::string("a.csv: line 2: found ") + found + "; expected a number up to 1e+38");
  EXPECT_EQ(refusalOfCurves(head + "1,2,3,fast", "speed"),
            "a.csv: line 2: found 'fast' for speed; expected a number");
  EXPECT_EQ(refusalOfCurves(head + "1,2,3,4", "sped"),
            "a.csv: line 1: has no column 'sped' (did you mean speed?); it has speed");
  EXPECT_EQ(
      refusalOfCurves("lon,lat\n1,2"),
      "a.csv: has longitudes and latitudes, but the cache does not say where its grid has them; --globe "
      "RADIUS,VERTICAL_SCALE says that it lies on a sphere around 0,0,0");
  EXPECT_EQ(refusalOfCurves("x,y,lat\n1,2,3"),
            "a.csv: line 1: has no columns x, y and z, nor lon and lat, among x, y, lat; name them so");
  EXPECT_EQ(refusalOfCurves("x,y,z,time\n1,2,3,5\n1,2,3,4"),
            "a.csv: line 3: found the time 4 after 5; expected times that do not decrease along a line");
  EXPECT_EQ(refusalOfCurves("1,2,3,4", "speed"),
            "a.csv: line 1: has no names of its columns; a first line such as x,y,z,speed names them");
  EXPECT_EQ(refusalOfCurves(head), "a.csv: has no points; expected lines of x,y,z");
  EXPECT_EQ(refusalOfCurves("1,2"), "a.csv: line 1: has 2 columns; expected x, y and z");
}

glm::dvec3 pointOf(const CurveSet& set, size_t n) {
  return set.origin + glm::dvec3(set.positions.at(n));
}

TEST(CurveText, DegreesArePlacedOnTheGlobe) {
  Globe globe;
  globe.radius_km = 1000;
  globe.vertical_scale = 50;
  const CurveSet set = parseCurveText("Depth,lat,lon\n0,0,0\n2000,0,90\n0,90,0\n", "a.csv", "Depth", globe);
  EXPECT_NEAR(glm::distance(pointOf(set, 0), glm::dvec3(1000, 0, 0)), 0, 1e-4);
  EXPECT_NEAR(glm::distance(pointOf(set, 1), glm::dvec3(0, 900, 0)), 0, 1e-4);
  EXPECT_NEAR(glm::distance(pointOf(set, 2), glm::dvec3(0, 0, 1000)), 0, 1e-4);
  EXPECT_EQ(set.values[1], 2000);
  EXPECT_EQ(curvisplat::errorOf([&] { parseCurveText("lon,lat\n1,92", "a.csv", "", globe); }),
            "a.csv: line 2: found longitude 1 and latitude 92; expected degrees");
}

/// The great circle from 0 to 90 degrees east at 60 degrees north passes (1, 1, 2 tan 60) / |...|, and leaves the parallel.
TEST(CurveText, LongSegmentsFollowTheSphere) {
  Globe globe;
  globe.radius_km = 1000;
  const CurveSet given = parseCurveText(
      "lon,lat,height,time\n0,60,0,0\n90,60,9000,8\n90,60.5,0,9\n\n0,0,0,0\n180,0,0,1\n\n7,7,0,3\n", "a.csv",
      "height", globe);
  ASSERT_TRUE(given.on_sphere);
  const CurveSet set = alongSphere(given);
  ASSERT_EQ(set.lines(), 3u);
  ASSERT_EQ(set.begins[1], 66u);  // 41.4 degrees in 64 pieces; half a degree is one
  ASSERT_EQ(set.begins[2] - set.begins[1], 257u);
  ASSERT_EQ(set.values.size(), set.positions.size());
  ASSERT_EQ(set.times.size(), set.positions.size());
  const double root = std::sqrt(3.0), length = std::sqrt(2 + 12.0);
  EXPECT_NEAR(glm::distance(pointOf(set, 32), 1004.5 * glm::dvec3(1, 1, 2 * root) / length), 0, 1e-3);
  EXPECT_FLOAT_EQ(set.values[32], 4500);
  EXPECT_DOUBLE_EQ(set.times[32], 4);
  for (size_t line = 0; line < 2; ++line)
    for (size_t n = set.begins[line] + 1; n < set.begins[line + 1]; ++n) {
      const glm::dvec3 a = pointOf(set, n - 1), b = pointOf(set, n);
      const double sphere = 0.5 * (glm::length(a) + glm::length(b));
      EXPECT_LT(sphere - glm::length(0.5 * (a + b)), 2.1e-5 * sphere) << n;
      EXPECT_GE(glm::length(a), 999.999);
    }
  // Opposite places are joined by the pole.
  EXPECT_NEAR(glm::distance(pointOf(set, set.begins[1] + 128), glm::dvec3(0, 0, 1000)), 0, 1e-3);
  EXPECT_NEAR(glm::distance(pointOf(set, set.begins[2] - 1), glm::dvec3(-1000, 0, 0)), 0, 1e-3);
  EXPECT_NEAR(glm::distance(pointOf(set, set.begins[2]), pointOf(given, 5)), 0, 1e-3);
  globe.shape = Globe::Shape::kFlat;
  EXPECT_FALSE(parseCurveText("lon,lat\n0,0\n90,0\n", "a.csv", "", globe).on_sphere);
  EXPECT_FALSE(curves("x,y,z\n0,0,9\n90,0,9\n").on_sphere);
}

/// Places count from the set's first one, in single precision.
TEST(CurveText, OppositePlacesAreJoinedByAPoleOrLongitude0) {
  for (const char* first : {"0,-60", "12,30"}) {
    const auto middleOf = [&](const std::string& ends) {
      const CurveSet set =
          alongSphere(parseCurveText(fmt::format("lon,lat\n{}\n\n{}\n", first, ends), "a.csv", "", Globe{}));
      const size_t begin = set.begins.at(1), end = set.begins.at(2);
      EXPECT_GT(end - begin, 100u);
      return glm::normalize(pointOf(set, begin + (end - 1 - begin) / 2));
    };
    EXPECT_NEAR(glm::distance(middleOf("30,0\n-150,0"), glm::dvec3(0, 0, 1)), 0, 1e-6) << first;
    EXPECT_NEAR(glm::distance(middleOf("0,90\n0,-90"), glm::dvec3(1, 0, 0)), 0, 1e-6) << first;
    EXPECT_NEAR(glm::distance(middleOf("50,-90\n-70,90"), glm::dvec3(1, 0, 0)), 0, 1e-6) << first;
  }
}

/// A file may take little more memory, whatever its lines.
TEST(CurveText, ManyLongSegmentsHaveFewerPieces) {
  std::string text = "lon,lat\n";
  for (int n = 0; n < 20000; ++n) text += n % 2 == 0 ? "0,0\n" : "179,0\n";
  const CurveSet set = alongSphere(parseCurveText(text, "a.csv", "", Globe{}));
  EXPECT_LT(set.positions.size(), 5 * 20000 + (1u << 20));
  EXPECT_GT(set.positions.size(), 16 * 20000u);
}

TEST(CurveSet, ATimeShowsThePartBeforeIt) {
  const CurveSet set = curves(
      "x,y,z,time,speed,id\n0,0,0,0,1,a\n4,0,0,2,3,a\n4,8,0,6,5,a\n9,9,9,5,1,b\n9,9,10,7,1,b\n", "speed");
  ASSERT_EQ(set.times.size(), 5u);
  const auto expectPart = [&](const CurveSet& part, const std::vector<glm::vec3>& points,
                              const std::vector<uint32_t>& begins) {
    EXPECT_EQ(part.begins, begins);
    ASSERT_EQ(part.positions.size(), points.size());
    for (size_t n = 0; n < points.size(); ++n) EXPECT_EQ(pointOf(part, n), glm::dvec3(points[n])) << n;
  };
  constexpr double kBefore = -std::numeric_limits<double>::infinity();
  const CurveSet early = partBetween(set, kBefore, 3);
  expectPart(early, {{0, 0, 0}, {4, 0, 0}, {4, 2, 0}}, {0, 3});
  EXPECT_EQ(early.values, (std::vector<float>{1, 3, 3.5f}));
  EXPECT_EQ(early.times.back(), 3);
  expectPart(partBetween(set, 1, 3), {{2, 0, 0}, {4, 0, 0}, {4, 2, 0}}, {0, 3});
  expectPart(partBetween(set, 2.5, 3), {{4, 1, 0}, {4, 2, 0}}, {0, 2});
  expectPart(partBetween(set, kBefore, 9), {{0, 0, 0}, {4, 0, 0}, {4, 8, 0}, {9, 9, 9}, {9, 9, 10}},
             {0, 3, 5});
  expectPart(partBetween(set, kBefore, -1), {}, {0});
  expectPart(placesAt(set, 0), {{0, 0, 0}}, {0, 1});
  expectPart(placesAt(set, 5), {{4, 6, 0}, {9, 9, 9}}, {0, 1, 2});
  expectPart(placesAt(set, 6.5), {{9, 9, 9.75f}}, {0, 1});
  expectPart(placesAt(set, 8), {}, {0});
}

const Globe kUnit{Globe::Shape::kSphere, 1, 1, 0};

TEST(MapLines, GeoJsonHasLinesEdgesAndPoints) {
  const std::string text =
      R"({"type": "FeatureCollection", "features": [
      {"type": "Feature", "properties": null, "geometry": {"type": "LineString", "coordinates": [[0, 0], [1, 0, 0]]}},
      {"type": "Feature", "geometry": null},
      {"type": "Feature", "geometry": {"type": "GeometryCollection", "geometries": [
        {"type": "MultiPolygon", "coordinates": [[[[90, 0], [90, 0.5], [90, 0]]]]}, {"type": "Point", "coordinates": [0, 90]}]}}]})";
  const CurveSet set = parseGeoJson(text, "a.geojson", kUnit, {});
  EXPECT_EQ(set.begins, (std::vector<uint32_t>{0, 3, 6, 7})) << "a piece has half a degree at most";
  EXPECT_NEAR(glm::distance(pointOf(set, 1), kUnit.column(0.5, 0)), 0, 1e-6);
  EXPECT_NEAR(glm::distance(pointOf(set, 3), glm::dvec3(0, 1, 0)), 0, 1e-6);
  EXPECT_NEAR(glm::distance(pointOf(set, 6), glm::dvec3(0, 0, 1)), 0, 1e-6);
  // Around the data alone, whatever turn of the Earth its longitudes count from.
  for (const double turn : {0.0, 360.0, -360.0}) {
    const CurveSet near = parseGeoJson(text, "a.geojson", kUnit, {{0.25 + turn, -1}, {89 + turn, 1}});
    EXPECT_EQ(near.begins, (std::vector<uint32_t>{0, 2})) << turn;
  }
  // A flat map is cut where its longitudes begin again.
  Globe flat = kUnit;
  flat.shape = Globe::Shape::kFlat;
  const CurveSet cut = parseGeoJson(
      R"({"type": "MultiLineString", "coordinates": [[[179.9, 3], [180.3, 3]]]})", "a.geojson", flat, {});
  EXPECT_EQ(cut.begins, (std::vector<uint32_t>{0, 1, 2}));

  const auto refusal = [](const std::string& json) {
    return curvisplat::errorOf([&] { parseGeoJson(json, "a.geojson", kUnit, {}); });
  };
  expectSays(refusal(R"({"type": "Circle"})"),
             "a.geojson: type is invalid (found \"Circle\", expected a type of GeoJSON)");
  expectSays(refusal(R"({"type": "Point", "coordinates": [1]})"), "expected a longitude and a latitude");
  expectSays(refusal(R"({"type": "Point", "coordinates": [1, 5000000]})"), "expected degrees");
  expectSays(refusal(R"({"type": "Point", "coordinates": [1, 5, 1e300]})"),
             "found 1e+300 for height; expected metres");
  expectSays(refusal(R"({"type": "FeatureCollection", "features": []})"), "has no lines, polygons or points");
  expectSays(refusal("{"), "a.geojson: ");
}

std::string shapefile(uint32_t type) {
  std::string bytes;
  append(bytes, uint32_t{9994}, true);
  bytes.resize(100);
  const auto addRecord = [&](const std::string& contents) {
    append(bytes, uint32_t{1}, true);
    append(bytes, static_cast<uint32_t>(contents.size() / 2), true);
    bytes += contents;
  };
  std::string null, shape;
  append(null, uint32_t{0});
  append(shape, type);
  shape.resize(36);
  for (const uint32_t number : {2u, 4u, 0u, 2u}) append(shape, number);
  for (const double degrees : {0.0, 0.0, 0.0, 0.25, 10.0, 20.0, 10.25, 20.0}) append(shape, degrees);
  addRecord(null);
  addRecord(shape);
  return bytes;
}

TEST(MapLines, ShapefilesHavePartsOfLines) {
  const CurveSet set = parseShapefile(shapefile(3), "a.shp", kUnit, {});
  EXPECT_EQ(set.begins, (std::vector<uint32_t>{0, 2, 4}));
  EXPECT_NEAR(glm::distance(pointOf(set, 3), kUnit.column(10.25, 20)), 0, 1e-6);
  EXPECT_EQ(parseShapefile(shapefile(15), "a.shp", kUnit, {}).begins.size(), 3u) << "polygons with heights";
  const auto refusal = [](const std::string& bytes) {
    return curvisplat::errorOf([&] { parseShapefile(bytes, "a.shp", kUnit, {}); });
  };
  EXPECT_EQ(refusal("PK"), "a.shp: is not a shapefile");
  EXPECT_EQ(refusal(shapefile(7)), "a.shp: has shapes of type 7; expected lines, polygons or points");
  std::string no_number = shapefile(3);
  no_number.replace(no_number.size() - 16, 8,
                    std::string("\0\0\0\0\0\0\xf8\xff", 8));  // a NaN whose sign bit is set
  expectSays(refusal(no_number), "found longitude NaN and latitude 20");
  std::string whole = shapefile(3);
  for (size_t size = 100; size < whole.size(); ++size)
    if (size != 112) expectSays(refusal(whole.substr(0, size)), "a.shp: ");
  whole[whole.size() - 4 * 16 - 2 * 4 - 4] = 127;  // the number of points
  EXPECT_EQ(refusal(whole), "a.shp: a shape is longer than its record");
}

}  // namespace
}  // namespace curvisplat
