// The half-annulus sampled in cells against as many nodes. Cells lose most along the silhouette: nodes have
// half cells there, whose kernels end more sharply than those of whole cells.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <memory>

#include "preprocess/convert.h"
#include "preprocess/scenes.h"
#include "render/image.h"
#include "tests/support/cell_grid.h"
#include "tests/support/half_annulus_words.h"
#include "tests/support/reference_march.h"
#include "tests/support/run_program.h"
#include "tests/support/temporary_folder.h"

namespace curvisplat {
namespace {

constexpr ImageSize kSize{256, 256};

class CellFidelity : public testing::Test {
 protected:
  void convertTo(const std::string& name, const GridSource& source, uint32_t scalar) {
    ConvertOptions options;
    options.output = folder_ / name;
    options.scalars = {scalar};
    Progress progress;
    convert(source, options, progress);
  }

  Image render(const std::string& name, const std::string& function) {
    const std::string picture = folder_ / "picture.pfm";
    const ProgramResult result =
        runProgram(halfAnnulusWords(folder_ / name, picture, function, {256, 256}, "0"));
    EXPECT_EQ(result.status, 0) << result.err;
    return readImage(picture);
  }

  const TemporaryFolder folder_;
};

TEST_F(CellFidelity, IsNearThatOfNodes) {
  const std::shared_ptr<const Scene> scene = makeScene("half-annulus");
  const SceneGridSource at_nodes(scene, {128, 64, 64}), corners(scene, {129, 65, 65});
  const CellGridSource in_cells(corners, {[&](const GridCell& cell) { return scene->scalar(cell.centre); }});
  convertTo("nodes.splats", at_nodes, 0);
  convertTo("cells.splats", in_cells, 1);
  const struct {
    const char* name;
    OpticalFunction function;
    double least_db, most_lost_db;
  } functions[] = {// The border's cells are whole, and their kernels reach beyond it; nodes' half cells are
                   // drawn in parts.
                   {"smooth", smoothFunction, 59.5, 12},
                   {"band", bandFunction, 64, 2.5},
                   {"step", stepFunction, 55, 1}};
  for (const auto& [name, function, least_db, most_lost_db] : functions) {
    const Image reference = toImage(referenceMarch(*scene, function, halfAnnulusCamera(), kSize));
    const double nodes_db = compareImages(render("nodes.splats", name), reference).psnr_db;
    const double cells_db = compareImages(render("cells.splats", name), reference).psnr_db;
    fmt::print("{}: {:.2f} dB at nodes, {:.2f} dB in cells\n", name, nodes_db, cells_db);
    EXPECT_GE(cells_db, least_db);
    EXPECT_GE(cells_db, nodes_db - most_lost_db);
  }
}

}  // namespace
}  // namespace curvisplat
