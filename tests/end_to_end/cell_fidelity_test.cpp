// The half-annulus sampled in cells against as many nodes, in one block and in several.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <memory>

#include "preprocess/convert/convert.h"
#include "preprocess/scenes/scenes.h"
#include "render/image/image.h"
#include "render/image/image_file.h"
#include "tests/reference/cell_grid.h"
#include "tests/reference/half_annulus_arguments.h"
#include "tests/reference/rearranged_grid.h"
#include "tests/reference/reference_march.h"
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
  Rearrangement blocks;
  blocks.cuts = {2, 2, 1};
  const RearrangedGridSource cut(corners, blocks);
  convertTo("blocks.splats",
            CellGridSource(cut, {[&](const GridCell& cell) { return scene->scalar(cell.centre); }}), 1);
  const struct {
    const char* name;
    OpticalFunction function;
    double least_db, most_lost_db;
  } functions[] = {// The border's cells are wider than half cells.
                   {"smooth", smoothFunction, 68, 3.5},
                   {"band", bandFunction, 67.5, 1.5},
                   {"step", stepFunction, 56, 1}};
  for (const auto& [name, function, least_db, most_lost_db] : functions) {
    const Image reference = toImage(referenceMarch(*scene, function, halfAnnulusCamera(), kSize));
    const double nodes_db = compareImages(render("nodes.splats", name), reference).psnr_db;
    const double cells_db = compareImages(render("cells.splats", name), reference).psnr_db;
    const double blocks_db = compareImages(render("blocks.splats", name), reference).psnr_db;
    fmt::print("{}: {:.2f} dB at nodes, {:.2f} dB in cells, {:.2f} dB of four blocks\n", name, nodes_db,
               cells_db, blocks_db);
    EXPECT_GE(blocks_db, cells_db - 0.5);
    EXPECT_GE(cells_db, least_db);
    EXPECT_GE(cells_db, nodes_db - most_lost_db);
  }
}

}  // namespace
}  // namespace curvisplat
