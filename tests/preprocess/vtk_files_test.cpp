// Files that VTK has written, and those that people have: what is read equals what VTK's own readers read.
// tests/data/make_vtk_files.py has written the former and asked VTK 9.1's readers (through Python) about
// both: expected.json and expected_real.json have dimensions, ranges and CRC-32 of all numbers. Then legacy
// files beyond what VTK's own writers make: each part that a file may have, and parts that lie.
#include <gtest/gtest.h>
#include <zlib.h>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <set>
#include <span>

#include "preprocess/formats/open/open_grid.h"
#include "stream/base/error.h"
#include "stream/base/file.h"
#include "tests/preprocess/plot3d_bytes.h"
#include "tests/support/expect_error.h"
#include "tests/support/grid_nodes.h"
#include "tests/support/vts_writer.h"

namespace curvisplat {

uint32_t crc32(std::span<const std::byte> bytes);

uint32_t crc32(std::span<const std::byte> bytes) {
  return static_cast<uint32_t>(::crc32_z(0, reinterpret_cast<const Bytef*>(bytes.data()), bytes.size()));
}

namespace {

using nlohmann::json;

const std::filesystem::path kMade = std::filesystem::path(CURVISPLAT_TEST_DATA) / "vtk";
const std::filesystem::path kShared = CURVISPLAT_SHARED_DATA;

std::unique_ptr<GridSource> open(const std::filesystem::path& path,
                                 std::optional<uint32_t> time_step = std::nullopt) {
  OpenGridOptions options;
  options.grid = path;
  options.time_step = time_step;
  return openGrid(options);
}

template <typename Value>
uint32_t crcOf(const std::vector<Value>& values) {
  return crc32(std::as_bytes(std::span(values)));
}

/// The name that a scalar of these has, by that of VTK's array.
std::string scalarName(const json& scalar, const json& all) {
  const std::string name = scalar["name"];
  if (scalar["centring"] == "node") return name;
  const bool taken = std::any_of(all.begin(), all.end(), [&](const json& other) {
    return other["centring"] == "node" && other["name"] == name;
  });
  if (!taken) return name;
  const size_t colon = std::min(name.find(':'), name.size());
  return name.substr(0, colon) + ":cell" + name.substr(colon);
}

void expectScalar(const GridDescription& description, const GridBlock& block, const NodeArrays& nodes,
                  const json& expected, const json& all) {
  const std::string name = scalarName(expected, all);
  SCOPED_TRACE(name);
  const uint32_t position = scalarsNamed(description, {name}).front();
  const bool of_cells = expected["centring"] == "cell";
  EXPECT_EQ(description.scalars[position].centring, of_cells ? Centring::kCell : Centring::kNode);
  std::vector<float> values = nodes.scalars[position];
  if (of_cells) {
    values = cellValues(block, values);
    // Nothing else is a number.
    EXPECT_EQ(std::count_if(nodes.scalars[position].begin(), nodes.scalars[position].end(),
                            [](float value) { return std::isfinite(value); }),
              static_cast<ptrdiff_t>(values.size()));
  }
  const auto [min, max] = std::minmax_element(values.begin(), values.end());
  EXPECT_FLOAT_EQ(*min, expected["min"].get<float>());
  EXPECT_FLOAT_EQ(*max, expected["max"].get<float>());
  EXPECT_EQ(crcOf(values), expected["crc"].get<uint32_t>());
}

void expectBlock(const GridSource& source, uint32_t number, const json& expected) {
  const GridBlock& block = source.description().blocks.at(number);
  ASSERT_EQ(json({block.ni, block.nj, block.nk}), expected["dimensions"]);
  const NodeArrays nodes = allNodes(source, number);
  const std::vector<double>* const axes[] = {&nodes.x, &nodes.y, &nodes.z};
  for (size_t axis = 0; axis < 3; ++axis) {
    const auto [lower, upper] = std::minmax_element(axes[axis]->begin(), axes[axis]->end());
    EXPECT_EQ(*lower, expected["lower"][axis].get<double>());
    EXPECT_EQ(*upper, expected["upper"][axis].get<double>());
    EXPECT_EQ(crcOf(*axes[axis]), expected["xyz"][axis].get<uint32_t>()) << axis;
  }
  EXPECT_EQ(source.description().scalars.size(), expected["scalars"].size());
  for (const json& scalar : expected["scalars"])
    expectScalar(source.description(), block, nodes, scalar, expected["scalars"]);
}

void expectFile(const std::filesystem::path& path, const json& blocks) {
  SCOPED_TRACE(path.string());
  const auto source = open(path);
  ASSERT_EQ(source->description().blocks.size(), blocks.size());
  for (uint32_t b = 0; b < blocks.size(); ++b) expectBlock(*source, b, blocks[b]);
  if (path.string().starts_with(kMade.string())) expectPartsOfRows(*source);
}

TEST(VtkFiles, WrittenByVtkReadAsVtkReadsThem) {
  const json expected = json::parse(readTextFile(kMade / "expected.json"));
  size_t files = 0;
  for (const auto& [name, blocks] : expected.items()) {
    if (!blocks.is_array() || name == "blanked.vts") continue;
    expectFile(kMade / name, blocks);
    ++files;
  }
  EXPECT_GE(files, 19u);
}

TEST(VtkFiles, OfPeopleReadAsVtkReadsThem) {
  if (!std::filesystem::is_directory(kShared)) GTEST_SKIP() << "needs " << kShared;
  const json expected = json::parse(readTextFile(kMade / "expected_real.json"));
  EXPECT_EQ(expected.size(), 11u);
  for (const auto& [name, blocks] : expected.items())
    expectFile(kShared / (name.starts_with("face") ? "vts_encodings" : "vtk") / name, blocks);
}

// Pieces with a layer of ghosts each: every cell of the whole grid comes once, from one piece.
TEST(VtkFiles, PiecesWithGhostsAbut) {
  const json all = json::parse(readTextFile(kMade / "expected.json"));
  for (const char* const name : {"ghosts.pvts", "ghosts.pvti"}) {
    SCOPED_TRACE(name);
    const json& expected = all[name];
    const auto source = open(kMade / name);
    const uint32_t of_nodes = scalarsNamed(source->description(), {"RTData"}).front();
    const uint32_t of_cells = scalarsNamed(source->description(), {"RTData:cell"}).front();
    std::set<std::array<double, 4>> nodes;
    uint64_t cells = 0;
    double cell_sum = 0;
    for (uint32_t b = 0; b < source->description().blocks.size(); ++b) {
      const NodeArrays read = allNodes(*source, b);
      for (size_t n = 0; n < read.x.size(); ++n) {
        nodes.insert({read.x[n], read.y[n], read.z[n], read.scalars[of_nodes][n]});
        if (!std::isfinite(read.scalars[of_cells][n])) continue;
        ++cells;
        cell_sum += read.scalars[of_cells][n];
      }
      EXPECT_EQ(std::count(read.blank.begin(), read.blank.end(), 1), 0);
    }
    EXPECT_EQ(source->description().blocks.size(), 4u);
    EXPECT_EQ(nodes.size(), expected["nodes"].get<size_t>());
    EXPECT_EQ(crcOf(std::vector<std::array<double, 4>>(nodes.begin(), nodes.end())),
              expected["crc"].get<uint32_t>());
    EXPECT_EQ(cells, expected["cells"].get<uint64_t>());
    EXPECT_NEAR(cell_sum, expected["cell_sum"].get<double>(), 1e-9 * std::abs(cell_sum));
  }
}

// The script has hidden nodes 0, 17 and 23, and cells 0, 1, 4, 5, 12, 13, 16 and 17: all that are around
// nodes (0..1, 0..1) of each plane.
TEST(VtkFiles, HiddenNodesAndCellsAreBlank) {
  const auto source = open(kMade / "blanked.vts");
  const GridBlock& block = source->description().blocks.at(0);
  EXPECT_TRUE(block.has_blanking);
  const NodeArrays nodes = allNodes(*source, 0);
  std::set<uint64_t> expected = {0, 17, 23};
  for (uint64_t k = 0; k < 3; ++k)
    for (uint64_t n : {0, 1, 5, 6}) expected.insert(20 * k + n);
  for (size_t n = 0; n < nodes.blank.size(); ++n) EXPECT_EQ(nodes.blank[n], expected.count(n)) << n;
  const uint32_t of_cells = scalarsNamed(source->description(), {"p:cell"}).front();
  const std::vector<float> cells = cellValues(block, nodes.scalars[of_cells]);
  const std::set<size_t> hidden = {0, 1, 4, 5, 12, 13, 16, 17};
  for (size_t n = 0; n < cells.size(); ++n) EXPECT_EQ(std::isnan(cells[n]), hidden.count(n) > 0) << n;

  // Strips of it have the same, although cells of the rows beside them count, too.
  NodeArrays strip;
  for (uint64_t j = 0; j < block.nj; ++j)
    for (uint64_t k = 0; k < block.nk; ++k) {
      source->read(0, {j, j + 1, k, k + 1}, {}, strip);
      const auto at = nodes.blank.begin() + static_cast<ptrdiff_t>((k * block.nj + j) * block.ni);
      EXPECT_TRUE(std::equal(strip.blank.begin(), strip.blank.end(), at)) << j << " " << k;
    }
}

TEST(VtkFiles, BlocksOfASetHaveTheirNames) {
  const auto source = open(kMade / "blocks.vtm");
  const GridDescription& description = source->description();
  ASSERT_EQ(description.blocks.size(), 2u);
  EXPECT_EQ(description.blocks[0].name, "inlet");
  EXPECT_EQ(description.blocks[1].name, "outlet");
  ASSERT_EQ(description.warnings.size(), 1u);
  expectSays(description.warnings[0], "blocks_1.vtp is of type PolyData");
  EXPECT_EQ(description.files.size(), 4u);
}

TEST(VtkFiles, TimeStepsAreChosenInTheirOrder) {
  const double times[] = {0.5, 1.25, 4.0};
  for (uint32_t step = 0; step < 3; ++step) {
    const auto source = open(kMade / "series.pvd", step);
    EXPECT_EQ(source->description().times, std::vector<double>(std::begin(times), std::end(times)));
    EXPECT_EQ(source->description().time_step, step);
    const uint32_t p = scalarsNamed(source->description(), {"p"}).front();
    EXPECT_FLOAT_EQ(allNodes(*source, 0).scalars[p][0], static_cast<float>(1 + times[step]));
  }
  EXPECT_EQ(open(kMade / "series.pvd")->description().time_step, 0u);
  for (const char* const name : {"series.pvd", "ascii.vts", "structured_ascii.vtk"}) {
    SCOPED_TRACE(name);
    expectError([&] { open(kMade / name, 3); }, {"--time-step 3 is out of range"});
  }
}

TEST(VtkFiles, ScalarsAreFoundByAllTheirNames) {
  const auto source = open(kMade / "raw_lz4_64.vts");
  const GridDescription& description = source->description();
  EXPECT_EQ(description.scalars[0].name, "p");  // the active one
  EXPECT_EQ(description.coordinate_bytes, 8);
  const auto name = [&](const char* word) {
    return description.scalars[scalarsNamed(description, {word}).front()].name;
  };
  EXPECT_EQ(name("Wall_Distance"), "wall distance");
  EXPECT_EQ(name("u"), "U:mag");
  EXPECT_EQ(name("U:1"), "U:y");
  EXPECT_EQ(name("stress:8"), "stress:8");
  EXPECT_EQ(name("p:cell"), "p:cell");
  EXPECT_EQ(name("flux:z"), "flux:z");
}

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
    return curvisplat::errorOf([&] { open(content, head); });
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
    expectSays(error, "grid.vtk: byte");
    EXPECT_EQ(error.find('\n'), std::string::npos) << error;
  }
  expectSays(errorOf(uniform_, "OCTAL"), "expected ASCII or BINARY");
  expectSays(errorOf(uniform_ + "POINT_DATA 12\nVECTORS v double\n12345678", "BINARY"),
             "needs 36 numbers, 288 bytes, but only 8 are left");
}

}  // namespace
}  // namespace curvisplat
