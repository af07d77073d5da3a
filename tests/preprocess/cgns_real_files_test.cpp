// The CGNS files that people have, against an independent reading. The expected checksums and ranges were
// made with Python's h5py and zlib (Debian: python3-h5py), from the HDF5 file itself, of the others from what
// cgns-convert's adf2hdf makes of them: of all zones in the file's order, zlib.crc32 of
// numpy.ascontiguousarray(f[zone/GridCoordinates/CoordinateX/ data]).astype('<f8'), and of a solution's
// arrays .astype('<f4'); ranges are those of the values as stored.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstring>
#include <limits>

#include "preprocess/formats/open/open_grid.h"
#include "stream/base/error.h"
#include "tests/support/expect_error.h"

namespace curvisplat {
namespace {

const std::filesystem::path kRealFiles = CURVISPLAT_SHARED_DATA;

/// The checksum of zlib: polynomial 0x04c11db7, reflected.
class Crc32 {
 public:
  template <typename Value>
  void add(Value value) {
    unsigned char bytes[sizeof(Value)];
    std::memcpy(bytes, &value, sizeof(Value));
    for (const unsigned char byte : bytes) {
      crc_ ^= byte;
      for (int bit = 0; bit < 8; ++bit) crc_ = crc_ & 1 ? crc_ >> 1 ^ 0xedb88320u : crc_ >> 1;
    }
  }
  uint32_t value() const { return ~crc_; }

 private:
  uint32_t crc_ = 0xffffffffu;
};

struct ExpectedArray {
  const char* name;
  uint32_t crc;
  double min, max;
};

struct Found {
  Crc32 crc;
  double min = std::numeric_limits<double>::infinity(), max = -min;
  template <typename Value>
  void add(Value value) {
    crc.add(value);
    min = std::min<double>(min, value);
    max = std::max<double>(max, value);
  }
};

void expectFound(const Found& found, const ExpectedArray& expected) {
  EXPECT_EQ(found.crc.value(), expected.crc) << expected.name;
  EXPECT_NEAR(found.min, expected.min, 1e-7 * std::abs(expected.min)) << expected.name;
  EXPECT_NEAR(found.max, expected.max, 1e-7 * std::abs(expected.max)) << expected.name;
}

class RealCgns : public testing::Test {
 protected:
  void SetUp() override {
    if (!std::filesystem::is_directory(kRealFiles)) GTEST_SKIP() << "needs " << kRealFiles;
  }

  static std::unique_ptr<GridSource> open(const char* file) {
    OpenGridOptions options;
    options.grid = kRealFiles / file;
    return openGrid(options);
  }

  /// Reads all blocks by a plane at a time, and compares the coordinates and then the scalars, in order.
  static void expectArrays(const GridSource& source, const std::vector<ExpectedArray>& expected) {
    const GridDescription& description = source.description();
    std::array<Found, 3> coordinates;
    for (size_t array = 3; array < std::max<size_t>(4, expected.size()); ++array) {
      std::vector<uint32_t> scalars;
      if (array < expected.size()) {
        scalars.push_back(static_cast<uint32_t>(array - 3));
        ASSERT_EQ(description.scalars.at(array - 3).name, expected[array].name);
      }
      Found found;
      for (uint32_t b = 0; b < description.blocks.size(); ++b) {
        const GridBlock& block = description.blocks[b];
        const bool cells =
            array < expected.size() && description.scalars[array - 3].centring == Centring::kCell;
        const uint64_t less = cells ? 1 : 0;
        // All of an axis comes before the next: a pass an axis.
        NodeArrays nodes;
        for (uint64_t k = 0; k < block.nk; ++k) {
          source.read(b, {0, block.nj, k, k + 1}, scalars, nodes);
          for (uint64_t n = 0; array == 3 && n < nodes.x.size(); ++n) {
            coordinates[0].add(nodes.x[n]);
            coordinates[1].add(nodes.y[n]);
            coordinates[2].add(nodes.z[n]);
          }
          if (scalars.empty() || k + less == block.nk) continue;
          for (uint64_t j = 0; j + less < block.nj; ++j)
            for (uint64_t i = 0; i + less < block.ni; ++i) found.add(nodes.scalars[0][i + block.ni * j]);
        }
      }
      if (!scalars.empty()) expectFound(found, expected[array]);
    }
    for (size_t axis = 0; axis < 3; ++axis) expectFound(coordinates[axis], expected[axis]);
  }
};

TEST_F(RealCgns, DeltaWing) {
  const auto source = open("delta_wing/delta_vertex.cgns");
  const GridDescription& description = source->description();
  EXPECT_EQ(description.format, "CGNS (ADF), 1 structured zone");
  ASSERT_EQ(description.blocks.size(), 1u);
  EXPECT_EQ(description.blocks[0].ni, 37u);
  EXPECT_EQ(description.blocks[0].nj, 65u);
  EXPECT_EQ(description.blocks[0].nk, 65u);
  EXPECT_EQ(description.coordinate_bytes, 4);
  EXPECT_EQ(description.scalars.at(0).centring, Centring::kNode);
  EXPECT_EQ(description.scalars.at(0).unit, "");  // normalised by what is not told
  expectArrays(*source, {{"x", 0x89acbc42, -0.800000011920929, 1.7999999523162842},
                         {"y", 0x8c528c6f, -5.6750351962761396e-15, 1.6543920040130615},
                         {"z", 0xa0fc4ef6, -1.6543920040130615, 1.772322177886963},
                         {"Density", 0xaece05fc, 0.864386260509491, 1.0161869525909424},
                         {"MomentumX", 0x043e4684, -0.003026484278962016, 0.4116523563861847},
                         {"MomentumY", 0xed392e85, -0.19583077728748322, 0.33226922154426575},
                         {"MomentumZ", 0xebe8b650, -0.19179050624370575, 0.3106817305088043},
                         {"EnergyStagnationDensity", 0x49dd84e5, 1.5713307857513428, 1.8560447692871094}});
}

TEST_F(RealCgns, CellCentredZonesInBothFileTypes) {
  for (const char* file : {"cgns/sqnz_s.adf.cgns", "cgns/sqnz_s.hdf.cgns"}) {
    SCOPED_TRACE(file);
    const auto source = open(file);
    const GridDescription& description = source->description();
    ASSERT_EQ(description.blocks.size(), 12u);
    EXPECT_EQ(description.blocks[0].name, "dom1_1_1_1");
    uint64_t nodes = 0;
    for (const GridBlock& block : description.blocks) nodes += block.nodes();
    EXPECT_EQ(nodes, 15'228u);
    EXPECT_EQ(description.coordinate_bytes, 8);
    for (const GridScalar& scalar : description.scalars) EXPECT_EQ(scalar.centring, Centring::kCell);
    expectArrays(*source, {{"x", 0x25a6be6b, -1.2, 1.0},
                           {"y", 0x838a74c1, 0.0, 1.0},
                           {"z", 0xb34ff38d, 0.0, 1.0},
                           {"Density", 0x23a27b3b, 0.16009181917328774, 0.9735507864157164},
                           {"MomentumX", 0x96047c36, 0.22478984011648526, 0.5809654104428091},
                           {"MomentumY", 0x4390e0f9, -0.10858691463018902, 0.10679154216759087},
                           {"MomentumZ", 0xe94e4af9, -0.10858691463018884, 0.10679154216759094},
                           {"EnergyStagnationDensity", 0x3bcaa8c2, 0.3414614589755436, 1.7673786630423391}});
  }
}

TEST_F(RealCgns, FiveBlocksAreAGridOnly) {
  const auto source = open("cgns/5blocks.cgns");
  ASSERT_EQ(source->description().blocks.size(), 5u);
  EXPECT_EQ(source->description().blocks[4].name, "domain.5");
  EXPECT_EQ(source->description().blocks[4].ni, 16u);
  EXPECT_EQ(source->description().blocks[4].nj, 9u);
  EXPECT_EQ(source->description().blocks[4].nk, 10u);
  EXPECT_TRUE(source->description().scalars.empty());
  expectArrays(*source, {{"x", 0x92504c1b, -305.8407897949219, 342.5271301269531},
                         {"y", 0x1c2d417c, -321.2931823730469, 56.000003814697266},
                         {"z", 0x1aa9716a, -1.6427748050773516e-11, 217.17933654785156}});
}

TEST_F(RealCgns, OversetPlanesAreRefused) {
  expectError([&] { open("cgns/oversetnasa1.cgns"); }, {"5 zones of a single plane of nodes"});
}

}  // namespace
}  // namespace curvisplat
