// Legacy VTK files beyond what VTK's own writers make: each part that a file may have, and parts that lie.
#include <gtest/gtest.h>

#include <cmath>

#include "preprocess/formats/open/open_grid.h"
#include "stream/base/error.h"
#include "tests/preprocess/plot3d_bytes.h"
#include "tests/support/all_nodes.h"
#include "tests/support/vts_writer.h"

namespace curvisplat {
namespace {

using test::TestFolder;

class VtkLegacy : public testing::Test {
 protected:
  std::unique_ptr<GridSource> open(const std::string& content, const std::string& head = "ASCII") {
    OpenGridOptions options;
    options.grid = folder_.write("grid.vtk", "# vtk DataFile Version 3.0\na title\n" + head + "\n" + content);
    options.temporary_folder = folder_.path();
    return openGrid(options);
  }
  std::string errorOf(const std::string& content, const std::string& head = "ASCII") {
    try {
      open(content, head);
    } catch (const Error& error) {
      return error.what();
    }
    return "";
  }
  static std::vector<std::string> names(const GridSource& source) {
    std::vector<std::string> names;
    for (const GridScalar& scalar : source.description().scalars) names.push_back(scalar.name);
    return names;
  }

  TestFolder folder_{"vtk-legacy"};
  const std::string uniform_ = "DATASET STRUCTURED_POINTS\nDIMENSIONS 2 2 3\nORIGIN 0 0 0\nSPACING 1 1 1\n";
  const std::string twelve_ = "0 1 2 3 4 5 6 7 8 9 10 11\n";
};

TEST_F(VtkLegacy, TextsMayBreakLinesAnywhereAndWriteKeywordsAnyhow) {
  const auto source = open(
      "dataset structured_grid\r\nDimensions 2 2\n2\n\nPOINTS 8 double\n0 0 0 1 0 0\n0 1\n0 1 1 0 0 0 1.5D0 "
      "1 0 1 0 1 1 1 "
      "1 1e0\npoint_data 8\nSCALARS a%20b int\nLOOKUP_TABLE default\n1 2 3 4\n5 6 7 8\nLOOKUP_TABLE t 2\n0 0 "
      "0 1 1 1 1 "
      "1\nCELL_DATA 1\nNORMALS n float\n3 0 4\n");
  EXPECT_EQ(source->description().format, "legacy VTK STRUCTURED_GRID, ASCII, 1 block");
  EXPECT_EQ(names(*source), (std::vector<std::string>{"a b", "n:mag", "n:x", "n:y", "n:z"}));
  const NodeArrays nodes = allNodes(*source, 0);
  EXPECT_EQ(nodes.x[1], 1);
  EXPECT_EQ(nodes.z[4], 1.5);
  EXPECT_EQ(nodes.scalars[0], (std::vector<float>{1, 2, 3, 4, 5, 6, 7, 8}));
  EXPECT_EQ(nodes.scalars[1][0], 5);
  EXPECT_TRUE(std::isnan(nodes.scalars[1][1]));
}

TEST_F(VtkLegacy, BlankingHidesNodes) {
  const auto source = open(
      "DATASET STRUCTURED_GRID\nDIMENSIONS 2 2 2\nBLANKING 8 unsigned_char\n1 1 0 1 1 1 1 0\nPOINTS 8 "
      "float\n0 0 0 1 0 0 0 1 0 1 1 0 0 0 1 1 0 1 0 1 1 1 1 1\n");
  EXPECT_EQ(allNodes(*source, 0).blank, (std::vector<uint8_t>{0, 0, 1, 0, 0, 0, 0, 1}));
  EXPECT_TRUE(source->description().blocks[0].has_blanking);
}

TEST_F(VtkLegacy, FieldsOfAllKindsAreReadOrPassedOver) {
  const auto source = open(
      "FIELD FieldData 3\nTIME 1 1 double\n4.5\nNAMES 1 2 string\nfirst name\nsecond\nOTHER 2 1 int\n7 "
      "8\nMETADATA\n"
      "INFORMATION 1\nNAME x LOCATION y\nDATA 3\n\n" +
      uniform_ + "POINT_DATA 12\nCOLOR_SCALARS c 2\n" + twelve_ + twelve_ +
      "TEXTURE_COORDINATES t 2 float\n" + twelve_ + twelve_ + "TENSORS6 s float\n" + twelve_ + twelve_ +
      twelve_ + twelve_ + twelve_ + twelve_ + "FIELD more 3\nNULL_ARRAY\np 1 12 short\n" + twelve_ +
      "odd 1 3 int\n1 2 3\nSCALARS q float 1\n" + twelve_);
  EXPECT_EQ(source->description().times, std::vector<double>{4.5});
  EXPECT_EQ(names(*source), (std::vector<std::string>{"q", "c:mag", "c:x", "c:y", "t:mag", "t:x", "t:y",
                                                      "s:0", "s:1", "s:2", "s:3", "s:4", "s:5", "p"}));
  EXPECT_EQ(allNodes(*source, 0).scalars[13][11], 11);
}

TEST_F(VtkLegacy, BinaryStringsArePassedOver) {
  std::string strings =
      "\xc5"
      "hello";                                                            // 6 bits of length
  strings += std::string("\x81\x00", 2) + std::string(256, 'x');          // 14
  strings += std::string("\x40\x00\x01\x00", 4) + std::string(256, 'y');  // 30
  std::string file = "FIELD FieldData 2\nnames 1 3 string\n" + strings + "\nTimeValue 1 1 double\n" +
                     packedNumbers({2.5}, "Float64", true) + "\n" + uniform_ +
                     "POINT_DATA 12\nSCALARS p int\n";
  std::vector<double> values;
  for (int n = 0; n < 12; ++n) values.push_back(0x0a0a200a + n);  // as white space begins
  const std::string numbers = packedNumbers(values, "Int32", true);
  for (const char* const table : {"", "LOOKUP_TABLE default\n"}) {
    const auto source = open(file + table + numbers + "\n", "BINARY");
    EXPECT_EQ(source->description().times, std::vector<double>{2.5});
    EXPECT_EQ(allNodes(*source, 0).scalars[0][11], static_cast<float>(values[11]));
  }
}

TEST_F(VtkLegacy, ArraysThatAreNotDrawnDoNotStopTheOthers) {
  const auto expectOthers = [&](const std::string& content, const std::string& head) {
    const auto source = open(content, head);
    EXPECT_EQ(names(*source), (std::vector<std::string>{"p", "q"}));
    EXPECT_EQ(
        source->description().warnings,
        (std::vector<std::string>{"left out: array flags of the points has type bit, which is not drawn",
                                  "left out: array words of the points has type string, which is not drawn",
                                  "left out: array two of the cells has type bit, which is not drawn"}));
    EXPECT_EQ(allNodes(*source, 0).scalars[0][11], 11);
    EXPECT_EQ(allNodes(*source, 0).scalars[1][11], 12);
  };
  const std::string bits = "0 1 0 1 0 1 0 1 0 1 1 1\n";
  std::string words;
  for (int n = 0; n < 12; ++n) words += "word\n";
  expectOthers(
      uniform_ + "POINT_DATA 12\nSCALARS flags bit 1\nLOOKUP_TABLE default\n" + bits +
          "FIELD more 3\nwords 1 12 string\n" + words + "p 1 12 short\n" + twelve_ +
          "q 1 12 short\n1 2 3 4 5 6 7 8 9 10 11 12\nCELL_DATA 2\nFIELD f 1\ntwo 3 2 bit\n1 0 1 0 1 0\n",
      "ASCII");
  std::vector<double> p, q;
  for (int n = 0; n < 12; ++n) {
    p.push_back(n);
    q.push_back(n + 1);
  }
  std::string packed_words;
  for (int n = 0; n < 12; ++n) packed_words += "\xc4word";
  expectOthers(uniform_ + "POINT_DATA 12\nSCALARS flags bit 1\nLOOKUP_TABLE default\n" + "\x55\x70" +
                   "\nFIELD more 3\nwords 1 12 string\n" + packed_words + "\np 1 12 short\n" +
                   packedNumbers(p, "Int16", true) + "\nq 1 12 short\n" + packedNumbers(q, "Int16", true) +
                   "\nCELL_DATA 2\nFIELD f 1\ntwo 3 2 bit\n\xa8\n",
               "BINARY");
}

TEST_F(VtkLegacy, PartsThatLieAreNamed) {
  const std::string grid = "DATASET STRUCTURED_GRID\n";
  const std::string rectilinear =
      "DATASET RECTILINEAR_GRID\nDIMENSIONS 2 2 2\nX_COORDINATES 2 float\n0 1\nY_COORDINATES 2 float\n0 1\n";
  const std::tuple<std::string, const char*> cases[] = {
      {"DATASET POLYDATA\nPOINTS 1 float\n0 0 0\n", "is a POLYDATA"},
      {"DATASET UNSTRUCTURED_GRID\nPOINTS 1 float\n0 0 0\n", "has no CELLS"},
      {"DATUM STRUCTURED_GRID\n", "found \"datum\"; expected DATASET"},
      {grid + "POINTS 8 float\n", "has points before DIMENSIONS"},
      {grid + "DIMENSIONS 2 2\n", "found \"\"; expected a count"},
      {grid + "DIMENSIONS 2 2 0\n", "DIMENSIONS 2 2 0"},
      {grid + "DIMENSIONS 2 2 99999999999999\n", "three counts of nodes"},
      {grid + "DIMENSIONS 1000000000 1000000000 2\n", "expected at most"},
      {grid + "DIMENSIONS 2 2 2\nDIMENSIONS 2 2 2\n", "a second DIMENSIONS"},
      {grid + "DIMENSIONS 2 2 2\n", "has no POINTS"},
      {grid + "DIMENSIONS 2 2 2\nPOINTS 7 float\n", "has 7 POINTS; expected 8"},
      {grid + "DIMENSIONS 2 2 2\nPOINTS 8 floot\n", "has type floot"},
      {grid + "DIMENSIONS 2 2 2\nPOINTS 8 float\n1 2 3\n",
       "needs 24 numbers, 47 characters at least, but only 6 are left"},
      {grid + "DIMENSIONS 2 2 2\nPOINTS 8 float\n" + twelve_ + "1 2 3 four 5 6 7 8 9 10 11 12",
       "array POINTS has 15 numbers, then \"four\"; expected a number"},
      {grid + "DIMENSIONS 1000 1000 1000\nPOINTS 1000000000 float\n1 2 3\n", "needs 3000000000 numbers"},
      {rectilinear + "Z_COORDINATES 3 float\n0 1 2\n", "has 3 z_coordinates; expected 2"},
      {rectilinear, "has no X_COORDINATES"},
      {uniform_ + "POINT_DATA 11\n", "has POINT_DATA 11; expected 12"},
      {uniform_ + "CELL_DATA 3\n", "has CELL_DATA 3; expected 2"},
      {uniform_ + "POINT_DATA 12\nSCALARS p float 99999\n" + twelve_, "99999 components"},
      {uniform_ + "POINT_DATA 12\nSCALARS p\n" + twelve_, "without a type"},
      {uniform_ + "POINT_DATA 12\nSCALERS p float\n", "found \"scalers\"; expected SCALARS"},
      {uniform_ + "POINT_DATA 12\nSCALARS p float\n0 1 2 3 4 5 6 7 8 9 10\n",
       "array p has 11 numbers; expected 12; the file is truncated, or the count is wrong"},
      {uniform_ + "POINT_DATA 12\nSCALARS b bit 4000\n0 1\n", "b needs 12 x 4000 bits"},
      {"FIELD f 9999999\n", "ends where a name was expected"},
      {uniform_ + "SPACING 1 1 nan\n", "has spacing nan"},
  };
  for (const auto& [content, words] : cases) {
    const std::string error = errorOf(content);
    EXPECT_NE(error.find(words), std::string::npos) << content << ": " << error;
    EXPECT_NE(error.find("grid.vtk: byte"), std::string::npos) << error;
    EXPECT_EQ(error.find('\n'), std::string::npos) << error;
  }
  EXPECT_NE(errorOf(uniform_, "OCTAL").find("expected ASCII or BINARY"), std::string::npos);
  EXPECT_NE(errorOf(uniform_ + "POINT_DATA 12\nVECTORS v double\n12345678", "BINARY")
                .find("needs 36 numbers, 288 bytes, but only 8 are left"),
            std::string::npos);
}

}  // namespace
}  // namespace curvisplat
