// Damaged NetCDF files: an Error of one line or changed values, never a crash, a hang or an allocation of
// what the file has no room for. NetCDF-4 files whose attributes for libnetcdf and for dimension scales are
// not what these write: an Error that names the object.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <fstream>
#include <stdexcept>

#include "preprocess/formats/netcdf/netcdf_file.h"
#include "preprocess/formats/open/open_grid.h"
#include "stream/base/error.h"
#include "stream/base/file.h"
#include "tests/support/damaged_files.h"
#include "tests/support/earth_files.h"
#include "tests/support/expect_error.h"
#include "tests/support/fault_sweep.h"
#include "tests/support/hdf5_editor.h"
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
  return curvisplat::errorOf([&] { openGrid(options); });
}

TEST_P(NetcdfDamage, TruncatedFilesAreRefused) {
  const DamageReport report = openTruncated(path_, faults::isWholeSweep() ? 100 : 12, open);
  EXPECT_EQ(harm("truncated", report), "");
  EXPECT_EQ(report.same + report.changed, 0);
}

TEST_P(NetcdfDamage, FilesWithAWrongByteAreRefusedOrRead) {
  const int count = faults::isWholeSweep() ? 1000 : 80;
  const DamageReport report = openCorrupted(path_, count, 23, open);
  EXPECT_EQ(harm("a wrong byte", report), "");
  EXPECT_GT(report.refused, count / 20);
}

// The libraries read zeros beyond the end.
TEST_P(NetcdfDamage, FilesThatAreCutWhileTheyAreOpenAreRefused) {
  const NetcdfFile file(path_);
  const auto variable = std::ranges::find_if(
      file.variables(), [](const NetcdfVariable& v) { return v.numeric && v.dims.size() > 2; });
  ASSERT_NE(variable, file.variables().end());
  NetcdfBox box;
  for (size_t axis = 0; axis < variable->dims.size(); ++axis) {
    box.start.push_back(0);
    box.count.push_back(file.dimension(*variable, axis).length);
  }
  std::vector<double> values(box.values());
  const auto read = [&] { file.read(*variable, box, std::span(values)); };
  const std::string changed =
      path_.string() + ": was changed while it was read; start again when it is complete";
  const uint64_t bytes = std::filesystem::file_size(path_);
  EXPECT_EQ(errorOf(read), "");
  std::ofstream(path_, std::ios::app) << "more";
  EXPECT_EQ(errorOf(read), "");  // of a program that still writes further steps
  std::filesystem::resize_file(path_, bytes / 2);
  EXPECT_EQ(errorOf(read), changed);
}

TEST(ClassicNetcdfDamage, NamesThatAreTooLongAreRefused) {
  // A header of NetCDF's first version: no records, and one dimension with a name of 300 bytes and a length
  // of 4.
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

class NetcdfHostileAttributes : public ::testing::Test {
 protected:
  NetcdfHostileAttributes() { roms::write(path_, NetcdfFileType::kNetcdf4, "ocean_s_coordinate_g2"); }

  /// A fresh copy of the valid file. A new inode each time: libnetcdf may leave a file open that it refuses,
  /// and HDF5 does not open that inode for writing then.
  std::filesystem::path copy() const {
    const std::filesystem::path to = folder_ / "copy.nc";
    std::filesystem::remove(to);
    std::filesystem::copy_file(path_, to);
    return to;
  }

  /// Opens the file and reads a box; returns the Error.
  static std::string errorOf(const std::filesystem::path& path) {
    return curvisplat::errorOf([&] {
      OpenGridOptions options;
      options.grid = path;
      const auto source = openGrid(options);
      NodeArrays nodes;
      source->read(0, {0, 2, 0, 2}, {}, nodes);
    });
  }

  TemporaryFolder folder_;
  std::filesystem::path path_ = folder_ / "grid.nc";
};

TEST_F(NetcdfHostileAttributes, NamesThatAreTooLongAreRefused) {
  const std::filesystem::path file = copy();
  Hdf5Editor(file).group("/" + std::string(300, 'n'));
  EXPECT_EQ(errorOf(file),
            file.string() + ": / has an object with a name of 300 bytes; NetCDF allows 256: rename it");
}

TEST_F(NetcdfHostileAttributes, AttributesThatLibrariesTrustAreChecked) {
  struct Case {
    const char *object, *attribute;
    std::vector<HostileAttribute> valid;  // kinds that are what they should be
  };
  using enum HostileAttribute;
  const Case cases[] = {
      {"/temp", "DIMENSION_LIST", {}},
      {"/lon_rho", "DIMENSION_LIST", {}},
      {"/temp", "_Netcdf4Coordinates", {}},
      {"/s_rho", "_Netcdf4Dimid", {kInteger}},
      {"/xi_rho", "_Netcdf4Dimid", {kInteger}},
      {"/s_rho", "NAME", {}},
      {"/xi_rho", "NAME", {}},
      {"/", "_NCProperties", {kStringOf34, kLongString, kHugeString, kVariableString}},
  };
  for (const Case& one : cases)
    for (int kind = 1; kind < kHostileAttributes; ++kind) {
      const auto hostile = static_cast<HostileAttribute>(kind);
      SCOPED_TRACE(fmt::format("{} {} {}", one.object, one.attribute, kind));
      const std::filesystem::path file = copy();
      Hdf5Editor(file).replaceAttribute(one.object, one.attribute, hostile);
      const std::string error = errorOf(file);
      if (std::find(one.valid.begin(), one.valid.end(), hostile) != one.valid.end()) continue;
      const std::string words =
          fmt::format("{}: {} has an attribute '{}' of ", file.string(), one.object, one.attribute);
      EXPECT_TRUE(error.starts_with(words)) << error;
      expectSays(error, "; expected ");
      EXPECT_EQ(error.find('\n'), std::string::npos) << error;
    }
}

TEST_F(NetcdfHostileAttributes, NoAttributeOfAnyObjectEndsTheProgram) {
  int refused = 0, read = 0, unwritten = 0;
  // 18 kinds: a stride of 19 comes by each.
  int64_t place = 0, next = 0;
  for (const char* object : {"/", "/xi_rho", "/s_rho", "/temp", "/hc"})
    for (const char* attribute : {"_NCProperties", "_Netcdf4Dimid", "_Netcdf4Coordinates", "_nc3_strict",
                                  "CLASS", "NAME", "DIMENSION_LIST", "REFERENCE_LIST", "DIMENSION_LABELS",
                                  "_FillValue", "units", "coordinates", "scale_factor"})
      for (int kind = 0; kind < kHostileAttributes; ++kind) {
        if (place++ < next) continue;
        next = faults::nextInSweep(next, 19);
        SCOPED_TRACE(fmt::format("{} {} {}", object, attribute, kind));
        const std::filesystem::path file = copy();
        try {
          Hdf5Editor(file).replaceAttribute(object, attribute, static_cast<HostileAttribute>(kind));
        } catch (const std::runtime_error&) {
          ++unwritten;  // HDF5 itself refuses
          continue;
        }
        const std::string error = errorOf(file);
        EXPECT_EQ(error.find('\n'), std::string::npos) << error;
        ++(error.empty() ? read : refused);
      }
  const int tried = read + refused + unwritten;
  EXPECT_GT(tried, faults::isWholeSweep() ? 1000 : 60);
  EXPECT_GT(read, tried / 12);
  EXPECT_GT(refused, tried / 12);
  EXPECT_LT(unwritten, tried / 10);
}

TEST_F(NetcdfHostileAttributes, NamesOfDimensionsMustEnd) {
  const std::filesystem::path file = copy();
  Hdf5Editor(file).writeText("/xi_rho", "NAME", "xi_rho", 7);
  EXPECT_EQ(errorOf(file), "");
  Hdf5Editor(file).writeText("/xi_rho", "NAME", std::string(64, 'x'), 64);
  expectSays(errorOf(file),
             "/xi_rho has an attribute 'NAME' of 1 strings of 64 bytes; expected one "
             "terminated string");
}

TEST_F(NetcdfHostileAttributes, GroupsInCirclesAreRefused) {
  const std::filesystem::path file = copy();
  {
    Hdf5Editor editor(file);
    editor.group("/group");
    editor.hardLink("/", "/group/root");
  }
  expectSays(errorOf(file), "nested more than 100 deep");
  copy();
  {
    // 2^40 paths to the last group.
    Hdf5Editor editor(file);
    std::string path;
    for (int n = 0; n < 40; ++n) {
      editor.group(path + "/a");
      editor.softLink(path + "/a", path + "/b");
      path += "/a";
    }
  }
  expectSays(errorOf(file), "more than the file can hold");
}

// HDF5 1.10 frees memory that it has not set where it sorts such a list.
TEST_F(NetcdfHostileAttributes, ListsThatAreDamagedAreRefused) {
  const std::string whole = readTextFile(path_);
  int lists = 0;
  for (size_t at = whole.find("BTLF"); at != std::string::npos; at = whole.find("BTLF", at + 1)) {
    std::string damaged = whole;
    damaged[at + 12] = static_cast<char>(~damaged[at + 12]);
    const std::filesystem::path file = copy();
    writeFileAtomically(file, damaged);
    const std::string error = errorOf(file);
    lists +=
        error.find("its list of ") != std::string::npos || error.find("HDF5 crashes") != std::string::npos;
  }
  EXPECT_GT(lists, 0);
}

// Structures that say something else than was written, with the right checksum: what HDF5 1.10 does not survive is
// found by the process of a trial.
TEST_F(NetcdfHostileAttributes, StructuresThatCrashHdf5AreRefused) {
  const std::string whole = readTextFile(path_);
  // A B-tree's header: its depth. A heap's header: the length of its identifiers, the size of its blocks.
  struct Field {
    const char* structure;
    size_t at;
  };
  int crashed = 0, tried = 0;
  for (const Field& field : {Field{"BTHD", 12}, Field{"BTHD", 10}, Field{"FRHP", 5}, Field{"FRHP", 113}})
    for (size_t begin = whole.find(field.structure); begin != std::string::npos;
         begin = whole.find(field.structure, begin + 1)) {
      std::string damaged = whole;
      damaged[begin + field.at] = static_cast<char>(damaged[begin + field.at] + 1);
      if (!renewChecksum(whole, begin, damaged)) continue;
      ++tried;
      const std::filesystem::path file = copy();
      writeFileAtomically(file, damaged);
      const std::string error = errorOf(file);
      EXPECT_EQ(error.find('\n'), std::string::npos) << error;
      crashed += error.find("HDF5 crashes on its structures") != std::string::npos;
    }
  EXPECT_GT(tried, 0);
  EXPECT_GT(crashed, 0) << "of " << tried;
}

}  // namespace
}  // namespace curvisplat
