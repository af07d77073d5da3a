// What conversion takes on disk, as the check of a small disk estimates it, and what it then takes.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <string>

#include "preprocess/convert/convert.h"
#include "preprocess/scenes/scenes.h"
#include "tests/support/sweep.h"
#include "tests/support/temporary_folder.h"

namespace curvisplat {
namespace {

/// A scene whose nodes are blanked from one plane on.
class HalfBlanked : public GridSource {
 public:
  explicit HalfBlanked(const GridSource& grid) : grid_(grid), description_(grid.description()) {
    for (GridBlock& block : description_.blocks) block.has_blanking = true;
  }
  const GridDescription& description() const override { return description_; }
  void read(uint32_t block, const NodeBox& box, std::span<const uint32_t> scalars,
            NodeArrays& out) const override {
    grid_.read(block, box, scalars, out);
    const uint64_t row = description_.blocks[block].ni;
    for (size_t n = 0; n < out.blank.size(); ++n)
      if (n % row >= row / 2) out.blank[n] = 1;
  }

 private:
  const GridSource& grid_;
  GridDescription description_;
};

/// The larger of both over the smaller.
double factor(uint64_t a, uint64_t b) {
  const double ratio = static_cast<double>(a) / static_cast<double>(b);
  return std::max(ratio, 1 / ratio);
}

void expectWithin(double most, const GridSource& grid, uint64_t sampled_nodes, const std::string& name) {
  SCOPED_TRACE(name);
  const TemporaryFolder folder;
  ConvertOptions options;
  options.output = folder / "a.splats";
  options.scalars = {0};
  Progress progress;
  const DiskNeeds sampled = sampledNeeds(grid, options, folder / "sample", progress, sampled_nodes);
  EXPECT_TRUE(std::filesystem::is_empty(folder.path()));
  const ConvertReport report = convert(grid, options, progress);
  uint64_t bytes = 0;
  for (const FileReport& file : report.files) bytes += file.bytes;
  const DiskNeeds upper = diskNeeds(report.nodes, 1);
  fmt::print("{}: cache {} bytes, estimated {}, at most {}; temporary {}, estimated {}, at most {}\n", name,
             bytes, sampled.cache_bytes, upper.cache_bytes, report.temporary_bytes, sampled.temporary_bytes,
             upper.temporary_bytes);
  EXPECT_LT(factor(sampled.cache_bytes, bytes), most);
  EXPECT_LT(factor(sampled.temporary_bytes, report.temporary_bytes), most);
  EXPECT_LE(bytes, upper.cache_bytes);
  EXPECT_GT(factor(upper.cache_bytes, bytes), most);  // what makes the sample worth its time
}

// A third of the grid, as eight million nodes are of one of 24 million.
TEST(SampledNeeds, AreWithinAFactorOfOneAndAHalf) {
  constexpr SceneGridSize kSize{160, 128, 128};
  for (const char* const name : {"o-grid", "wake"})
    expectWithin(1.5, SceneGridSource(makeScene(name), kSize), 800'000, name);
  const SceneGridSource annulus(makeScene("half-annulus"), kSize);
  expectWithin(1.5, HalfBlanked(annulus), 800'000, "half-annulus, half blanked");
}

TEST(SampledNeeds, OfLargeGridsAreWithinAFactorOfOneAndAHalf) {
  if (!faults::isWholeSweep()) GTEST_SKIP() << "five minutes of processor time; see tests/support/sweep.h";
  for (const char* const name : {"spectral", "sheared-waves"})
    expectWithin(1.5, SceneGridSource(makeScene(name), {300, 300, 300}), kSampledNodes, name);
}

TEST(SampledNeeds, OfAGridThatIsConvertedWholeAreExact) {
  expectWithin(1.01, SceneGridSource(makeScene("wake"), {40, 30, 20}), kSampledNodes, "small");
}

TEST(SampledNeeds, CanBeInterrupted) {
  const TemporaryFolder folder;
  const SceneGridSource grid(makeScene("wake"), {40, 30, 20});
  ConvertOptions options;
  options.output = folder / "a.splats";
  options.scalars = {0};
  Progress progress;
  progress.stop(2);
  EXPECT_THROW(sampledNeeds(grid, options, folder / "sample", progress), Interrupted);
  EXPECT_TRUE(std::filesystem::is_empty(folder.path()));
}

}  // namespace
}  // namespace curvisplat
