// Damaged CGNS files: an Error of one line or changed values, never a crash, a hang or a silent allocation of
// what the file has no room for.
#include <gtest/gtest.h>

#include "preprocess/formats/open/open_grid.h"
#include "stream/base/error.h"
#include "tests/support/cgns_writer.h"
#include "tests/support/damaged_files.h"
#include "tests/support/temporary_folder.h"

namespace curvisplat {
namespace {

class CgnsDamage : public testing::TestWithParam<CgnsFileType> {
 protected:
  CgnsDamage() {
    const auto value = [](int64_t i, int64_t j, int64_t k) {
      return 1.0 + 0.1 * static_cast<double>(i + 7 * j + 49 * k);
    };
    CgnsWriter file(path_, GetParam());
    file.base("Base");
    file.dimensional();
    file.baseSteps({0, 1});
    file.zone("Zone", {5, 4, 3});
    file.coordinates("GridCoordinates",
                     {{"CoordinateX", value}, {"CoordinateY", value}, {"CoordinateZ", value}});
    file.solution("S 1", "Vertex", {{"Density", value}, {"Pressure", value}}, {1, 1, 0, 0, 0, 1});
    file.solution("S 2", "CellCenter", {{"Density", value}});
    file.zoneSteps({"S 1", "S 2"});
    file.zone("Other", {3, 3, 3});
    file.coordinates("GridCoordinates",
                     {{"CoordinateX", value}, {"CoordinateY", value}, {"CoordinateZ", value}});
    file.solution("S 1", "CellCenter", {{"Pressure", value, CgnsNumbers::kSinglePrecision}});
  }

  static std::unique_ptr<GridSource> open(const std::filesystem::path& file) {
    OpenGridOptions options;
    options.grid = file;
    return openGrid(options);
  }

  TemporaryFolder folder_;
  std::filesystem::path path_ = folder_ / "grid.cgns";
};

TEST_P(CgnsDamage, TruncatedFilesAreRefusedOrRead) {
  const DamageReport report = openTruncated(path_, 100, open);
  EXPECT_EQ(harm("truncated", report), "");
  EXPECT_GT(report.refused, 50);
}

TEST_P(CgnsDamage, TruncatedFilesAreNamedBeforeALibrarySeesThem) {
  if (GetParam() == CgnsFileType::kHdf5) GTEST_SKIP() << "by HDF5, which checks it";
  const auto whole = std::filesystem::file_size(path_);
  // The end of the file that its header names is in its last block.
  for (const auto bytes : {whole - 4096, whole / 2, uintmax_t{400}, uintmax_t{200}}) {
    std::filesystem::resize_file(path_, bytes);
    try {
      open(path_);
      ADD_FAILURE() << bytes;
    } catch (const Error& error) {
      const std::string told = "is truncated (found " + std::to_string(bytes) + " bytes, expected ";
      EXPECT_NE(std::string(error.what()).find(told), std::string::npos) << error.what();
    }
  }
}

TEST_P(CgnsDamage, FilesWithAWrongByteAreRefusedOrRead) {
  const DamageReport report = openCorrupted(path_, 1000, 17, open);
  EXPECT_EQ(harm("a wrong byte", report), "");
  EXPECT_GT(report.refused, 10);
  EXPECT_GT(report.changed, 10);
}

INSTANTIATE_TEST_SUITE_P(Types, CgnsDamage, testing::Values(CgnsFileType::kAdf, CgnsFileType::kHdf5),
                         [](const auto& type) { return type.param == CgnsFileType::kAdf ? "Adf" : "Hdf5"; });

}  // namespace
}  // namespace curvisplat
