// Pictures of unstructured grids against the field itself; and a uniform medium in an unstructured grid,
// which is even inside, and ends at the outer faces.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "preprocess/convert/convert.h"
#include "preprocess/scenes/scenes.h"
#include "render/image/image.h"
#include "stream/cache/cache_reader.h"
#include "stream/model/growth_code.h"
#include "tests/reference/array_mesh.h"
#include "tests/reference/known_pictures.h"
#include "tests/support/fault_sweep.h"
#include "tests/support/temporary_folder.h"

namespace curvisplat {
namespace {

class MeshFidelity : public ::testing::Test {
 protected:
  static constexpr const char* kFunctions[] = {"smooth", "band", "step"};

  /// How many of kFunctions are tried: usually one, Corrections.* have others.
  static size_t functionsTried() { return faults::isWholeSweep() ? std::size(kFunctions) : 1; }

  Image draw(const DataSource& source, const char* scalar, const std::string& function) {
    return drawn(converted(source, scalar), function, 0);
  }

  std::string converted(const DataSource& source, const char* scalar) {
    const std::string cache = folder_ / fmt::format("{}.splats", number_++);
    ConvertOptions options;
    options.output = cache;
    options.scalars = {scalar[0] == 'c' ? 1u : 0u};
    Progress progress;
    convert(source, options, progress);
    return cache;
  }

  Image drawn(const std::string& cache, const std::string& function, double lod_pixels) const {
    FrameOptions frame = knownFrame(size_);
    frame.lod_pixels = lod_pixels;
    return drawCache(cache, KnownFunction::of(function).table, halfAnnulusCamera(), frame);
  }

  const Image& reference(const std::string& function) const { return knownReference(function, size_); }

  const std::shared_ptr<const Scene> scene_ = makeScene("half-annulus");
  const TemporaryFolder folder_;
  int number_ = 0;
  ImageSize size_{256, 256};
};

TEST_F(MeshFidelity, Tetrahedra) {
  const ArrayMesh mesh({tetrahedraOf(*scene_, 50, 25, 25)});
  const double least_points[] = {56, 58, 50}, least_cells[] = {56, 57, 52};
  for (size_t n = 0; n < functionsTried(); ++n) {
    const double points = compareImages(draw(mesh, "f", kFunctions[n]), reference(kFunctions[n])).psnr_db;
    const double cells = compareImages(draw(mesh, "c", kFunctions[n]), reference(kFunctions[n])).psnr_db;
    fmt::print("{}: {:.1f} dB of points, {:.1f} dB of cells\n", kFunctions[n], points, cells);
    EXPECT_GE(points, least_points[n]) << kFunctions[n];
    EXPECT_GE(cells, least_cells[n]) << kFunctions[n];
  }
}

TEST_F(MeshFidelity, CoarseLevels) {
  // As large on the screen as cells of 100 x 50 x 50 cubes are in a picture of 256 x 256.
  size_ = {128, 128};
  struct Case {
    const char* scalar;
    double pixels;
    std::array<double, 3> least;  // [function]
  };
  const Case cases[] = {{"f", 4, {60, 58, 46}},
                        {"f", 8, {52, 47, 37.5}},
                        {"c", 4, {58.5, 58, 45.5}},
                        {"c", 8, {52.5, 47.5, 37.5}}};
  const ArrayMesh mesh({tetrahedraOf(*scene_, 50, 25, 25)});
  const std::map<std::string, std::string> caches{{"f", converted(mesh, "f")}, {"c", converted(mesh, "c")}};
  for (const Case& one : cases)
    for (size_t n = 0; n < functionsTried(); ++n) {
      const auto dbOf = [&](const std::string& cache, double pixels) {
        return compareImages(drawn(cache, kFunctions[n], pixels), reference(kFunctions[n])).psnr_db;
      };
      const double db = dbOf(caches.at(one.scalar), one.pixels);
      fmt::print("{}, {} at {} pixels: {:.1f} dB, finest {:.1f} dB\n", kFunctions[n],
                 one.scalar[0] == 'f' ? "points" : "cells", one.pixels, db, dbOf(caches.at(one.scalar), 0));
      EXPECT_GE(db, one.least[n]) << kFunctions[n];
    }
}

TEST_F(MeshFidelity, FinerTetrahedra) {
  if (!faults::isWholeSweep())
    GTEST_SKIP() << "two minutes of processor time; see tests/support/fault_sweep.h";
  const ArrayMesh mesh({tetrahedraOf(*scene_, 100, 50, 50)});
  const double least_points[] = {66, 67, 56}, least_cells[] = {64, 64.5, 56};
  for (size_t n = 0; n < 3; ++n) {
    const double points = compareImages(draw(mesh, "f", kFunctions[n]), reference(kFunctions[n])).psnr_db;
    const double cells = compareImages(draw(mesh, "c", kFunctions[n]), reference(kFunctions[n])).psnr_db;
    fmt::print("{}: {:.1f} dB of points, {:.1f} dB of cells\n", kFunctions[n], points, cells);
    EXPECT_GE(points, least_points[n]) << kFunctions[n];
    EXPECT_GE(cells, least_cells[n]) << kFunctions[n];
  }
}

TEST_F(MeshFidelity, HexahedraLookLikeTheStructuredGrid) {
  const ArrayMesh mesh({hexahedraOf(*scene_, 63, 31, 31)});
  const SceneGridSource grid(scene_, {64, 32, 32}, 4);
  for (const char* function : std::span(kFunctions).first(functionsTried())) {
    const Image unstructured = draw(mesh, "f", function), structured = draw(grid, "f", function);
    fmt::print("{}: {:.1f} dB, of one another {:.1f} dB\n", function,
               compareImages(unstructured, reference(function)).psnr_db,
               compareImages(structured, reference(function)).psnr_db,
               compareImages(unstructured, structured).psnr_db);
    EXPECT_GE(compareImages(unstructured, structured).psnr_db, 45) << function;
  }
}

TEST_F(MeshFidelity, NumbersAndPiecesChangeNothing) {
  const ArrayPiece piece = tetrahedraOf(*scene_, 24, 12, 12);
  const ArrayMesh whole({piece}), mixed({shuffled(piece, 7)});
  const ArrayMesh parts(split(piece, 3, [](size_t cell) { return cell / 100 % 3; }));
  for (const char* scalar : {"f", "c"}) {
    const Image expected = draw(whole, scalar, "smooth");
    EXPECT_GE(compareImages(draw(mixed, scalar, "smooth"), expected).psnr_db, 70) << scalar;
    EXPECT_GE(compareImages(draw(parts, scalar, "smooth"), expected).psnr_db, 70) << scalar;
  }
}

constexpr ImageSize kSize{192, 192};
constexpr int kEdge = 3;  // pixels from the outline that are neither inside nor outside

/// Optical depths of a picture over white of a medium of one colour.
std::vector<double> depthsOf(const Image& image, const glm::dvec3& colour) {
  int channel = 0;
  for (int n = 1; n < 3; ++n)
    if (colour[n] < colour[channel]) channel = n;
  std::vector<double> depths(image.rgba.size() / 4);
  for (size_t n = 0; n < depths.size(); ++n) {
    const double shown = image.rgba[4 * n + static_cast<size_t>(channel)] + (1 - image.rgba[4 * n + 3]);
    depths[n] = -std::log(std::clamp((shown - colour[channel]) / (1 - colour[channel]), 1e-6, 1.0));
  }
  return depths;
}

struct Evenness {
  double db = 0;
  double spread = 0;   // p98 / p2 of the depth against the true one, inside
  double mean = 0;     // of the same
  double outside = 0;  // share of the depth
};

class MeshBorders : public testing::Test {
 protected:
  MeshBorders() {
    OpticalFunction exact = function_.exact;
    colour_ = exact(0.5).colour;
  }

  Evenness measure(const DataSource& source, uint32_t scalar, const Camera& camera) {
    ConvertOptions options;
    options.output = folder_ / "mesh.splats";
    options.scalars = {scalar};
    options.overwrite = true;
    Progress progress;
    convert(source, options, progress);
    const Image picture = drawCache(options.output, function_.table, camera, knownFrame(kSize));
    const Image reference = toImage(referenceMarch(*scene_, function_.exact, camera, kSize));
    const std::vector<double> drawn = depthsOf(picture, colour_), truth = depthsOf(reference, colour_);

    Evenness found;
    found.db = compareImages(picture, reference).psnr_db;
    std::vector<double> ratios;
    double all = 0, outside = 0, shown = 0, true_depth = 0;
    for (int y = kEdge; y + kEdge < kSize.height; ++y)
      for (int x = kEdge; x + kEdge < kSize.width; ++x) {
        bool any = false, every = true;
        for (int dy = -kEdge; dy <= kEdge; ++dy)
          for (int dx = -kEdge; dx <= kEdge; ++dx) {
            const bool there = truth[at(x + dx, y + dy)] > 0;
            any |= there;
            every &= there;
          }
        all += drawn[at(x, y)];
        if (!any) outside += drawn[at(x, y)];
        if (!every) continue;
        ratios.push_back(drawn[at(x, y)] / truth[at(x, y)]);
        shown += drawn[at(x, y)];
        true_depth += truth[at(x, y)];
      }
    std::sort(ratios.begin(), ratios.end());
    found.spread = ratios[ratios.size() * 98 / 100] / ratios[ratios.size() * 2 / 100];
    found.mean = shown / true_depth;
    found.outside = outside / all;
    return found;
  }

  void expectEven(const char* what, const ArrayPiece& piece, uint32_t scalar, double oblique_db,
                  double edge_on_db) {
    const ArrayMesh mesh({piece});
    const struct {
      const char* name;
      Camera camera;
      double db;
    } views[] = {{"obliquely", halfAnnulusCamera(), oblique_db}, {"edge-on", edgeOnCamera(), edge_on_db}};
    for (const auto& [view, camera, db] : views) {
      const Evenness found = measure(mesh, scalar, camera);
      fmt::print("{}, {}: {:.1f} dB, p98/p2 {:.3f}, density {:.4f}, outside {:.4f} %\n", what, view, found.db,
                 found.spread, found.mean, 100 * found.outside);
      EXPECT_GE(found.db, db) << what << ", " << view;
      EXPECT_LE(found.outside, 1e-4) << what << ", " << view;
      EXPECT_NEAR(found.mean, 1, 0.01) << what << ", " << view;
    }
  }

  static size_t at(int x, int y) { return static_cast<size_t>(y) * kSize.width + static_cast<size_t>(x); }

  const std::shared_ptr<const Scene> scene_ = makeScene("half-annulus-constant");
  const KnownFunction function_ = KnownFunction::of("smooth");
  glm::dvec3 colour_{0.0};
  const TemporaryFolder folder_;
};

TEST_F(MeshBorders, OfPoints) {
  expectEven("points of hexahedra", hexahedraOf(*scene_, 31, 15, 15), 0, 50, 37);
  expectEven("points of tetrahedra", tetrahedraOf(*scene_, 24, 12, 12), 0, 46.5, 35.5);
}

TEST_F(MeshBorders, OfCells) {
  expectEven("hexahedra", hexahedraOf(*scene_, 31, 15, 15), 1, 47.5, 36);
  expectEven("tetrahedra", tetrahedraOf(*scene_, 24, 12, 12), 1, 43.5, 33);
}

/// Boxes of hexahedra side by side along x: n cells to a unit of length in each.
ArrayPiece boxes(std::initializer_list<uint64_t> cells) {
  ArrayPiece all;
  std::map<std::array<uint64_t, 3>, uint64_t> numbers;  // points, in 1/64
  uint64_t box = 0;
  for (const uint64_t n : cells) {
    const auto point = [&](uint64_t i, uint64_t j, uint64_t k) {
      const std::array<uint64_t, 3> at{64 * box + 64 * i / n, 64 * j / n, 64 * k / n};
      const auto [found, is_new] = numbers.emplace(at, all.points.size());
      if (is_new) all.points.push_back(glm::dvec3(at[0], at[1], at[2]) / 64.0);
      return found->second;
    };
    for (uint64_t k = 0; k < n; ++k)
      for (uint64_t j = 0; j < n; ++j)
        for (uint64_t i = 0; i < n; ++i)
          all.cells.append(CellKind::kHexahedron,
                           std::array{point(i, j, k), point(i + 1, j, k), point(i + 1, j + 1, k),
                                      point(i, j + 1, k), point(i, j, k + 1), point(i + 1, j, k + 1),
                                      point(i + 1, j + 1, k + 1), point(i, j + 1, k + 1)});
    ++box;
  }
  setValues(all, [](const glm::dvec3& x) { return x.x; });
  return all;
}

/// Converts the scalar at points (0) or of cells (1), and calls use(position, geometry, n) for each splat of the finest
/// level.
template <typename Use>
void forEachSplat(const ArrayPiece& piece, const std::filesystem::path& folder, const Use& use,
                  uint32_t scalar = 0) {
  ConvertOptions options;
  options.output = folder / "splats.splats";
  options.scalars = {scalar};
  options.overwrite = true;
  Progress progress;
  convert(ArrayMesh({piece}), options, progress);
  const CacheReader cache(options.output);
  for (uint32_t number = 0; number < cache.bricks().size(); ++number) {
    if (!cache.bricks()[number].isLeaf()) continue;
    SplatGeometry geometry;
    cache.readGeometry(number, geometry);
    const glm::dvec3 corner = cache.manifest().root.cellMin(cache.bricks()[number].cell);
    for (size_t n = 0; n < geometry.size(); ++n)
      use(corner + glm::dvec3(geometry.x[n], geometry.y[n], geometry.z[n]), geometry, n);
  }
}

TEST_F(MeshBorders, HangingNodesAreInside) {
  size_t inside = 0, cut = 0;
  forEachSplat(boxes({8, 16}), folder_.path(), [&](const glm::dvec3& x, const SplatGeometry& of, size_t n) {
    const uint32_t border_code = of.border_code[n];
    const double edge = std::min({x.x, 2 - x.x, x.y, 1 - x.y, x.z, 1 - x.z});
    if (edge < 0.02) {
      ++cut;
      EXPECT_NE(border_code, kNoBorder) << x.x << ' ' << x.y << ' ' << x.z;
    }
    if (edge < 0.2 || std::abs(x.x - 1) > 0.2) return;
    ++inside;
    EXPECT_EQ(border_code, kNoBorder) << x.x << ' ' << x.y << ' ' << x.z;
  });
  EXPECT_GT(inside, 100u);
  EXPECT_GT(cut, 500u);
}

/// DESIGN.md's kernel.
double kernelAt(double r) {
  if (r < 0.889392) return 0.557526 + r * r * (-1.157743 + 0.671033 * r);
  const double rest = std::max(0.0, 1.556228 - r);
  return rest * rest * (0.067599 + 0.282474 * rest);
}

/// growth_code.h's factor of the kernel, at a place in the frame of A.
double skewAt(uint32_t growth_code, const glm::dvec3& place) {
  constexpr double kSigma = 0.44655;
  const CellGrowth growth = cellGrowth(growth_code);
  double factor = 1;
  for (size_t n = 0; n < 3; ++n) {
    const double v = glm::dot(glm::dvec3(growth.axis[n]), place) / kSigma;
    factor += 0.9 * growth.growth[n] * (v * v * v - 3 * v) / 6;
  }
  return std::max(0.0, factor);
}

TEST_F(MeshBorders, AMediumIsEvenWhereSizesOfCellsMeet) {
  // Cells of 1/8 and 1/16: the mean density over two coarse cells along y and z, at places along x.
  constexpr int kAlong = 40, kAcross = 8;
  const auto placeAt = [](int i) { return 0.75 + 0.5 * (i + 0.5) / kAlong; };
  struct Case {
    uint32_t scalar;
    double off;
  };
  // In one dimension from 0.98 to 1.03 at points (0.89 to 1.33 of dual cells as they are), and from 0.995 to 1.005 of
  // cells (0.83 to 1.17).
  for (const Case& one : {Case{0, 0.05}, Case{1, 0.02}}) {
    std::array<double, kAlong> density{};
    size_t splats = 0;
    forEachSplat(
        boxes({8, 16}), folder_.path(),
        [&](const glm::dvec3& x, const SplatGeometry& of, size_t n) {
          constexpr double kReach = 0.25;
          if (std::abs(x.x - 1) > 0.25 + kReach) return;
          ++splats;
          const Splat splat{
              x, {of.axis0[n], of.axis1[n], of.axis2[n]}, {of.shear10[n], of.shear20[n], of.shear21[n]}, 1};
          const glm::dmat3 inverse = glm::inverse(splat.factor());
          const double height = of.weight[n] / (splat.axis[0] * splat.axis[1] * splat.axis[2]);
          if (std::max(std::abs(x.y - 0.5), std::abs(x.z - 0.5)) < 0.35) {
            EXPECT_EQ(of.border_code[n], kNoBorder) << x.x << ' ' << x.y << ' ' << x.z;
          }
          for (int i = 0; i < kAlong; ++i)
            for (int j = 0; j < kAcross; ++j)
              for (int k = 0; k < kAcross; ++k) {
                const glm::dvec3 at(placeAt(i), 0.375 + 0.25 * (j + 0.5) / kAcross,
                                    0.375 + 0.25 * (k + 0.5) / kAcross);
                const glm::dvec3 place = inverse * (at - x);
                density[static_cast<size_t>(i)] += height * kernelAt(glm::length(place)) *
                                                   skewAt(of.growth_code[n], place) / (kAcross * kAcross);
              }
        },
        one.scalar);
    EXPECT_GT(splats, 1500u);
    for (int i = 0; i < kAlong; ++i)
      EXPECT_NEAR(density[static_cast<size_t>(i)], 1, one.off)
          << "at " << placeAt(i) << " of scalar " << one.scalar;
  }
}

/// The scene in hexahedra: nu x nv x nw, with every cell beyond the middle of `axis` cut into eight.
ArrayPiece jointOf(const Scene& scene, const std::array<uint64_t, 3>& cells, size_t axis) {
  ArrayPiece all;
  std::map<std::array<uint64_t, 3>, uint64_t> numbers;  // points, in half cells
  const auto point = [&](const std::array<uint64_t, 3>& at) {
    const auto [found, is_new] = numbers.emplace(at, all.points.size());
    glm::dvec3 place(0.0);
    for (int n = 0; n < 3; ++n)
      place[n] = static_cast<double>(at[static_cast<size_t>(n)]) /
                 static_cast<double>(2 * cells[static_cast<size_t>(n)]);
    if (is_new) all.points.push_back(scene.position(place));
    return found->second;
  };
  constexpr std::array<std::array<uint64_t, 3>, 8> kCorners{
      {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}, {0, 0, 1}, {1, 0, 1}, {1, 1, 1}, {0, 1, 1}}};
  const auto append = [&](const std::array<uint64_t, 3>& low, uint64_t size) {
    std::array<uint64_t, 8> corners;
    for (size_t n = 0; n < 8; ++n)
      corners[n] = point(
          {low[0] + size * kCorners[n][0], low[1] + size * kCorners[n][1], low[2] + size * kCorners[n][2]});
    all.cells.append(CellKind::kHexahedron, corners);
  };
  for (uint64_t k = 0; k < 2 * cells[2]; k += 2)
    for (uint64_t j = 0; j < 2 * cells[1]; j += 2)
      for (uint64_t i = 0; i < 2 * cells[0]; i += 2) {
        const std::array<uint64_t, 3> low{i, j, k};
        if (low[axis] < cells[axis])
          append(low, 2);
        else
          for (const auto& corner : kCorners)
            append({low[0] + corner[0], low[1] + corner[1], low[2] + corner[2]}, 1);
      }
  setValues(all, [&](const glm::dvec3& x) { return scene.scalar(x); });
  return all;
}

TEST_F(MeshBorders, HangingNodesOnCurvedJoints) {
  // The fine faces' hanging nodes lie on the arc, beside the plane of the coarse face.
  const struct {
    const char* what;
    size_t axis;
  } joints[] = {{"the angle", 0}, {"the radius", 1}, {"the height", 2}};
  for (const auto& [what, axis] : joints) {
    const ArrayPiece piece = jointOf(*scene_, {32, 16, 16}, axis);
    size_t inside = 0, cut = 0;
    forEachSplat(piece, folder_.path(),
                 [&, axis_of_joint = static_cast<int>(axis)](const glm::dvec3& x, const SplatGeometry& of,
                                                             size_t splat) {
                   const std::optional<glm::dvec3> uvw = scene_->inverse(x);
                   if (!uvw || std::abs((*uvw)[axis_of_joint] - 0.5) > 0.15) return;
                   for (int n = 0; n < 3; ++n)
                     if (n != axis_of_joint && std::abs((*uvw)[n] - 0.5) > 0.35) return;
                   ++inside;
                   cut += of.border_code[splat] != kNoBorder;
                 });
    EXPECT_GT(inside, 500u) << what;
    EXPECT_EQ(cut, 0u) << "of " << inside << " points at a joint across " << what;
    expectEven(fmt::format("points, joint across {}", what).c_str(), piece, 0, 49, 36.5);
    expectEven(fmt::format("cells, joint across {}", what).c_str(), piece, 1, 48, 36);
  }
}

}  // namespace
}  // namespace curvisplat
