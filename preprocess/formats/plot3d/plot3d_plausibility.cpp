#include "preprocess/formats/plot3d/plot3d_plausibility.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "preprocess/formats/plot3d/plot3d_file.h"

namespace curvisplat {
namespace {

// Read with the wrong byte order or precision, most numbers are extreme, or differ from their neighbour along
// i by many powers of two, since their exponents are arbitrary bits. Numbers of a field do so in few places.
constexpr double kNoiseBelow = 1e-36, kNoiseAbove = 1e30;
constexpr double kNoiseJump = 65536;
constexpr double kUsualSize = 1e12;
constexpr double kNoiseShare = 0.25;
constexpr int32_t kLargestIblank = 1'000'000;  // iblank values are at most block or grid numbers

/// Up to 8 blocks spread over the file.
std::vector<uint32_t> sampleBlocks(size_t blocks) {
  std::vector<uint32_t> sample;
  const size_t step = std::max<size_t>(1, blocks / 8);
  for (size_t b = 0; b < blocks; b += step) sample.push_back(static_cast<uint32_t>(b));
  return sample;
}

/// At most `most` rows along i, spread over a block.
std::vector<NodeBox> sampleRows(const Plot3dBlock& block, uint64_t most) {
  const uint64_t rows = block.nj * block.nk;
  const uint64_t step = std::max<uint64_t>(1, rows / most);
  std::vector<NodeBox> boxes;
  for (uint64_t row = 0; row < rows && boxes.size() < most; row += step)
    boxes.push_back({row % block.nj, row % block.nj + 1, row / block.nj, row / block.nj + 1});
  return boxes;
}

bool isExtreme(double value) {
  const double size = std::abs(value);
  return size != 0 && (size < kNoiseBelow || size > kNoiseAbove);
}

/// Whether `values` (rows of `ni`) look like noise instead of a field; if so, `example` is one of them.
bool isNoise(const std::vector<double>& values, uint64_t ni, double& example) {
  uint64_t finite = 0, extreme = 0, jumps = 0;
  double largest = 0, before = 0, extreme_value = 0;
  for (size_t n = 0; n < values.size(); ++n) {
    if (n % ni == 0) before = 0;
    if (!std::isfinite(values[n])) continue;
    const double size = std::abs(values[n]);
    ++finite;
    if (isExtreme(values[n])) {
      ++extreme;
      extreme_value = values[n];
    }
    if (size != 0 && before != 0) jumps += size > kNoiseJump * before || before > kNoiseJump * size;
    largest = std::max(largest, size);
    before = size;
  }
  const double limit = kNoiseShare * static_cast<double>(finite);
  // Among numbers of usual magnitude, tiny ones are rounding errors of zero.
  const bool jumpy = largest > kUsualSize && static_cast<double>(jumps) > limit;
  example = jumpy ? largest : extreme_value;
  return jumpy || static_cast<double>(extreme) > limit;
}

}  // namespace

std::optional<std::string> implausibility(const Plot3dFit& fit) {
  const Plot3dFile file(fit);
  std::vector<double> values(fit.blocks.front().ni);
  file.read(0, 0, {0, 1, 0, 1}, values);
  if (isExtreme(values.front()))
    return fmt::format("its values begin with {}, as if its header were longer", values.front());
  double example = 0;
  const std::vector<uint32_t> blocks = sampleBlocks(fit.blocks.size());
  for (const uint32_t b : blocks) {
    const uint64_t ni = fit.blocks[b].ni;
    const std::vector<NodeBox> rows = sampleRows(fit.blocks[b], 64 / blocks.size());
    for (uint32_t component = 0; component < fit.components; ++component) {
      values.resize(rows.size() * ni);
      for (size_t r = 0; r < rows.size(); ++r)
        file.read(b, component, rows[r], std::span(values).subspan(r * ni, ni));
      if (isNoise(values, ni, example))
        return fmt::format("many values of component {} of block {} are like {}", component + 1, b + 1,
                           example);
    }
    if (!fit.layout.blanking) continue;
    std::vector<int32_t> iblank(ni);
    for (const NodeBox& row : rows) {
      file.readIblank(b, row, iblank);
      for (const int32_t value : iblank)
        if (value > kLargestIblank || value < -kLargestIblank)
          return fmt::format("block {} has an iblank of {}", b + 1, value);
    }
  }
  return std::nullopt;
}

bool trailingLooksLikeIblank(const Plot3dFit& fit) {
  const uint64_t width = fit.layout.integerBytes();
  if (fit.layout.kind != Plot3dKind::kGrid || fit.layout.blanking ||
      fit.layout.records != RecordMarkers::kNone || fit.trailing_bytes < width)
    return false;
  Plot3dFit behind = fit;  // reads the trailing bytes as the iblank of a one-row block
  const uint64_t count = std::min<uint64_t>(fit.trailing_bytes / width, 1024);
  behind.blocks = {{count, 1, 1, fit.payload.size() - fit.trailing_bytes}};
  behind.components = 0;
  behind.layout.blanking = true;
  std::vector<int32_t> values(count);
  Plot3dFile(behind).readIblank(0, {0, 1, 0, 1}, values);
  const bool small = std::all_of(values.begin(), values.end(),
                                 [](int32_t v) { return v <= kLargestIblank && v >= -kLargestIblank; });
  return small && std::any_of(values.begin(), values.end(), [](int32_t v) { return v != 0; });
}

}  // namespace curvisplat
