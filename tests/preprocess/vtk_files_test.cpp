// Files that VTK has written, and those that people have: what is read equals what VTK's own readers read.
// tests/data/make_vtk_files.py has written the former and asked VTK 9.1's readers (through Python) about
// both: expected.json and expected_real.json have dimensions, ranges and CRC-32 of all numbers.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <set>

#include "preprocess/formats/open/open_grid.h"
#include "stream/base/error.h"
#include "stream/base/file.h"
#include "tests/support/all_nodes.h"
#include "tests/support/crc32.h"
#include "tests/support/parts_of_rows.h"

namespace curvisplat {
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
std::string nameOf(const json& scalar, const json& all) {
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
  const std::string name = nameOf(expected, all);
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
  EXPECT_NE(description.warnings[0].find("blocks_1.vtp is of type PolyData"), std::string::npos);
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
    try {
      open(kMade / name, 3);
      FAIL() << name;
    } catch (const Error& error) {
      EXPECT_NE(std::string(error.what()).find("--time-step 3 is out of range"), std::string::npos)
          << error.what();
    }
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

}  // namespace
}  // namespace curvisplat
