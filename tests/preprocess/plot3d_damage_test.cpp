// Damaged PLOT3D files: truncated, with trailing bytes, of the planes format, with broken markers. The reader
// refuses them in words, or says in a warning what it has ignored; it never reads shifted data.
#include <gtest/gtest.h>

#include <cerrno>
#include <random>

#include "preprocess/formats/open/open_grid.h"
#include "stream/base/error.h"
#include "tests/preprocess/plot3d_bytes.h"
#include "tests/support/expect_error.h"
#include "tests/support/fault_sweep.h"

namespace curvisplat {
namespace {

using namespace test;

constexpr ByteOrder kLittle = ByteOrder::kLittle, kBig = ByteOrder::kBig;
constexpr RecordMarkers kC = RecordMarkers::kNone, kFortran = RecordMarkers::kBytes4;

std::unique_ptr<GridSource> openPlot3d(const TestFolder& folder, const Bytes& grid,
                                       const Bytes* solution = nullptr) {
  OpenGridOptions options;
  options.grid = folder.write("grid", grid);
  if (solution) options.solutions.push_back(folder.write("solution", *solution));
  options.temporary_folder = folder.path();
  return openGrid(options);
}

std::string plot3dError(const TestFolder& folder, const Bytes& grid, const Bytes* solution = nullptr) {
  return curvisplat::errorOf([&] { openPlot3d(folder, grid, solution); });
}

/// Expects that a file's first bytes are read as those of the whole file.
void expectSameNodes(const GridSource& truncated, const GridSource& whole) {
  NodeArrays found, expected;
  ASSERT_EQ(truncated.description().blocks.size(), whole.description().blocks.size());
  for (uint32_t b = 0; b < whole.description().blocks.size(); ++b) {
    const GridBlock& block = whole.description().blocks[b];
    ASSERT_EQ(truncated.description().blocks[b].nodes(), block.nodes());
    const std::vector<uint32_t> scalars(whole.description().scalars.empty() ? 0 : 1, 0);
    truncated.read(b, {0, block.nj, 0, block.nk}, scalars, found);
    whole.read(b, {0, block.nj, 0, block.nk}, scalars, expected);
    ASSERT_EQ(found.x, expected.x);
    ASSERT_EQ(found.z, expected.z);
    ASSERT_EQ(found.scalars, expected.scalars);
  }
}

/// A full mantissa each, as computed coordinates have: read as floats they are noise.
std::vector<TestBlock> doubleBlocks(uint32_t components) {
  std::vector<TestBlock> blocks = {testBlock(4, 3, 2, components), testBlock(2, 3, 2, components, 3)};
  std::mt19937_64 random(3);
  std::uniform_real_distribution<double> jitter(0, 1e-7);
  for (TestBlock& block : blocks) {
    for (auto& axis : block.coordinates)
      for (double& value : axis) value += jitter(random);
    for (auto& component : block.components)
      for (double& value : component) value += jitter(random);
  }
  return blocks;
}

/// The next length of a file that is cut: usually one in five, which fall on every byte of a number.
size_t nextLength(size_t size) {
  return static_cast<size_t>(faults::nextInSweep(static_cast<int64_t>(size), 5));
}

TEST(Plot3dDamage, EveryPrefixOfAGridIsRefusedOrReadRight) {
  size_t combination = 0;
  const TestFolder folder("prefixes");
  for (const ByteOrder order : {kLittle, kBig})
    for (const RecordMarkers records : {kC, kFortran, RecordMarkers::kBytes8})
      for (const int precision : {4, 8})
        for (const bool blanking : {false, true}) {
          if (!faults::isTried(combination++, 5)) continue;
          const Plot3dLayout layout{Plot3dKind::kGrid, false, order, records, precision, true, blanking};
          SCOPED_TRACE(describe(layout));
          const Bytes file = plot3dBytes(layout, doubleBlocks(0));
          const auto whole = openPlot3d(folder, file);
          size_t accepted = 0;
          for (size_t size = 0; size < file.size(); size = nextLength(size)) {
            try {
              const auto source =
                  openPlot3d(folder, {file.begin(), file.begin() + static_cast<ptrdiff_t>(size)});
              ++accepted;
              ASSERT_NO_FATAL_FAILURE(expectSameNodes(*source, *whole)) << size;
            } catch (const Error& error) {
              ASSERT_NE(std::string(error.what()).find("grid: "), std::string::npos) << error.what();
            }
          }
          // A C file that ends just where iblank would begin, or up to 3 bytes behind, is a whole one
          // without.
          EXPECT_LE(accepted, blanking && records == kC ? 4u : 0u);
        }
}

TEST(Plot3dDamage, EveryPrefixOfASolutionIsRefused) {
  size_t combination = 0;
  const TestFolder folder("solution-prefixes");
  for (const Plot3dKind kind : {Plot3dKind::kQ, Plot3dKind::kFunction})
    for (const RecordMarkers records : {kC, kFortran})
      for (const int precision : {4, 8}) {
        if (!faults::isTried(combination++, 3)) continue;
        Plot3dLayout layout{Plot3dKind::kGrid, false, kBig, records, precision, true, false};
        const auto blocks = doubleBlocks(5);
        const Bytes grid = plot3dBytes(layout, blocks);
        layout.kind = kind;
        const Bytes file = plot3dBytes(layout, blocks);
        EXPECT_EQ(plot3dError(folder, grid, &file), "");
        layout.precision_bytes = 4;
        const size_t size_in_single = plot3dBytes(layout, blocks).size();
        for (size_t size = 0; size < file.size(); size = nextLength(size)) {
          if (records == kC && size == size_in_single)
            continue;  // a whole file, and the bits are as they are
          const Bytes prefix(file.begin(), file.begin() + static_cast<ptrdiff_t>(size));
          ASSERT_NE(plot3dError(folder, grid, &prefix), "") << size << " of " << file.size();
        }
      }
}

TEST(Plot3dDamage, EveryPrefixOfATextIsRefused) {
  const TestFolder folder("text-prefixes");
  const Plot3dLayout layout{Plot3dKind::kGrid, true, kLittle, kC, 8, false, false};
  const Bytes file = plot3dText(layout, {testBlock(2, 3, 2, 0)});
  EXPECT_EQ(plot3dError(folder, file), "");
  // The last number may lose digits unnoticed.
  for (size_t size = 0; size + 24 < file.size(); ++size)
    ASSERT_NE(plot3dError(folder, {file.begin(), file.begin() + static_cast<ptrdiff_t>(size)}), "") << size;
}

TEST(Plot3dDamage, FlippedBytesNeverCrash) {
  const TestFolder folder("flips");
  std::mt19937_64 random(11);
  for (const RecordMarkers records : {kC, kFortran}) {
    const Plot3dLayout layout{Plot3dKind::kGrid, false, kLittle, records, 4, true, true};
    const Bytes file = plot3dBytes(layout, {testBlock(3, 4, 2, 0), testBlock(2, 2, 2, 0)}, 40);
    for (int n = 0; n < 1000; ++n) {
      Bytes damaged = file;
      damaged[random() % (n % 2 ? damaged.size() : 60)] = static_cast<std::byte>(random());
      try {
        const auto source = openPlot3d(folder, damaged);
        NodeArrays nodes;
        for (uint32_t b = 0; b < source->description().blocks.size(); ++b) {
          const GridBlock& block = source->description().blocks[b];
          source->read(b, {0, block.nj, 0, block.nk}, {}, nodes);
        }
      } catch (const Error&) {
      }
    }
  }
}

TEST(Plot3dDamage, TrailingBytesAreAWarning) {
  const TestFolder folder("trailing");
  for (const RecordMarkers records : {kC, kFortran}) {
    const Plot3dLayout layout{Plot3dKind::kGrid, false, kBig, records, 4, false, false};
    Bytes file = plot3dBytes(layout, {testBlock(9, 8, 7, 0)});
    const auto whole = openPlot3d(folder, file);
    file.insert(file.end(), 484, std::byte{});
    const auto source = openPlot3d(folder, file);
    EXPECT_EQ(source->description().warnings, std::vector<std::string>{"grid: 484 trailing bytes ignored"});
    expectSameNodes(*source, *whole);
  }
}

TEST(Plot3dDamage, ATruncatedIblankIsNotTakenForTrailingBytes) {
  const TestFolder folder("truncated-iblank");
  const Plot3dLayout layout{Plot3dKind::kGrid, false, kBig, kC, 4, false, true};
  Bytes file = plot3dBytes(layout, {testBlock(9, 8, 7, 0)});
  file.resize(12 + 12 * 9 * 8 * 7 + 300);
  const std::string error = plot3dError(folder, file);
  expectSays(error, "300 bytes that look like a truncated iblank");
  expectSays(error, "--iblank no");
}

TEST(Plot3dDamage, TruncatedFilesAreReportedWithTheExpectedSize) {
  const TestFolder folder("truncated");
  const Plot3dLayout layout{Plot3dKind::kGrid, false, kBig, kC, 4, false, false};
  Bytes file = plot3dBytes(layout, {testBlock(9, 8, 7, 0)});
  file.resize(4000);
  const std::string error = plot3dError(folder, file);
  expectSays(error, "4000 bytes fit no PLOT3D grid");
  expectSays(error, "9x8x7: found 4000 bytes; expected 6060 (single precision, no iblank)");
  expectSays(error, "the file seems to be truncated");

  Plot3dLayout fortran = layout;
  fortran.records = kFortran;
  file = plot3dBytes(fortran, {testBlock(9, 8, 7, 0)});
  file.resize(4000);
  const std::string record_error = plot3dError(folder, file);
  expectSays(record_error, "block 1 of 9x8x7 nodes: the record at byte 20 declares 6048 bytes");
}

TEST(Plot3dDamage, PlanesFormatIsRefusedByName) {
  const TestFolder folder("planes");
  const Plot3dLayout layout{Plot3dKind::kGrid, false, kLittle, kFortran, 4, false, false};
  Bytes file;
  Bytes dimensions;
  for (const int32_t n : {6, 5, 4}) appendNumber(dimensions, n, kLittle);
  appendRecord(file, dimensions, layout);
  for (int k = 0; k < 4; ++k) {
    Bytes plane;
    for (int n = 0; n < 3 * 6 * 5; ++n) appendNumber(plane, 1.0f + static_cast<float>(n), kLittle);
    appendRecord(file, plane, layout);
  }
  const std::string error = plot3dError(folder, file);
  expectSays(error, "expected the whole format");
}

TEST(Plot3dDamage, NoiseInTheRightSizeIsRefused) {
  const TestFolder folder("noise");
  std::mt19937_64 random(5);
  Bytes file;
  for (const int32_t n : {6, 5, 4}) appendNumber(file, n, kLittle);
  for (int n = 0; n < 3 * 6 * 5 * 4; ++n) appendNumber(file, static_cast<uint32_t>(random()), kLittle);
  const std::string error = plot3dError(folder, file);
  expectSays(error, "implausible values");
}

TEST(Plot3dDamage, SolutionOfOtherDimensionsNamesBoth) {
  const TestFolder folder("other-dimensions");
  Plot3dLayout layout{Plot3dKind::kGrid, false, kLittle, kFortran, 4, true, false};
  const Bytes grid = plot3dBytes(layout, {testBlock(6, 5, 4, 0), testBlock(3, 3, 3, 0)});
  layout.kind = Plot3dKind::kQ;
  const Bytes q = plot3dBytes(layout, {testBlock(6, 5, 4, 5), testBlock(3, 3, 2, 5)});
  const std::string error = plot3dError(folder, grid, &q);
  expectSays(error, "solution of 2 blocks (6x5x4, 3x3x2), but the grid");
  expectSays(error, "2 blocks (6x5x4, 3x3x3)");
}

TEST(Plot3dDamage, WrongKindsAreNamed) {
  const TestFolder folder("kinds");
  Plot3dLayout layout{Plot3dKind::kGrid, false, kLittle, kFortran, 4, true, false};
  const Bytes grid = plot3dBytes(layout, {testBlock(6, 5, 4, 0)});
  const std::string as_solution = plot3dError(folder, grid, &grid);
  expectSays(as_solution, "it would fit as a grid of 1 block of 6x5x4");
  layout.kind = Plot3dKind::kQ;
  const std::string as_grid = plot3dError(folder, plot3dBytes(layout, {testBlock(6, 5, 4, 5)}));
  expectSays(as_grid, "looks like a solution without its grid (a Q solution of 1 block of 6x5x4");
  folder.write("grid.xyz", grid);  // beside the solution, which is "grid"
  expectSays(plot3dError(folder, plot3dBytes(layout, {testBlock(6, 5, 4, 5)})),
             "its grid, too (perhaps grid.xyz)");
}

/// A disk whose blocks from some offset on cannot be read.
class BadDisk : public SystemCalls {
 public:
  explicit BadDisk(int64_t good_bytes) : good_bytes_(good_bytes) {}
  ssize_t pread(int fd, void* to, size_t count, int64_t offset) override {
    if (offset + static_cast<int64_t>(count) <= good_bytes_) return SystemCalls::pread(fd, to, count, offset);
    errno = EIO;
    return -1;
  }

 private:
  int64_t good_bytes_;
};

TEST(Plot3dDamage, AFailingDiskIsNotTakenForAnotherLayout) {
  const TestFolder folder("bad-disk");
  const Plot3dLayout layout{Plot3dKind::kGrid, false, kBig, kFortran, 4, true, false};
  const Bytes file = plot3dBytes(layout, {testBlock(9, 8, 7, 0), testBlock(3, 3, 3, 0)});
  for (const int64_t good : {2, 20, 70, 6000, 6200}) {
    OpenGridOptions options;
    options.grid = folder.write("grid", file);
    BadDisk disk(good);
    const ScopedSystemCalls scope(disk);
    SCOPED_TRACE(good);
    expectError([&] { openGrid(options); }, {"cannot read"});
  }
}

TEST(Plot3dDamage, EmptyFilesAreNamed) {
  const TestFolder folder("empty");
  expectSays(plot3dError(folder, {}), "is empty");
}

}  // namespace
}  // namespace curvisplat
