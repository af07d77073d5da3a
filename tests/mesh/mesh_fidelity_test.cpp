// Pictures of unstructured grids against the field itself.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <array>
#include <map>
#include <memory>

#include "preprocess/convert/convert.h"
#include "preprocess/scenes/scenes.h"
#include "render/image/image.h"
#include "tests/reference/array_mesh.h"
#include "tests/reference/known_pictures.h"
#include "tests/support/sweep.h"
#include "tests/support/temporary_folder.h"

namespace curvisplat {
namespace {

class MeshFidelity : public ::testing::Test {
 protected:
  static constexpr const char* kFunctions[] = {"smooth", "band", "step"};

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

  const Image& reference(const std::string& function) {
    Image& image = references_[function];
    if (image.rgba.empty())
      image = toImage(referenceMarch(*scene_, KnownFunction::of(function).exact, halfAnnulusCamera(), size_));
    return image;
  }

  const std::shared_ptr<const Scene> scene_ = makeScene("half-annulus");
  const TemporaryFolder folder_;
  std::map<std::string, Image> references_;
  int number_ = 0;
  ImageSize size_{256, 256};
};

TEST_F(MeshFidelity, Tetrahedra) {
  const ArrayMesh mesh({tetrahedraOf(*scene_, 50, 25, 25)});
  const double least_points[] = {56, 58, 50}, least_cells[] = {56, 57, 52};
  for (size_t n = 0; n < 3; ++n) {
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
    for (size_t n = 0; n < 3; ++n) {
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
  if (!faults::isWholeSweep()) GTEST_SKIP() << "two minutes of processor time; see tests/support/sweep.h";
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
  for (const char* function : kFunctions) {
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

}  // namespace
}  // namespace curvisplat
