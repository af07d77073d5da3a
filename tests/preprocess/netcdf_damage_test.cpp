// Damaged NetCDF files: an Error of one line or changed values, never a crash, a hang or an allocation of
// what the file has no room for.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <fstream>

#include "preprocess/formats/netcdf/netcdf_file.h"
#include "preprocess/formats/open/open_grid.h"
#include "stream/base/error.h"
#include "tests/support/damaged_files.h"
#include "tests/support/earth_files.h"
#include "tests/support/temporary_folder.h"

namespace curvisplat {
namespace {

class NetcdfDamage : public testing::TestWithParam<NetcdfFileType> {
 protected:
  NetcdfDamage() { roms::write(path_, GetParam(), "ocean_s_coordinate_g2"); }

  static std::unique_ptr<GridSource> open(const std::filesystem::path& file) {
    OpenGridOptions options;
    options.grid = file;
    return openGrid(options);
  }

  TemporaryFolder folder_;
  std::filesystem::path path_ = folder_ / "file.nc";
};

/// The error of opening a grid; empty, which no error is, if it opens.
std::string refusalOf(const std::filesystem::path& path) {
  OpenGridOptions options;
  options.grid = path;
  try {
    openGrid(options);
  } catch (const Error& error) {
    return error.what();
  }
  return "";
}

TEST_P(NetcdfDamage, TruncatedFilesAreRefused) {
  const DamageReport report = openTruncated(path_, 100, open);
  EXPECT_EQ(harm("truncated", report), "");
  EXPECT_EQ(report.same + report.changed, 0);
}

TEST_P(NetcdfDamage, FilesWithAWrongByteAreRefusedOrRead) {
  const DamageReport report = openCorrupted(path_, 1000, 23, open);
  EXPECT_EQ(harm("a wrong byte", report), "");
  EXPECT_GT(report.refused, 50);
}

TEST(ClassicNetcdfDamage, NamesThatAreTooLongAreRefused) {
  // Of NetCDF's first version: no records, and one dimension with a name of 300 bytes and a length of 4.
  std::string header("CDF\1\0\0\0\0\0\0\0\x0a\0\0\0\1\0\0\x01\x2c", 20);
  header += std::string(300, 'n') + std::string("\0\0\0\4", 4) + std::string(16, '\0');
  const TemporaryFolder folder;
  const std::filesystem::path path = folder / "file.nc";
  std::ofstream(path, std::ios::binary) << header;
  EXPECT_EQ(refusalOf(path), path.string() +
                                 ": its NetCDF header has a name longer than 256 characters before byte 20; "
                                 "the file is damaged: copy or write it again");
}

TEST(ClassicNetcdfDamage, RecordsThatTheHeaderDoesNotCountAreCountedByTheFilesSize) {
  const TemporaryFolder folder;
  const std::filesystem::path path = folder / "file.nc";
  roms::write(path, NetcdfFileType::kClassic, "ocean_s_coordinate_g2");
  const auto records = [&] {
    const NetcdfFile file(path);
    for (const NetcdfDimension& dimension : file.dimensions())
      if (dimension.unlimited) return dimension.length;
    return uint64_t{0};
  };
  const uint64_t counted = records();
  std::fstream(path, std::ios::binary | std::ios::in | std::ios::out).seekp(4) << "\xff\xff\xff\xff";
  EXPECT_EQ(records(), counted);
  std::filesystem::resize_file(path, std::filesystem::file_size(path) - 8);
  EXPECT_EQ(records(), counted - 1);
}

TEST(Netcdf4Damage, HalfAFileIsCalledTruncated) {
  const TemporaryFolder folder;
  const std::filesystem::path path = folder / "file.nc";
  roms::write(path, NetcdfFileType::kNetcdf4, "ocean_s_coordinate_g2");
  const uint64_t bytes = std::filesystem::file_size(path);
  std::filesystem::resize_file(path, bytes / 2);
  EXPECT_EQ(refusalOf(path), fmt::format("{}: is truncated (found {} bytes, expected {}); copy it again",
                                         path.string(), bytes / 2, bytes));
}

INSTANTIATE_TEST_SUITE_P(Types, NetcdfDamage,
                         testing::Values(NetcdfFileType::kClassic, NetcdfFileType::kNetcdf4Compressed),
                         [](const auto& type) {
                           return type.param == NetcdfFileType::kClassic ? "Classic" : "Compressed";
                         });

}  // namespace
}  // namespace curvisplat
