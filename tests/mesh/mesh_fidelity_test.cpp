// Pictures of unstructured grids against the field itself.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <map>
#include <memory>

#include "preprocess/convert/convert.h"
#include "preprocess/scenes/scenes.h"
#include "render/image/image.h"
#include "tests/reference/array_mesh.h"
#include "tests/reference/known_pictures.h"
#include "tests/support/temporary_folder.h"

namespace curvisplat {
namespace {

constexpr ImageSize kSize{256, 256};

class MeshFidelity : public testing::Test {
 protected:
  static constexpr const char* kFunctions[] = {"smooth", "band", "step"};

  Image draw(const DataSource& source, const char* scalar, const std::string& function) {
    const std::string cache = folder_ / fmt::format("{}.splats", number_++);
    ConvertOptions options;
    options.output = cache;
    options.scalars = {scalar[0] == 'c' ? 1u : 0u};
    Progress progress;
    convert(source, options, progress);
    return drawCache(cache, KnownFunction::of(function).table, halfAnnulusCamera(), knownFrame(kSize));
  }

  const Image& reference(const std::string& function) {
    Image& image = references_[function];
    if (image.rgba.empty())
      image = toImage(referenceMarch(*scene_, KnownFunction::of(function).exact, halfAnnulusCamera(), kSize));
    return image;
  }

  const std::shared_ptr<const Scene> scene_ = makeScene("half-annulus");
  const TemporaryFolder folder_;
  std::map<std::string, Image> references_;
  int number_ = 0;
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

TEST_F(MeshFidelity, DISABLED_FinerTetrahedra) {  // half a minute of processor time
  const ArrayMesh mesh({tetrahedraOf(*scene_, 100, 50, 50)});
  const double least_points[] = {61, 61, 56};
  for (size_t n = 0; n < 3; ++n) {
    const double points = compareImages(draw(mesh, "f", kFunctions[n]), reference(kFunctions[n])).psnr_db;
    fmt::print("{}: {:.1f} dB of points\n", kFunctions[n], points);
    EXPECT_GE(points, least_points[n]) << kFunctions[n];
  }
}

TEST_F(MeshFidelity, HexahedraLookLikeTheStructuredGrid) {
  const ArrayMesh mesh({hexahedraOf(*scene_, 63, 31, 31)});
  const SceneGridSource grid(scene_, {64, 32, 32}, 4);
  for (const char* function : kFunctions) {
    const Image unstructured = draw(mesh, "f", function), structured = draw(grid, "f", function);
    fmt::print("{}: {:.1f} dB, structured {:.1f} dB, of one another {:.1f} dB\n", function,
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
