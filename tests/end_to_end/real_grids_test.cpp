// Grids with the troubles of real ones, from their files to a picture: what the program makes of each is whole, fills its
// volume, has no pixel that is not a number, and leaves empty what is blank. Generated scenes are always tried;
// the real grids lie in a folder beside the project, and are skipped without it.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <glm/matrix.hpp>
#include <ostream>
#include <string>

#include "preprocess/formats/open/open_grid.h"
#include "render/image/image.h"
#include "render/image/image_file.h"
#include "stream/base/file.h"
#include "stream/cache/cache_reader.h"
#include "stream/cache/probe.h"
#include "tests/support/fault_sweep.h"
#include "tests/support/program_test.h"

namespace curvisplat {
namespace {

struct RealGrid {
  const char* name;
  const char* grid;  // files in that folder; null: the scene of this name is generated
  const char* solution;
  const char* scalar;
};

void PrintTo(const RealGrid& grid, std::ostream* out) {
  *out << grid.name;
}

constexpr RealGrid kBluntfin{"bluntfin", "bluntfin/bluntfinxyz.bin", "bluntfin/bluntfinq.bin", "density"};
constexpr RealGrid kCombustor{"combustor", "combustor/combxyz.bin", "combustor/combq.bin", "density"};
constexpr RealGrid kLoxPost{"lox_post", "lox_post/postxyz.bin", "lox_post/postq.bin", "momentum_x"};
constexpr RealGrid kNek{"nek", "nek/Combined_PressureSide_Block.xyz", "nek/pressure.fun", "4"};
constexpr RealGrid kNemo{"nemo", "nemo_northsea/nemo_northsea_u.xyz", "nemo_northsea/nemo_northsea_u.fun",
                         "uo"};
constexpr RealGrid kSpectral{"spectral", nullptr, nullptr, "f"};
constexpr RealGrid kDome{"dome", nullptr, nullptr, "f"};
constexpr RealGrid kGlobe{"globe", nullptr, nullptr, "f"};
constexpr RealGrid kDuct{"duct", nullptr, nullptr, "f"};

std::filesystem::path dataFile(const char* name) {
  return std::filesystem::path(CURVISPLAT_SHARED_DATA) / name;
}

/// All nodes of the first block.
NodeArrays nodesOf(const std::filesystem::path& grid, GridBlock& block) {
  OpenGridOptions options;
  options.grid = grid;
  const auto source = openGrid(options);
  block = source->description().blocks.at(0);
  NodeArrays nodes;
  source->read(0, {0, block.nj, 0, block.nk}, {}, nodes);
  return nodes;
}

/// The sum of the volumes of the trilinear hexahedra: two Gauss points an axis integrate their Jacobian
/// exactly.
double hexahedronVolumes(const GridBlock& block, const NodeArrays& nodes) {
  const std::array<uint64_t, 3> strides{1, block.ni, block.ni * block.nj};
  double sum = 0;
  for (uint64_t k = 0; k + 1 < block.nk; ++k)
    for (uint64_t j = 0; j + 1 < block.nj; ++j)
      for (uint64_t i = 0; i + 1 < block.ni; ++i) {
        const uint64_t corner = i * strides[0] + j * strides[1] + k * strides[2];
        std::array<glm::dvec3, 8> at;
        for (uint64_t c = 0; c < 8; ++c) {
          const uint64_t n =
              corner + (c & 1) * strides[0] + (c >> 1 & 1) * strides[1] + (c >> 2) * strides[2];
          at[c] = {nodes.x[n], nodes.y[n], nodes.z[n]};
        }
        double volume = 0;
        for (int point = 0; point < 8; ++point) {
          std::array<double, 3> u;
          for (int axis = 0; axis < 3; ++axis)
            u[axis] = 0.5 + (point >> axis & 1 ? 0.5 : -0.5) / std::sqrt(3.0);
          glm::dmat3 jacobian(0.0);
          for (int c = 0; c < 8; ++c)
            for (int axis = 0; axis < 3; ++axis) {
              double derivative = c >> axis & 1 ? 1 : -1;
              for (int other = 0; other < 3; ++other)
                if (other != axis) derivative *= c >> other & 1 ? u[other] : 1 - u[other];
              jacobian[axis] += derivative * at[static_cast<size_t>(c)];
            }
          volume += glm::determinant(jacobian) / 8;
        }
        sum += std::abs(volume);
      }
  return sum;
}

class RealGrids : public ProgramTest, public testing::WithParamInterface<RealGrid> {
 protected:
  void SetUp() override {
    if (!GetParam().grid) {
      run({"generate", GetParam().name, "--size", "41x33x25", "-o", folder_ / "scene"});
    }
    for (const std::filesystem::path& file : {gridFile(), solutionFile()})
      if (!std::filesystem::exists(file)) GTEST_SKIP() << "needs " << file;
    run({"convert", gridFile(), solutionFile(), "-o", cache(), "--scalar", GetParam().scalar});
  }

  std::filesystem::path gridFile() const {
    return GetParam().grid ? dataFile(GetParam().grid) : folder_ / "scene.xyz";
  }
  std::filesystem::path solutionFile() const {
    return GetParam().grid ? dataFile(GetParam().solution) : folder_ / "scene.fun";
  }
  std::string cache() const { return folder_ / "grid.splats"; }
};

TEST_P(RealGrids, MakeAWholeCacheAndAPictureThatRepeats) {
  run({"info", cache(), "--verify"});
  for (const std::string view : {"iso", "+z", "-y"}) {
    if (view != "iso" && !faults::isWholeSweep()) continue;
    const std::string picture = folder_ / "picture.pfm", again = folder_ / "again.pfm";
    const auto draw = [&](const std::string& output, const std::string& threads) {
      run({"render", cache(), "--view", view, "--size", "200x200", "-o", output, "--threads", threads,
           "--background", "white"});
      return readTextFile(output);
    };
    const std::string drawn_by_one = draw(picture, "1");
    EXPECT_EQ(drawn_by_one, draw(again, "2")) << view;

    const Image image = readImage(picture);
    size_t drawn = 0;
    for (size_t n = 0; n < image.rgba.size(); ++n) {
      ASSERT_TRUE(std::isfinite(image.rgba[n])) << view << " at float " << n;
      ASSERT_GE(image.rgba[n], 0) << view;
      // A function that is a thousand times more opaque for rare values loses digits in its table of floats.
      ASSERT_LE(image.rgba[n], 1 + 1e-2) << view;
      drawn += n % 4 == 0 && image.rgba[n] < 0.99f;
    }
    EXPECT_GT(drawn, 500u) << view;
  }
}

INSTANTIATE_TEST_SUITE_P(Generated, RealGrids, testing::Values(kSpectral, kDome, kGlobe, kDuct),
                         [](const auto& grid) { return std::string(grid.param.name); });
INSTANTIATE_TEST_SUITE_P(Shared, RealGrids, testing::Values(kBluntfin, kCombustor, kLoxPost, kNek, kNemo),
                         [](const auto& grid) { return std::string(grid.param.name); });

class RealVolumes : public RealGrids {};

TEST_P(RealVolumes, AreTheSumsOfTheWeights) {
  GridBlock block;
  const NodeArrays nodes = nodesOf(gridFile(), block);
  const double ratio = CacheReader(cache()).manifest().volume / hexahedronVolumes(block, nodes);
  fmt::print("{}: weights / hexahedra = {:.6f}\n", GetParam().name, ratio);
  EXPECT_NEAR(ratio, 1, 0.01);
}

// Volumes of one block. The dome's bent cells are larger than their hexahedra, by 1.3 % at this size.
INSTANTIATE_TEST_SUITE_P(Generated, RealVolumes, testing::Values(kSpectral),
                         [](const auto& grid) { return std::string(grid.param.name); });
INSTANTIATE_TEST_SUITE_P(Shared, RealVolumes, testing::Values(kBluntfin, kCombustor, kLoxPost),
                         [](const auto& grid) { return std::string(grid.param.name); });

class RealLand : public RealGrids {};

// Nodes all of whose neighbours within three are blank are in no splat; water in the midst of water is.
TEST_P(RealLand, IsEmpty) {
  GridBlock block;
  const NodeArrays nodes = nodesOf(gridFile(), block);
  const CacheReader reader(cache());
  const size_t variable = 0;
  constexpr int64_t kAround = 3;
  int land = 0, water = 0;
  for (uint64_t k = kAround; k + kAround < block.nk; k += 7)
    for (uint64_t j = kAround; j + kAround < block.nj; j += 13)
      for (uint64_t i = kAround; i + kAround < block.ni; i += 11) {
        int blank = 0;
        for (int64_t dk = -kAround; dk <= kAround; ++dk)
          for (int64_t dj = -kAround; dj <= kAround; ++dj)
            for (int64_t di = -kAround; di <= kAround; ++di)
              blank += nodes.blank[(i + di) + block.ni * ((j + dj) + block.nj * (k + dk))];
        constexpr int kAll = (2 * kAround + 1) * (2 * kAround + 1) * (2 * kAround + 1);
        if (blank != 0 && blank != kAll) continue;
        if (blank == kAll ? land >= 40 : water >= 40) continue;
        const uint64_t n = i + block.ni * (j + block.nj * k);
        const auto found = probe(reader, std::span(&variable, 1), {nodes.x[n], nodes.y[n], nodes.z[n]});
        EXPECT_EQ(found.has_value(), blank == 0) << i << ", " << j << ", " << k;
        ++(blank == 0 ? water : land);
      }
  EXPECT_EQ(land, 40);
  EXPECT_EQ(water, 40);
}

INSTANTIATE_TEST_SUITE_P(Shared, RealLand, testing::Values(kNemo),
                         [](const auto& grid) { return std::string(grid.param.name); });

}  // namespace
}  // namespace curvisplat
