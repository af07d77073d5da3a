// Conversion of unstructured grids: what must hold whatever the cells, the threads and the memory.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <csignal>
#include <fstream>
#include <glm/geometric.hpp>
#include <limits>
#include <map>
#include <numeric>
#include <random>
#include <set>
#include <span>

#include "preprocess/convert/convert.h"
#include "preprocess/scenes/scenes.h"
#include "stream/base/error.h"
#include "stream/cache/cache_reader.h"
#include "tests/reference/array_mesh.h"
#include "tests/support/expect_error.h"
#include "tests/support/fault_sweep.h"
#include "tests/support/faulty_system_calls.h"
#include "tests/support/same_caches.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/thread_ranks.h"

namespace curvisplat {
namespace {

class MeshConvert : public ::testing::Test {
 protected:
  ConvertOptions options(uint32_t scalar) const {
    ConvertOptions options;
    options.output = folder_ / "mesh.splats";
    options.scalars = {scalar};
    options.overwrite = true;
    options.memory_bytes = uint64_t{512} << 20;
    return options;
  }

  Files filesOf(const DataSource& source, const ConvertOptions& how) const {
    converted(source, how);
    return allFilesOf(how.output);
  }

  /// Usually of points and of cells by turns, with one mesh after the other.
  std::vector<uint32_t> scalarsTried() {
    if (faults::isWholeSweep()) return {0, 1};
    return {turn_++ % 2};
  }

  std::string errorOf(const DataSource& source, const ConvertOptions& how) const {
    return curvisplat::errorOf([&] { converted(source, how); });
  }

  const std::shared_ptr<const Scene> scene_ = makeScene("half-annulus");
  const ArrayPiece tetrahedra_ = tetrahedraOf(*scene_, 16, 8, 8), hexahedra_ = hexahedraOf(*scene_, 16, 8, 8);
  const TemporaryFolder folder_;
  uint32_t turn_ = 0;
};

/// A cube with corners at 0 and 1, cut into every shape: prisms, pyramids, tetrahedra and a polyhedron.
ArrayPiece mixedCube(uint64_t n) {
  const auto cube = makeScene("half-annulus");
  ArrayPiece all = hexahedraOf(*cube, n, n, n);
  for (size_t p = 0; p < all.points.size(); ++p)
    all.points[p] = glm::dvec3(static_cast<double>(p % (n + 1)), static_cast<double>(p / (n + 1) % (n + 1)),
                               static_cast<double>(p / (n + 1) / (n + 1))) /
                    static_cast<double>(n);
  ArrayPiece out;
  out.points = all.points;
  for (size_t cell = 0; cell < all.cells.size(); ++cell) {
    const auto c = all.cells.cornersOfCell(cell);
    if (cell % 4 == 0) {
      out.cells.append(CellKind::kWedge, std::array{c[0], c[1], c[2], c[4], c[5], c[6]});
      out.cells.append(CellKind::kWedge, std::array{c[0], c[2], c[3], c[4], c[6], c[7]});
    } else if (cell % 4 == 1) {
      glm::dvec3 middle(0.0);
      for (const uint64_t corner : c) middle += all.points[corner] / 8.0;
      const uint64_t apex = out.points.size();
      out.points.push_back(middle);
      constexpr std::array<std::array<size_t, 4>, 6> kFaces{
          {{0, 1, 2, 3}, {4, 7, 6, 5}, {0, 4, 5, 1}, {1, 5, 6, 2}, {2, 6, 7, 3}, {3, 7, 4, 0}}};
      for (const auto& f : kFaces)
        out.cells.append(CellKind::kPyramid, std::array{c[f[0]], c[f[1]], c[f[2]], c[f[3]], apex});
    } else if (cell % 4 == 2) {
      std::vector<uint64_t> stream;
      const auto faces = facesOf(CellKind::kHexahedron, {});
      for (size_t at = 0; at < faces.size(); at += faces[at] + size_t{1}) {
        stream.push_back(faces[at]);
        for (const uint32_t place : faces.subspan(at + 1, faces[at])) stream.push_back(c[place]);
      }
      EXPECT_TRUE(out.cells.appendPolyhedron(6, stream));
    } else {
      out.cells.append(CellKind::kHexahedron, c);
    }
  }
  // Inner points move a little: the cache rounds weights, and equal ones all the same way.
  std::mt19937 random(1);
  std::uniform_real_distribution<double> shift(-0.1 / static_cast<double>(n), 0.1 / static_cast<double>(n));
  for (glm::dvec3& point : out.points)
    for (int axis = 0; axis < 3; ++axis)
      if (point[axis] > 0 && point[axis] < 1) point[axis] += shift(random);
  setValues(out, [](const glm::dvec3& x) { return 3 + x.x - 2 * x.y + 0.5 * x.z; });
  return out;
}

TEST_F(MeshConvert, BytesAreTheSameForAnyThreadsAndMemory) {
  const ArrayMesh meshes[] = {ArrayMesh({shuffled(tetrahedra_, 3)}), ArrayMesh({mixedCube(9)}),
                              ArrayMesh(split(hexahedra_, 3, [](size_t cell) { return cell / 50 % 3; }))};
  for (const ArrayMesh& mesh : meshes)
    for (const uint32_t scalar : scalarsTried()) {
      // Points that pieces share have to fit.
      const uint64_t least = mesh.description().pieces.size() > 1 ? 200'000 : 20'000;
      std::vector<Variation> variations{{.threads = 1, .mesh_bytes = 200'000},
                                        {.threads = 2, .mesh_bytes = least}};
      if (faults::isWholeSweep())
        variations.insert(
            variations.end(),
            {{.threads = 1}, {.threads = 1, .mesh_bytes = 400'000}, {.threads = 1, .mesh_bytes = least}});
      expectSameCaches(mesh, options(scalar), variations);
    }
}

/// The piece with its cells from `first` on in a random order.
ArrayPiece shuffledFrom(size_t first, const ArrayPiece& piece) {
  std::vector<size_t> order(piece.cells.size());
  std::iota(order.begin(), order.end(), size_t{0});
  std::shuffle(order.begin() + static_cast<ptrdiff_t>(first), order.end(), std::mt19937(5));
  ArrayPiece out{piece.points, {}, piece.point_values, {}};
  for (const size_t cell : order) {
    out.cells.append(piece.cells.shapes[cell], piece.cells.cornersOfCell(cell));
    out.cell_values.push_back(piece.cell_values[cell]);
  }
  return out;
}

TEST_F(MeshConvert, PagesOfPointsMakeTheSameBytes) {
  // 16 pages of sums, 4 of positions: all fit, some of them, or those of the cells in order alone.
  const ArrayPiece hexahedra = hexahedraOf(*scene_, 60, 30, 30);
  const ArrayMesh meshes[] = {ArrayMesh({hexahedra}), ArrayMesh({shuffledFrom(30'000, hexahedra)}),
                              ArrayMesh(split(hexahedra, 3, [](size_t cell) { return cell / 5000 % 3; }))};
  for (const ArrayMesh& mesh : meshes)
    for (const uint32_t scalar : scalarsTried())
      expectSameCaches(mesh, options(scalar), {{.mesh_bytes = 16'000'000}, {.mesh_bytes = 3'000'000}});
}

TEST_F(MeshConvert, SeveralRanksMakeTheSameBytes) {
  // More than a bucket may have, so that ranks share the building.
  const ArrayMesh meshes[] = {
      ArrayMesh({shuffled(tetrahedraOf(*scene_, 40, 20, 20), 3)}),
      ArrayMesh(split(hexahedraOf(*scene_, 60, 30, 30), 3, [](size_t cell) { return cell / 500 % 3; }))};
  for (const ArrayMesh& mesh : meshes)
    for (const uint32_t scalar : scalarsTried()) {
      ConvertOptions how = options(scalar);
      how.threads = 1;
      std::vector<Variation> variations{{.bucket_splats = 9000, .ranks = 3}};
      if (faults::isWholeSweep()) variations.push_back({.bucket_splats = 9000, .ranks = 2});
      expectSameCaches(mesh, how, variations);
    }
}

/// Stops the conversion at a write.
class StoppingSystemCalls : public SystemCalls {
 public:
  StoppingSystemCalls(Progress& progress, int64_t stop_at) : progress_(progress), left_(stop_at) {}
  ssize_t pwrite(int fd, const void* from, size_t count, int64_t offset) override {
    if (left_-- == 0) progress_.stop(SIGINT);
    return SystemCalls::pwrite(fd, from, count, offset);
  }

 private:
  Progress& progress_;
  std::atomic<int64_t> left_;
};

TEST_F(MeshConvert, InterruptedConversionsResumeToTheSameBytes) {
  const ArrayMesh mesh({shuffled(tetrahedraOf(*scene_, 30, 15, 15), 3)});
  for (const uint32_t scalar : {0u, 1u}) {
    ConvertOptions how = options(scalar);
    how.limits.bucket_splats = 9000;
    how.limits.mesh_bytes = 400'000;
    const Files expected = filesOf(mesh, how);
    removeAll(how.output);
    int interrupted = 0;
    for (int64_t stop_at = 1; stop_at < 400; stop_at += faults::isWholeSweep() ? 23 : 97) {
      Progress progress;
      StoppingSystemCalls calls(progress, stop_at);
      const ScopedSystemCalls scoped(calls);
      ConvertOptions part = how;
      part.overwrite = false;
      part.resume = interrupted > 0;
      try {
        convert(mesh, part, progress);
        break;
      } catch (const Interrupted&) {
        ++interrupted;
      }
    }
    EXPECT_GT(interrupted, 0);
    if (!std::filesystem::exists(how.output / "manifest.json")) {
      how.overwrite = false;
      how.resume = true;
      converted(mesh, how);
    }
    EXPECT_EQ(allFilesOf(how.output), expected);
  }
}

TEST_F(MeshConvert, WeightsSumToTheVolume) {
  const ArrayMesh cube({mixedCube(10)});
  for (const uint32_t scalar : {0u, 1u}) EXPECT_NEAR(converted(cube, options(scalar)).volume, 1, 1e-4);
  // The tetrahedra's own volume, which is less than the scene's.
  double volume = 0;
  for (size_t n = 0; n < tetrahedra_.cells.size(); ++n) {
    const auto c = tetrahedra_.cells.cornersOfCell(n);
    const auto at = [&](size_t corner) { return tetrahedra_.points[c[corner]]; };
    volume += std::abs(glm::dot(at(1) - at(0), glm::cross(at(2) - at(0), at(3) - at(0)))) / 6;
  }
  const ArrayMesh mesh({tetrahedra_});
  for (const uint32_t scalar : {0u, 1u})
    EXPECT_NEAR(converted(mesh, options(scalar)).volume / volume, 1, 1e-4);
}

TEST_F(MeshConvert, LinearFieldsAreExact) {
  // Every shape has the field's mean at the splat's middle, and its slope.
  for (const ArrayPiece& piece : {mixedCube(6), tetrahedra_}) {
    ArrayPiece linear = piece;
    const glm::dvec3 gradient(1, -2, 0.5);
    setValues(linear, [&](const glm::dvec3& x) { return 3 + glm::dot(gradient, x); });
    converted(ArrayMesh({linear}), options(0));
    const CacheReader cache(folder_ / "mesh.splats");
    for (uint32_t number = 0; number < cache.bricks().size(); ++number) {
      if (!cache.bricks()[number].isLeaf()) continue;
      SplatGeometry geometry;
      SplatVariable values;
      cache.readGeometry(number, geometry);
      cache.readVariable(number, 0, values);
      const glm::dvec3 corner = cache.manifest().root.cellMin(cache.bricks()[number].cell);
      for (size_t n = 0; n < geometry.size(); ++n) {
        const glm::dvec3 x = corner + glm::dvec3(geometry.x[n], geometry.y[n], geometry.z[n]);
        EXPECT_NEAR(values.mean[n], 3 + glm::dot(gradient, x), 2e-3);
      }
    }
  }
}

TEST_F(MeshConvert, BlankedPointsTakeTheirCellsAlong) {
  ArrayPiece piece = hexahedra_;
  const uint64_t corner = piece.cells.cornersOfCell(0)[0];  // of one cell only
  const double whole = converted(ArrayMesh({piece}), options(0)).volume;
  const double whole_cells = converted(ArrayMesh({piece}), options(1)).volume;
  piece.point_values[corner] = std::numeric_limits<float>::quiet_NaN();
  ConvertReport report = converted(ArrayMesh({piece}), options(0));
  EXPECT_EQ(report.blanked.not_finite, 1u);
  EXPECT_EQ(report.splats, piece.points.size() - 1);
  EXPECT_LT(report.volume, whole);
  piece.point_values[corner] = -99;
  ConvertOptions how = options(0);
  how.blank_value = -99;
  report = converted(ArrayMesh({piece}), how);
  EXPECT_EQ(report.blanked.by_value, 1u);
  const double by_value = report.volume;
  piece.points[corner].y = std::numeric_limits<double>::infinity();
  EXPECT_EQ(converted(ArrayMesh({piece}), options(0)).volume, by_value);
  EXPECT_LT(converted(ArrayMesh({piece}), options(1)).volume, whole_cells);
  piece.cell_values[3] = std::numeric_limits<float>::quiet_NaN();
  EXPECT_EQ(converted(ArrayMesh({piece}), options(1)).blanked.not_finite, 1u);
}

TEST_F(MeshConvert, OddMeshesAreConvertedAndTheirOdditiesCounted) {
  // A point that no cell has, a cell with repeated corners, one without volume, one that is inside out.
  ArrayPiece piece = hexahedra_;
  piece.points.push_back({1e9, 0, 0});
  const auto c = piece.cells.cornersOfCell(5);
  const std::array<uint64_t, 8> corners{c[0], c[1], c[2], c[3], c[4], c[5], c[6], c[7]};
  piece.cells.append(CellKind::kHexahedron,
                     std::array<uint64_t, 8>{corners[0], corners[0], corners[0], corners[0], corners[0],
                                             corners[0], corners[0], corners[0]});
  piece.cells.append(CellKind::kTetrahedron,
                     std::array<uint64_t, 4>{corners[0], corners[1], corners[1], corners[2]});
  setValues(piece, [&](const glm::dvec3& x) { return x.x; });
  piece.point_values.back() = 1e30f;
  for (const uint32_t scalar : {0u, 1u}) {
    const ConvertReport report = converted(ArrayMesh({piece}), options(scalar));
    ASSERT_EQ(report.warnings.size(), 1u);
    expectSays(report.warnings[0], "1 of 1378 points belong to no solid cell");
    EXPECT_NEAR(report.volume, converted(ArrayMesh({hexahedra_}), options(scalar)).volume, 1e-3);
    EXPECT_LT(CacheReader(folder_ / "mesh.splats").manifest().upper.x, 10);
  }
}

TEST_F(MeshConvert, WrongNumbersGiveOneLine) {
  ArrayPiece piece = hexahedra_;
  piece.cells.corners[100] = piece.points.size();
  const std::string error = errorOf(ArrayMesh({piece}), options(0));
  expectSays(error, "mesh: cell 12 refers to point 1377; expected 0 to 1376");
  EXPECT_EQ(error.find('\n'), std::string::npos);

  ArrayPiece blank = hexahedra_;
  for (float& value : blank.point_values) value = std::numeric_limits<float>::quiet_NaN();
  expectSays(errorOf(ArrayMesh({blank}), options(0)), "there is nothing to draw");

  ConvertOptions both = options(0);
  both.scalars = {0, 1};
  expectSays(errorOf(ArrayMesh({hexahedra_}), both), "convert them to two caches");
}

TEST_F(MeshConvert, PiecesShareTheirPoints) {
  const ArrayMesh parts(split(hexahedra_, 2, [](size_t cell) { return cell < 500 ? 0 : 1; }));
  const ConvertReport report = converted(parts, options(0));
  EXPECT_EQ(report.splats, hexahedra_.points.size());
  EXPECT_EQ(report.nodes, hexahedra_.points.size() + report.merged_nodes);
  EXPECT_GT(report.merged_nodes, 0u);
}

/// Gives each group of cells points of its own, as discontinuous elements are written. The mesh is the same.
ArrayPiece apart(const ArrayPiece& piece, size_t cells_of_element) {
  ArrayPiece out;
  out.cell_values = piece.cell_values;
  std::map<uint64_t, uint64_t> points;
  for (size_t n = 0; n < piece.cells.size(); ++n) {
    if (n % cells_of_element == 0) points.clear();
    const size_t begin = out.cells.corners.size();
    out.cells.appendOf(piece.cells, n);
    for (uint64_t& corner : std::span(out.cells.corners).subspan(begin)) {
      const auto [own, is_new] = points.emplace(corner, out.points.size());
      if (is_new) {
        out.points.push_back(piece.points[corner]);
        out.point_values.push_back(piece.point_values[corner]);
      }
      corner = own->second;
    }
  }
  return out;
}

/// The splats of all leaves, in the order of their places: position, weight, mean and slope.
std::vector<std::array<double, 8>> leavesOf(const std::filesystem::path& cache_path) {
  const CacheReader cache(cache_path);
  std::vector<std::array<double, 8>> splats;
  SplatGeometry g;
  SplatVariable v;
  for (uint32_t number = 0; number < cache.bricks().size(); ++number) {
    if (!cache.bricks()[number].isLeaf()) continue;
    const glm::dvec3 corner = cache.manifest().root.cellMin(cache.bricks()[number].cell);
    cache.readGeometry(number, g);
    cache.readVariable(number, 0, v);
    for (size_t n = 0; n < g.size(); ++n)
      splats.push_back({corner.x + g.x[n], corner.y + g.y[n], corner.z + g.z[n], g.weight[n], v.mean[n],
                        v.slope0[n], v.slope1[n], v.slope2[n]});
  }
  std::ranges::sort(splats);
  return splats;
}

TEST_F(MeshConvert, ElementsApartAreDrawnAsOneMesh) {
  const ArrayPiece cube = mixedCube(10);
  for (const uint32_t scalar : {0u, 1u})
    for (const uint64_t mesh_bytes : {uint64_t{64} << 20, uint64_t{1} << 18}) {
      SCOPED_TRACE(fmt::format("scalar {}, {} bytes", scalar, mesh_bytes));
      if (!faults::isWholeSweep() && (scalar == 0) != (mesh_bytes < 1 << 20)) continue;
      ConvertOptions how = options(scalar);
      how.limits.mesh_bytes = mesh_bytes;
      converted(ArrayMesh({cube}), how);
      const auto whole = leavesOf(how.output);
      for (const size_t cells : {1u, 5u}) {
        const ArrayPiece elements = apart(cube, cells);
        const ConvertReport report = converted(ArrayMesh({elements}), how);
        EXPECT_EQ(report.merged_nodes, elements.points.size() - cube.points.size());
        const auto parts = leavesOf(how.output);
        ASSERT_EQ(parts.size(), whole.size());
        // The order of outer faces, which follows the numbers of points, counts in the last bits: a step of a code.
        for (size_t n = 0; n < whole.size(); ++n)
          for (size_t part = 0; part < whole[n].size(); ++part)
            ASSERT_NEAR(parts[n][part], whole[n][part], 2e-3 * std::abs(whole[n][part]))
                << cells << " " << part;
      }
    }
}

/// The integral of a field that is linear in each tetrahedron, and jumps between them.
TEST_F(MeshConvert, ElementsApartKeepTheirJumps) {
  ArrayPiece elements = apart(tetrahedra_, 1);
  std::mt19937 random(7);
  std::uniform_real_distribution<float> jump(0, 1);
  double integral = 0, volume = 0;
  for (size_t n = 0; n < elements.cells.size(); ++n) {
    const auto c = elements.cells.cornersOfCell(n);
    const auto at = [&](size_t corner) { return elements.points[c[corner]]; };
    const double of_cell = std::abs(glm::dot(at(1) - at(0), glm::cross(at(2) - at(0), at(3) - at(0)))) / 6;
    const float level = jump(random);
    for (const uint64_t corner : c) {
      elements.point_values[corner] = level + static_cast<float>(elements.points[corner].x) + jump(random);
      integral += of_cell / 4 * elements.point_values[corner];
    }
    volume += of_cell;
  }
  const ConvertReport report = converted(ArrayMesh({elements}), options(0));
  EXPECT_EQ(report.splats, tetrahedra_.points.size());
  const CacheReader cache(folder_ / "mesh.splats");
  SplatGeometry geometry;
  SplatVariable values;
  double drawn = 0;
  for (uint32_t number = 0; number < cache.bricks().size(); ++number) {
    if (!cache.bricks()[number].isLeaf()) continue;
    cache.readGeometry(number, geometry);
    cache.readVariable(number, 0, values);
    for (size_t n = 0; n < geometry.size(); ++n)
      drawn += static_cast<double>(geometry.weight[n]) * values.mean[n];
  }
  EXPECT_NEAR(drawn / volume, integral / volume, 1e-3);
}

/// Cells on the two sides of a thin wall have points of their own at the same places.
TEST_F(MeshConvert, PointsOnBothSidesOfAThinWallStayApart) {
  ArrayPiece walled = hexahedra_;
  const size_t half = hexahedra_.cells.size() / 2, of_first = walled.cells.corner_begin[half];
  const std::set<uint64_t> before(walled.cells.corners.begin(),
                                  walled.cells.corners.begin() + static_cast<ptrdiff_t>(of_first));
  std::map<uint64_t, uint64_t> behind;
  for (size_t n = half; n < hexahedra_.cells.size(); ++n)
    for (size_t at = walled.cells.corner_begin[n]; at < walled.cells.corner_begin[n + 1]; ++at) {
      uint64_t& corner = walled.cells.corners[at];
      if (!before.contains(corner)) continue;
      const auto [own, is_new] = behind.emplace(corner, walled.points.size());
      if (is_new) {
        walled.points.push_back(walled.points[corner]);
        walled.point_values.push_back(walled.point_values[corner] + 1);
      }
      corner = own->second;
    }
  ASSERT_FALSE(behind.empty());
  const ConvertReport report = converted(ArrayMesh({walled}), options(0));
  EXPECT_EQ(report.merged_nodes, 0u);
  EXPECT_EQ(report.splats, hexahedra_.points.size() + behind.size());
}

}  // namespace
}  // namespace curvisplat
