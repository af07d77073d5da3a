// AMR sets of VTK: finer patches hide the cells that they cover.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>

#include "preprocess/convert/convert.h"
#include "preprocess/formats/open/open_grid.h"
#include "preprocess/formats/vtk/vtk_grid.h"
#include "stream/base/error.h"
#include "tests/support/temporary_folder.h"

namespace curvisplat {
namespace {

/// An image of `cells` cells along each axis, with its spacing as the value of cells ("c") and of points ("p").
void writeImage(const std::filesystem::path& path, double origin, double spacing, int cells) {
  std::ofstream file(path);
  const int nodes = cells + 1;
  const std::string extent = fmt::format("0 {0} 0 {0} 0 {0}", cells);
  file << fmt::format(
      "<VTKFile type=\"ImageData\" version=\"1.0\" byte_order=\"LittleEndian\">\n"
      "<ImageData WholeExtent=\"{0}\" Origin=\"{1} {1} {1}\" Spacing=\"{2} {2} {2}\">\n<Piece "
      "Extent=\"{0}\">\n",
      extent, origin, spacing);
  const auto write = [&](const char* element, const char* name, int count) {
    file << fmt::format("<{}><DataArray type=\"Float32\" Name=\"{}\" format=\"ascii\">\n", element, name);
    for (int n = 0; n < count; ++n) file << spacing << ' ';
    file << fmt::format("\n</DataArray></{}>\n", element);
  };
  write("PointData", "p", nodes * nodes * nodes);
  write("CellData", "c", cells * cells * cells);
  file << "</Piece></ImageData></VTKFile>\n";
}

class AmrSets : public testing::Test {
 protected:
  AmrSets() {
    writeImage(folder_ / "coarse.vti", 0, 1, 8);
    writeImage(folder_ / "fine.vti", 2, 0.5, 8);
    writeImage(folder_ / "finest.vti", 3, 0.25, 8);
  }
  std::filesystem::path write(const std::string& name, const std::string& content) const {
    const std::filesystem::path path = folder_ / name;
    std::ofstream(path) << content;
    return path;
  }
  std::filesystem::path amr(const std::string& fine_box = "4 11 4 11 4 11") const {
    return write("set.vthb",
                 "<VTKFile type=\"vtkOverlappingAMR\" version=\"1.1\" byte_order=\"LittleEndian\">\n"
                 "<vtkOverlappingAMR origin=\"0 0 0\" grid_description=\"XYZ\">\n"
                 "<Block level=\"0\" spacing=\"1 1 1\"><DataSet index=\"0\" amr_box=\"0 7 0 7 0 7\" "
                 "file=\"coarse.vti\"/></Block>\n"
                 "<Block level=\"1\" spacing=\"0.5 0.5 0.5\"><DataSet index=\"0\" amr_box=\"" +
                     fine_box +
                     "\" file=\"fine.vti\"/></Block>\n"
                     "<Block level=\"2\" spacing=\"0.25 0.25 0.25\"><DataSet index=\"0\" amr_box=\"12 19 12 "
                     "19 12 19\" "
                     "file=\"finest.vti\"/></Block>\n"
                     "</vtkOverlappingAMR></VTKFile>\n");
  }
  static std::unique_ptr<GridSource> open(const std::filesystem::path& path) {
    OpenGridOptions options;
    options.grid = path;
    return openGrid(options);
  }
  ConvertReport convertScalar(const GridSource& source, const std::string& name) const {
    ConvertOptions options;
    options.output = folder_ / "amr.splats";
    options.overwrite = true;
    options.scalars = scalarsNamed(source.description(), {name});
    Progress progress;
    return convert(source, options, progress);
  }

  const TemporaryFolder folder_;
};

TEST_F(AmrSets, CellsThatFinerPatchesCoverAreHidden) {
  const auto source = open(amr());
  ASSERT_EQ(source->description().blocks.size(), 3u);
  NodeArrays nodes;
  const std::vector<uint32_t> scalar = scalarsNamed(source->description(), {"c"});
  const double lower[] = {2, 3}, upper[] = {6, 5};
  for (uint32_t block = 0; block < 3; ++block) {
    source->read(block, {0, 9, 0, 9}, scalar, nodes);
    size_t drawn = 0;
    for (size_t n = 0; n < nodes.x.size(); ++n) {
      if (std::isnan(nodes.scalars[0][n])) continue;
      ++drawn;
      const auto is_covered = [&](double at) { return at >= lower[block] && at < upper[block]; };
      if (block < 2) {
        EXPECT_FALSE(is_covered(nodes.x[n]) && is_covered(nodes.y[n]) && is_covered(nodes.z[n]));
      }
    }
    EXPECT_EQ(drawn, block < 2 ? 512u - 64u : 512u);
  }
  const ConvertReport cells = convertScalar(*source, "c");
  EXPECT_EQ(cells.splats, 512u - 64 + 512 - 64 + 512);
  EXPECT_NEAR(cells.volume, 512, 0.5);
  // Nodes at edges and corners of what is hidden lose the quarter or the eighth of their cells that is covered.
  EXPECT_NEAR(convertScalar(*source, "p").volume, 512, 0.5);
}

TEST_F(AmrSets, TheOlderFormStatesItsRatios) {
  const auto source = open(
      write("old.vth",
            "<VTKFile type=\"vtkHierarchicalBoxDataSet\" version=\"1.0\" byte_order=\"LittleEndian\">\n"
            "<vtkHierarchicalBoxDataSet>\n"
            "<Block level=\"0\" refinement_ratio=\"2\"><DataSet index=\"0\" amr_box=\"0 7 0 7 0 7\" "
            "file=\"coarse.vti\"/></Block>\n"
            "<Block level=\"1\"><DataSet index=\"0\" amr_box=\"4 11 4 11 4 11\" file=\"fine.vti\"/></Block>\n"
            "</vtkHierarchicalBoxDataSet></VTKFile>\n"));
  EXPECT_EQ(convertScalar(*source, "c").splats, 512u - 64 + 512);
}

TEST_F(AmrSets, WrongBoxesGetOneLine) {
  for (const char* box : {"4 10 4 11 4 11", "4 11 4 11", "11 4 4 11 4 11", "a", "4 1e30 4 11 4 11"})
    EXPECT_THROW(open(amr(box)), Error) << box;
}

TEST(AmrBoxes, OfCellsThatAreCoveredInPartAreNotHidden) {
  const std::vector<AmrPatch> patches{{0, {{-4, 0, 0}, {7, 7, 7}}}, {1, {{-5, 1, 2}, {6, 8, 9}}}};
  const auto refined = refinedCellsOf(patches, {{2, 2, 2}});
  ASSERT_EQ(refined[0].size(), 1u);
  EXPECT_EQ(refined[0][0], (VtkExtent{{2, 1, 1}, {6, 3, 4}}));  // cells -2 to 2, 1 to 3, 1 to 4
  EXPECT_TRUE(refined[1].empty());
}

}  // namespace
}  // namespace curvisplat
