// Damaged CGNS files: an Error of one line or changed values, never a crash, a hang or a silent allocation
// of what the file has no room for. HDF5 files whose attributes or links are not what CGNS writes: an Error
// that names the node; other programs' HDF5 files are not taken for CGNS.
#include <gtest/gtest.h>

#include "preprocess/formats/open/open_grid.h"
#include "stream/base/error.h"
#include "stream/base/watched_file.h"
#include "tests/support/cgns_writer.h"
#include "tests/support/damaged_files.h"
#include "tests/support/earth_files.h"
#include "tests/support/expect_error.h"
#include "tests/support/fault_sweep.h"
#include "tests/support/grid_nodes.h"
#include "tests/support/hdf5_editor.h"
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
  const int count = faults::isWholeSweep() ? 100 : 12;
  const DamageReport report = openTruncated(path_, count, open);
  EXPECT_EQ(harm("truncated", report), "");
  EXPECT_GT(report.refused, count / 2);
}

TEST_P(CgnsDamage, FilesThatAreCutWhileTheyAreOpenAreRefused) {
  const std::unique_ptr<GridSource> grid = open(path_);
  EXPECT_GT(allNodes(*grid, 0).x.size(), 0u);
  std::filesystem::resize_file(path_, 700);
  EXPECT_NE(errorOf([&] { allNodes(*grid, 0); }).find(path_.string()), std::string::npos);
}

TEST_P(CgnsDamage, FilesThatLinksLeadToAreWatchedToo) {
  const std::filesystem::path linking = folder_ / "flow.cgns";
  {
    CgnsWriter file(linking, GetParam());
    file.base("Base");
    file.zone("Zone", {5, 4, 3});
    file.link("GridCoordinates", "grid.cgns", "/Base/Zone/GridCoordinates");
  }
  const std::unique_ptr<GridSource> grid = open(linking);
  const WatchedFiles files(grid->description().files);
  EXPECT_GT(allNodes(*grid, 0).x.size(), 0u);
  std::filesystem::resize_file(path_, 700);
  EXPECT_NE(errorOf([&] { allNodes(*grid, 0); }).find(linking.string()), std::string::npos);
  std::vector<std::string> warnings;
  files.warn(warnings);
  ASSERT_EQ(warnings.size(), 1u);
  EXPECT_EQ(warnings[0].find(path_.string() + ": was changed"), 0u);
}

TEST_P(CgnsDamage, TruncatedFilesAreNamedBeforeALibrarySeesThem) {
  if (GetParam() == CgnsFileType::kHdf5) GTEST_SKIP() << "by HDF5, which checks it";
  const auto whole = std::filesystem::file_size(path_);
  // The end of the file that its header names is in its last block.
  for (const auto bytes : {whole - 4096, whole / 2, uintmax_t{400}, uintmax_t{200}}) {
    std::filesystem::resize_file(path_, bytes);
    expectError([&] { open(path_); }, {"is truncated (found " + std::to_string(bytes) + " bytes, expected "});
  }
}

TEST_P(CgnsDamage, FilesWithAWrongByteAreRefusedOrRead) {
  const int count = faults::isWholeSweep() ? 1000 : 100;
  const DamageReport report = openCorrupted(path_, count, 17, open);
  EXPECT_EQ(harm("a wrong byte", report), "");
  EXPECT_GT(report.refused, count / 100);
  EXPECT_GT(report.changed, count / 100);
}

INSTANTIATE_TEST_SUITE_P(Types, CgnsDamage, testing::Values(CgnsFileType::kAdf, CgnsFileType::kHdf5),
                         [](const auto& type) { return type.param == CgnsFileType::kAdf ? "Adf" : "Hdf5"; });

double value(int64_t i, int64_t j, int64_t k) {
  return 1 + 0.5 * static_cast<double>(i + 10 * j + 100 * k);
}

const char* const kZone = "/Base/Zone";
const char* const kGrid = "/Base/Zone/GridCoordinates";
const char* const kArray = "/Base/Zone/GridCoordinates/CoordinateX";

class CgnsHostileAttributes : public testing::Test {
 protected:
  CgnsHostileAttributes() {
    CgnsWriter file(path_, CgnsFileType::kHdf5);
    file.base("Base");
    file.zone("Zone", {4, 3, 3});
    file.coordinates("GridCoordinates",
                     {{"CoordinateX", value}, {"CoordinateY", value}, {"CoordinateZ", value}});
    file.solution("Solution", "Vertex", {{"Density", value}});
  }

  static std::unique_ptr<GridSource> open(const std::filesystem::path& path) {
    OpenGridOptions options;
    options.grid = path;
    return openGrid(options);
  }

  /// A fresh copy of the valid file.
  std::filesystem::path copy(const char* name = "copy.cgns") const {
    const std::filesystem::path to = folder_ / name;
    std::filesystem::copy_file(path_, to, std::filesystem::copy_options::overwrite_existing);
    return to;
  }

  static std::string errorOf(const std::filesystem::path& path) {
    return curvisplat::errorOf([&] { open(path); });
  }

  static void expectError(const std::filesystem::path& path, const std::string& words) {
    const std::string error = errorOf(path);
    EXPECT_TRUE(error.starts_with(path.string() + ": ")) << error;
    expectSays(error, words);
  }

  static void expectDensity(const std::filesystem::path& path) {
    const auto source = open(path);
    const uint32_t density = scalarsNamed(source->description(), {"Density"}).at(0);
    NodeArrays nodes;
    source->read(0, {0, 3, 0, 3}, std::span(&density, 1), nodes);
    ASSERT_EQ(nodes.x.size(), 36u);
    for (size_t n = 0; n < 36; ++n) {
      const auto i = static_cast<int64_t>(n);
      EXPECT_EQ(nodes.x[n], value(i % 4, i / 4 % 3, i / 12));
      EXPECT_EQ(nodes.scalars[0][n], static_cast<float>(value(i % 4, i / 4 % 3, i / 12)));
    }
  }

  TemporaryFolder folder_;
  std::filesystem::path path_ = folder_ / "grid.cgns";
};

TEST_F(CgnsHostileAttributes, NodesWithWrongAttributesAreRefused) {
  size_t combination = 0;
  for (const char* node : {"/CGNSLibraryVersion", "/Base", kZone, kGrid, kArray})
    for (const char* attribute : {"name", "label", "type"})
      for (int hostile = 0; hostile < kHostileAttributes; ++hostile) {
        if (!faults::isTried(combination++, 5)) continue;
        SCOPED_TRACE(std::string(node) + " " + attribute + " " + std::to_string(hostile));
        const std::filesystem::path file = copy();
        Hdf5Editor(file).replaceAttribute(node, attribute, static_cast<HostileAttribute>(hostile));
        expectError(file, std::string(node) + " has ");
        expectError(file, std::string("attribute '") + attribute + "'");
      }
}

TEST_F(CgnsHostileAttributes, ARootWithWrongAttributesIsRefused) {
  size_t combination = 0;
  for (const char* name : {"copy.cgns", "copy.hdf5"})
    for (const char* attribute : {"name", "label", "type"})
      for (int hostile = 1; hostile < kHostileAttributes; ++hostile) {
        if (!faults::isTried(combination++, 5)) continue;
        SCOPED_TRACE(std::string(name) + " " + attribute + " " + std::to_string(hostile));
        const std::filesystem::path file = copy(name);
        Hdf5Editor(file).replaceAttribute("/", attribute, static_cast<HostileAttribute>(hostile));
        expectError(file, std::string("the root has an attribute '") + attribute + "'");
      }
}

TEST_F(CgnsHostileAttributes, WhatCgnsDoesNotNeedDoesNotMatter) {
  size_t combination = 0;
  for (const char* attribute : {"flags", "order", "version", "path", "file"})
    for (int hostile = 0; hostile < kHostileAttributes; ++hostile) {
      if (!faults::isTried(combination++, 5)) continue;
      SCOPED_TRACE(attribute + std::to_string(hostile));
      const std::filesystem::path file = copy();
      {
        Hdf5Editor editor(file);
        for (const char* node : {"/", "/Base", kZone, kGrid, kArray})
          editor.replaceAttribute(node, attribute, static_cast<HostileAttribute>(hostile));
      }
      expectDensity(file);
    }
  // Programs other than libcgns give the root no attributes.
  const std::filesystem::path file = copy();
  {
    Hdf5Editor editor(file);
    for (const char* attribute : {"name", "label", "type"})
      editor.replaceAttribute("/", attribute, HostileAttribute::kMissing);
  }
  expectDensity(file);
}

TEST_F(CgnsHostileAttributes, TextsWithoutAnEndAreRead) {
  const std::filesystem::path file = copy();
  {
    Hdf5Editor editor(file);
    editor.writeText(kZone, "name", std::string(33, 'N'), 33);
    editor.writeText(kZone, "label", "Zone_t" + std::string(27, ' '), 33);
    editor.writeText(kArray, "type", "R8 ", 3);
  }
  expectDensity(file);
  Hdf5Editor(file).writeText(kArray, "type", "R8x", 3);
  expectError(file, "unknown type 'R8x'");
}

TEST_F(CgnsHostileAttributes, ATypeThatLiesAboutTheDataIsRefusedOrConverted) {
  for (const char* type : {"MT", "C1", "XX", "", "B1"}) {
    const std::filesystem::path file = copy();
    Hdf5Editor(file).writeText(kArray, "type", type, 3);
    expectError(file, kArray);
  }
  const std::filesystem::path file = copy();
  Hdf5Editor(file).writeText(kArray, "type", "R4", 3);
  expectDensity(file);
}

TEST_F(CgnsHostileAttributes, LinksInCirclesAreRefused) {
  const auto linked = [](Hdf5Editor& editor, const std::string& node, const std::string& target) {
    editor.writeText(node, "type", "LK", 3);
    editor.softLink(target, node + "/ link");
  };
  const std::filesystem::path file = copy();
  const auto expect = [&](const std::string& words) { expectError(file, words); };
  {
    Hdf5Editor editor(file);
    linked(editor, kGrid, kGrid);
  }
  expect("is behind more than 100 links");
  copy();
  {
    Hdf5Editor editor(file);
    linked(editor, kGrid, "/Base/Zone/Solution");
    linked(editor, "/Base/Zone/Solution", kGrid);
  }
  expect("is behind more than 100 links");
  copy();
  {
    Hdf5Editor editor(file);
    linked(editor, kGrid, std::string(kGrid) + "/ link");  // of HDF5's own kind
  }
  expect("the target of its link cannot be read as CGNS (HDF5: too many links)");
  copy();
  Hdf5Editor(file).softLink("/Base/Loop", "/Base/Loop");
  expect("/Base/Loop: the node cannot be read as CGNS");
  copy();
  Hdf5Editor(file).softLink("/nowhere", "/Base/Loop");
  expect("/Base/Loop: the node cannot be read as CGNS");
}

TEST_F(CgnsHostileAttributes, NodesBelowThemselvesAreNotFollowed) {
  const std::filesystem::path file = copy();
  {
    Hdf5Editor editor(file);
    editor.hardLink("/", "/Base/Root");
    editor.hardLink("/Base", "/Base/Zone/Base");
    editor.hardLink(kGrid, std::string(kGrid) + "/Again");
    editor.softLink(kArray, std::string(kArray) + "/Again");
  }
  expectDensity(file);
}

TEST_F(CgnsHostileAttributes, ManyNamesForTheSameNodesAreBounded) {
  const std::filesystem::path file = copy();
  {
    Hdf5Editor editor(file);
    // 1000 bases of 1000 zones of 1000 arrays, if one were to visit them all.
    for (int n = 0; n < 1000; ++n) {
      const std::string number = std::to_string(n);
      editor.hardLink("/Base", "/Base " + number);
      editor.hardLink(kZone, "/Base/Zone " + number);
      editor.hardLink(kArray, "/Base/Zone/Solution/Density " + number);
    }
  }
  expectError(file, "more than the files can hold");
}

TEST_F(CgnsHostileAttributes, AnHdf5FileCalledCgnsSaysWhatItLacks) {
  const std::filesystem::path file = folder_ / "roms.cgns";
  roms::write(file, NetcdfFileType::kNetcdf4, "ocean_s_coordinate_g2");
  expectError(file, "the root has an attribute 'type' of 22 bytes; expected text of at most 3 bytes");
}

TEST_F(CgnsHostileAttributes, ANetcdfFileWithALongGlobalTypeIsNetcdf) {
  // What is read of it is compared with formulas in netcdf_test.cpp: roms::write gives it the attribute.
  const std::filesystem::path file = folder_ / "roms.nc";
  roms::write(file, NetcdfFileType::kNetcdf4, "ocean_s_coordinate_g2");
  for (int hostile = 0; hostile < kHostileAttributes; ++hostile) {
    SCOPED_TRACE(hostile);
    for (const char* attribute : {"name", "label", "type", "order", "flags"})
      Hdf5Editor(file).replaceAttribute("/", attribute, static_cast<HostileAttribute>(hostile));
    const auto source = open(file);
    EXPECT_TRUE(source->description().format.starts_with("NetCDF-4")) << source->description().format;
    EXPECT_EQ(source->description().times, (std::vector<double>{0, 3600}));
    const uint32_t temp = scalarsNamed(source->description(), {"temp"}).at(0);
    NodeArrays nodes;
    source->read(0, {3, 4, 2, 3}, std::span(&temp, 1), nodes);
    ASSERT_EQ(nodes.scalars[0].size(), roms::kXi);
    for (size_t i = 0; i < roms::kXi; ++i)
      EXPECT_EQ(nodes.scalars[0][i], static_cast<float>(roms::value(1, 0, 2, 3, i)));
  }
}

}  // namespace
}  // namespace curvisplat
