// The same grid in every encoding that VTK's XML files have is the same grid: each value, however it is read,
// and the cache that is made of it.
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "preprocess/convert/convert.h"
#include "preprocess/formats/open/open_grid.h"
#include "preprocess/formats/vtk/encoded_bytes.h"
#include "stream/base/error.h"
#include "stream/cache/cache_reader.h"
#include "tests/preprocess/plot3d_bytes.h"
#include "tests/support/expect_error.h"
#include "tests/support/fault_sweep.h"
#include "tests/support/grid_nodes.h"
#include "tests/support/vts_writer.h"

namespace curvisplat {
namespace {

using test::TestFolder;

std::unique_ptr<GridSource> openText(const TestFolder& folder, const std::string& file) {
  OpenGridOptions options;
  options.grid = folder.write("grid.vts", file);
  options.temporary_folder = folder.path();
  return openGrid(options);
}

std::string encodingError(const TestFolder& folder, const std::string& file) {
  return curvisplat::errorOf([&] { allNodes(*openText(folder, file), 0); });
}

/// NaN is itself.
bool same(const std::vector<float>& a, const std::vector<float>& b) {
  return a.size() == b.size() && std::equal(a.begin(), a.end(), b.begin(), [](float x, float y) {
           return x == y || (std::isnan(x) && std::isnan(y));
         });
}

TEST(VtkEncodings, AllHoldTheSameValues) {
  const TestFolder folder("vts-encodings");
  const VtsGrid grid = annulusVtsGrid(7, 6, 5, {2, 0, -1});
  for (const VtsEncoding& encoding : allVtsEncodings()) {
    SCOPED_TRACE(encoding.describe());
    const auto source = openText(folder, vtsFile(grid, encoding));
    const GridDescription& description = source->description();
    ASSERT_EQ(description.blocks.size(), 1u);
    const GridBlock& block = description.blocks[0];
    ASSERT_EQ(std::vector({block.ni, block.nj, block.nk}), (std::vector<uint64_t>{7, 6, 5}));
    EXPECT_EQ(description.coordinate_bytes, 4);
    EXPECT_TRUE(description.warnings.empty());
    const NodeArrays nodes = allNodes(*source, 0);
    ASSERT_EQ(description.scalars.size(), 7u);
    const auto values = [&](const char* name) { return nodes.scalars[scalarsNamed(description, {name})[0]]; };
    for (size_t n = 0; n < nodes.x.size(); ++n) {
      EXPECT_EQ(nodes.x[n], grid.points.values[3 * n]);
      EXPECT_EQ(nodes.y[n], grid.points.values[3 * n + 1]);
      EXPECT_EQ(nodes.z[n], grid.points.values[3 * n + 2]);
      EXPECT_EQ(nodes.blank[n], 0);
      EXPECT_EQ(values("p")[n], static_cast<float>(grid.point_data[0].values[n]));
      EXPECT_EQ(values("id")[n], static_cast<float>(grid.point_data[2].values[n]));
      const double* const u = &grid.point_data[1].values[3 * n];
      EXPECT_EQ(values("U:y")[n], static_cast<float>(u[1]));
      EXPECT_FLOAT_EQ(values("U:mag")[n], static_cast<float>(std::hypot(u[0], u[1], u[2])));
    }
    const std::vector<float> cells = cellValues(block, values("T"));
    EXPECT_EQ(cells, std::vector<float>(grid.cell_data[0].values.begin(), grid.cell_data[0].values.end()));
  }
}

TEST(VtkEncodings, BoxesAreThoseOfTheWhole) {
  const TestFolder folder("vts-boxes");
  std::mt19937_64 random(3);
  const VtsGrid grid = annulusVtsGrid(11, 9, 8);
  for (const VtsEncoding& encoding : allVtsEncodings()) {
    SCOPED_TRACE(encoding.describe());
    const auto source = openText(folder, vtsFile(grid, encoding));
    const NodeArrays all = allNodes(*source, 0);
    const std::vector<uint32_t> scalars = {6, 2, 0};  // T, U:x, p
    NodeArrays box_nodes;
    for (int n = 0; n < 30; ++n) {
      NodeBox box{random() % 9, 0, random() % 8, 0};
      box.j1 = box.j0 + 1 + random() % (9 - box.j0);
      box.k1 = box.k0 + 1 + random() % (8 - box.k0);
      source->read(0, box, scalars, box_nodes);
      std::vector<double> x;
      std::vector<std::vector<float>> values(scalars.size());
      for (uint64_t k = box.k0; k < box.k1; ++k)
        for (uint64_t j = box.j0; j < box.j1; ++j)
          for (uint64_t i = 0; i < 11; ++i) {
            const auto node = static_cast<size_t>((k * 9 + j) * 11 + i);
            x.push_back(all.x[node]);
            for (size_t s = 0; s < scalars.size(); ++s) values[s].push_back(all.scalars[scalars[s]][node]);
          }
      EXPECT_EQ(box_nodes.x, x);
      for (size_t s = 0; s < scalars.size(); ++s) EXPECT_TRUE(same(box_nodes.scalars[s], values[s])) << s;
    }
  }
}

TEST(VtkEncodings, AllTypesOfNumbersAreRead) {
  const TestFolder folder("vts-types");
  const std::pair<const char*, std::vector<double>> types[] = {
      {"Int8", {-128, 127}},       {"UInt8", {0, 255}},           {"Int16", {-32768, 32767}},
      {"UInt16", {0, 65535}},      {"Int32", {-2147483648.0, 5}}, {"UInt32", {0, 4294967040.0}},
      {"Int64", {-1e18, 1 << 20}}, {"UInt64", {0, 9e18}},         {"Float32", {-0.1f, 1e30}},
      {"Float64", {0.1, 1e-30}},
  };
  VtsGrid grid = annulusVtsGrid(3, 4, 5);
  for (const auto& [type, ends] : types) {
    VtsArray array{type, type, 1, {}};
    for (size_t n = 0; n < 60; ++n) array.values.push_back(ends[n % 2]);
    grid.point_data.push_back(array);
  }
  grid.points.type = "Float64";
  for (double& x : grid.points.values) x += 1e-9;
  for (const VtsEncoding& encoding : allVtsEncodings()) {
    SCOPED_TRACE(encoding.describe());
    const auto source = openText(folder, vtsFile(grid, encoding));
    EXPECT_EQ(source->description().coordinate_bytes, 8);
    const NodeArrays nodes = allNodes(*source, 0);
    EXPECT_EQ(nodes.x[7], grid.points.values[21]);
    for (const VtsArray& array : grid.point_data) {
      if (array.components > 1) continue;
      const uint32_t position = scalarsNamed(source->description(), {array.name}).front();
      EXPECT_EQ(nodes.scalars[position][0], static_cast<float>(array.values[0])) << array.name;
      EXPECT_EQ(nodes.scalars[position][1], static_cast<float>(array.values[1])) << array.name;
    }
  }
}

std::map<std::string, uint64_t> checksumsOf(const GridSource& source, const std::vector<std::string>& scalars,
                                            const std::filesystem::path& output) {
  ConvertOptions options;
  options.output = output;
  options.memory_bytes = uint64_t{256} << 20;
  options.scalars = scalarsNamed(source.description(), scalars);
  options.title = "grid";
  Progress progress;
  convert(source, options, progress);
  std::map<std::string, uint64_t> checksums;
  const CacheReader cache(output);
  for (const FileInfo& file : cache.manifest().files) checksums[file.name] = file.checksum;
  std::filesystem::remove_all(output);
  return checksums;
}

TEST(VtkEncodings, AllGiveTheSameCache) {
  const TestFolder folder("vts-caches");
  const VtsGrid grid = annulusVtsGrid(20, 15, 12);
  std::map<std::string, uint64_t> first;
  size_t number = 0;
  for (const VtsEncoding& encoding : allVtsEncodings()) {
    if (encoding.header_bytes == 8 && !encoding.big_endian) continue;
    if (!faults::isTried(number++, 7)) continue;  // AllHoldTheSameValues has all of them
    SCOPED_TRACE(encoding.describe());
    const auto checksums = checksumsOf(*openText(folder, vtsFile(grid, encoding)), {"p", "U:mag"},
                                       folder.path() / "grid.splats");
    if (first.empty()) first = checksums;
    EXPECT_EQ(checksums, first);
  }
  EXPECT_GE(first.size(), 4u);
}

// An ocean's temperature in cells, from the files that others have encoded, and encoded again by the tests.
TEST(VtkEncodings, FacesOfAnOceanGiveTheSameCacheInEachEncoding) {
  const std::filesystem::path faces = std::filesystem::path(CURVISPLAT_SHARED_DATA) / "vts_encodings";
  if (!std::filesystem::is_directory(faces)) GTEST_SKIP() << "needs " << faces;
  using Format = VtsEncoding::Format;
  using Compressor = VtsEncoding::Compressor;
  const TestFolder folder("vts-faces");
  for (const char* const name : {"face1_ascii.vts", "face6_appended_raw_lz4_u64.vts"}) {
    OpenGridOptions options;
    options.grid = faces / name;
    options.temporary_folder = folder.path();
    const auto source = openGrid(options);
    const GridBlock& block = source->description().blocks[0];
    const NodeArrays nodes = allNodes(*source, 0);
    VtsGrid grid;
    grid.extent = {0, 32, 0, 32, 0, 15};
    for (size_t n = 0; n < nodes.x.size(); ++n)
      for (const double x : {nodes.x[n], nodes.y[n], nodes.z[n]}) grid.points.values.push_back(x);
    const std::vector<float> cells =
        cellValues(block, nodes.scalars[scalarsNamed(source->description(), {"T"})[0]]);
    grid.cell_data = {{"T", "Float32", 1, {cells.begin(), cells.end()}}};
    const auto expected = checksumsOf(*source, {"T"}, folder.path() / "grid.splats");
    EXPECT_GE(expected.size(), 4u);
    size_t number = name[4] - '0';  // 1 and 6: usually others of either file
    for (const VtsEncoding& encoding :
         {VtsEncoding{Format::kAscii}, VtsEncoding{Format::kInlineBase64, Compressor::kZlib},
          VtsEncoding{Format::kAppendedRaw, Compressor::kNone, 4, true},
          VtsEncoding{Format::kAppendedBase64, Compressor::kZlib},
          VtsEncoding{Format::kAppendedRaw, Compressor::kZlib},
          VtsEncoding{Format::kAppendedRaw, Compressor::kLz4, 8},
          VtsEncoding{Format::kInlineBase64, Compressor::kLzma}}) {
      if (!faults::isTried(number++, 4)) continue;
      SCOPED_TRACE(encoding.describe());
      const auto again = openText(folder, vtsFile(grid, encoding));
      EXPECT_EQ(checksumsOf(*again, {"T"}, folder.path() / "grid.splats"), expected);
    }
  }
}

// Writers other than VTK make one block of all. One of zlib's is unpacked on disk; those of LZ4 and LZMA are not.
TEST(VtkEncodings, BlocksLargerThanMemoryAllows) {
  const TestFolder folder("vts-large-blocks");
  VtsGrid grid = annulusVtsGrid(64, 64, 64);
  grid.point_data.push_back({"noise", "Float64", 5, {}});
  for (size_t n = 0; n < 5 * 64 * 64 * 64; ++n)
    grid.point_data.back().values.push_back(static_cast<double>(n * n % 97));
  VtsEncoding encoding;
  encoding.block_bytes = size_t{64} << 20;
  ASSERT_GT(5 * 64 * 64 * 64 * sizeof(double), kLargestBlockInMemory);
  encoding.compressor = VtsEncoding::Compressor::kZlib;
  std::string file = vtsFile(grid, encoding);
  const auto source = openText(folder, file);
  NodeArrays nodes;
  const std::vector<uint32_t> wanted = scalarsNamed(source->description(), {"noise:3"});
  source->read(0, {7, 9, 60, 64}, wanted, nodes);
  const std::vector<double>& noise = grid.point_data.back().values;
  for (size_t k = 0; k < 4; ++k)
    for (size_t n = 0; n < 128; ++n)
      ASSERT_EQ(nodes.scalars[0][128 * k + n],
                static_cast<float>(noise[5 * (((60 + k) * 64 + 7) * 64 + n) + 3]));

  encoding.compressor = VtsEncoding::Compressor::kLz4;
  const std::string error = encodingError(folder, vtsFile(grid, encoding));
  expectSays(error, "cannot be read in parts");
}

TEST(VtkEncodings, UnsupportedEncodingsAreRefusedByName) {
  const TestFolder folder("vts-refused");
  const std::string file = vtsFile(annulusVtsGrid(3, 3, 3), {});
  const auto changed = [&](const std::string& from, const std::string& to) {
    std::string other = file;
    for (size_t at; (at = other.find(from)) != std::string::npos;) other.replace(at, from.size(), to);
    return encodingError(folder, other);
  };
  const std::tuple<const char*, const char*, const char*> cases[] = {
      {"version=\"1.0\" byte", "compressor=\"vtkZstdDataCompressor\" byte",
       "compressed by vtkZstdDataCompressor"},
      {"StructuredGrid", "Unstructured", "of type Unstructured; expected StructuredGrid"},
      {"LittleEndian", "MiddleEndian", "byte_order MiddleEndian"},
      {"UInt32", "UInt31", "header_type UInt31"},
      {"encoding=\"raw\"", "encoding=\"hex\"", "appended data in hex"},
      {"0 2 0 2 0 2", "0 2 0 2 0 0", "should have 108 bytes"},
      {"0 2 0 2 0 2", "0 2 0 2 2 0", "expected the first and last node"},
      {"0 2 0 2 0 2", "0 1 0 0 0 99999999999", "expected the first and last node"},
      {"<Points>", "<Pointz>", "without <Points>"},
      {"Float32", "Float16", "type Float16"},
      {"NumberOfComponents=\"3\"", "NumberOfComponents=\"4\"", "should have 432 bytes"},
      {"<!-- a > b -->", "<!DOCTYPE VTKFile>", "found <!DOCTYPE"},
  };
  for (const auto& [from, to, words] : cases) {
    const std::string error = changed(from, to);
    EXPECT_NE(error.find(words), std::string::npos) << from << " -> " << to << ": " << error;
    expectSays(error, "grid.vts");
  }
}

TEST(VtkEncodings, ArraysThatAreNotDrawnDoNotStopTheOthers) {
  const TestFolder folder("vts-not-drawn");
  VtsGrid grid = annulusVtsGrid(3, 3, 3);
  grid.point_data = {{"a", "Float32", 1, std::vector<double>(27, 5)}};
  grid.cell_data.clear();
  std::string file = vtsFile(grid, {});
  const std::string begin = "<PointData>";
  ASSERT_NE(file.find(begin), std::string::npos) << file.substr(0, 1000);
  file.insert(file.find(begin) + begin.size(),
              "<DataArray type=\"Bit\" Name=\"flags\" format=\"appended\" offset=\"0\"/>"
              "<DataArray type=\"Float16\" Name=\"halves\" format=\"appended\" offset=\"0\"/>"
              "<Array type=\"String\" Name=\"words\" format=\"appended\" offset=\"0\"/>");
  const auto source = openText(folder, file);
  EXPECT_EQ(source->description().scalars.size(), 1u);
  EXPECT_EQ(
      source->description().warnings,
      (std::vector<std::string>{"left out: array flags of the points has type Bit, which is not drawn",
                                "left out: array halves of the points has type Float16, which is not drawn",
                                "left out: array words of the points has type String, which is not drawn"}));
}

TEST(VtkEncodings, IntegersOfTextsAreExact) {
  const TestFolder folder("vts-integers");
  VtsEncoding ascii;
  ascii.format = VtsEncoding::Format::kAscii;
  VtsGrid grid = annulusVtsGrid(3, 3, 3);
  grid.point_data = {{"a", "UInt64", 1, std::vector<double>(27, 5)},
                     {"b", "Int64", 1, std::vector<double>(27, 5)}};
  grid.point_data[0].values[9] = grid.point_data[1].values[9] = 987654;
  std::string text = vtsFile(grid, ascii);
  for (const std::string_view most : {"18446744073709551615", "9223372036854775807"})
    text.replace(text.find("987654"), 6, most);
  const auto source = openText(folder, text);
  const NodeArrays nodes = allNodes(*source, 0);
  EXPECT_EQ(nodes.scalars[0][9], 0x1p64f);
  EXPECT_EQ(nodes.scalars[1][9], 0x1p63f);
}

TEST(VtkEncodings, TextsMustHaveAsManyNumbersAsTheGrid) {
  const TestFolder folder("vts-texts");
  VtsEncoding ascii;
  ascii.format = VtsEncoding::Format::kAscii;
  VtsGrid grid = annulusVtsGrid(3, 3, 3);
  grid.point_data = {{"a", "Int8", 1, std::vector<double>(27, 5)}};
  EXPECT_EQ(encodingError(folder, vtsFile(grid, ascii)), "");
  grid.point_data[0].values[9] = 300;
  expectSays(encodingError(folder, vtsFile(grid, ascii)), "array a: 300 is not an integer of 8 bits");
  grid.point_data[0].values.assign(28, 5);
  expectSays(encodingError(folder, vtsFile(grid, ascii)), "array a has more than 27 numbers");
  grid.point_data[0].values.assign(26, 5);
  expectSays(encodingError(folder, vtsFile(grid, ascii)), "array a needs 27 numbers");
  grid.point_data[0].values.assign(26, 55);
  expectSays(encodingError(folder, vtsFile(grid, ascii)), "array a has 26 numbers; expected 27");
}

TEST(VtkEncodings, CharactersThatAreNoBase64AreRefused) {
  const TestFolder folder("vts-base64");
  VtsEncoding encoding;
  encoding.format = VtsEncoding::Format::kAppendedBase64;
  size_t begin = 0;
  const std::string file = vtsFile(annulusVtsGrid(3, 3, 3), encoding, &begin);
  EXPECT_EQ(encodingError(folder, file), "");
  for (const char wrong : {'!', '=', ' ', '\n', '\x80'}) {
    std::string other = file;
    other[begin + 41] = wrong;
    const std::string error = encodingError(folder, other);
    expectSays(error, fmt::format("byte {}: not valid base64", begin + 40));
    other = file;
    other[begin + 43] = wrong;
    expectSays(encodingError(folder, other), fmt::format("byte {}: ", begin + 40));
  }
}

TEST(VtkEncodings, NoOtherFilesGoWithThem) {
  const TestFolder folder("vts-solutions");
  OpenGridOptions options;
  options.grid = folder.write("grid.vts", vtsFile(annulusVtsGrid(3, 3, 3), {}));
  options.solutions = {options.grid};
  EXPECT_THROW(openGrid(options), Error);
}

}  // namespace
}  // namespace curvisplat
