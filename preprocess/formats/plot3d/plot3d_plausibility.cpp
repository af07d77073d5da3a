#include "preprocess/formats/plot3d/plot3d_plausibility.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <span>
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

/// Whether numbers look like noise instead of a field.
class NoiseTest {
 public:
  /// The next number begins a row.
  void beginRow() { before_ = 0; }
  void add(std::span<const double> values) {
    for (const double value : values) {
      if (!std::isfinite(value)) continue;
      const double size = std::abs(value);
      ++finite_;
      if (isExtreme(value)) {
        ++extreme_;
        extreme_value_ = value;
      }
      if (size != 0 && before_ != 0) jumps_ += size > kNoiseJump * before_ || before_ > kNoiseJump * size;
      largest_ = std::max(largest_, size);
      before_ = size;
    }
  }
  /// If they do, one of them.
  std::optional<double> example() const {
    const double limit = kNoiseShare * static_cast<double>(finite_);
    // Among numbers of usual magnitude, tiny ones are rounding errors of zero.
    if (largest_ > kUsualSize && static_cast<double>(jumps_) > limit) return largest_;
    if (static_cast<double>(extreme_) > limit) return extreme_value_;
    return std::nullopt;
  }

 private:
  uint64_t finite_ = 0, extreme_ = 0, jumps_ = 0;
  double largest_ = 0, before_ = 0, extreme_value_ = 0;
};

/// Pieces of a row to be read one at a time: rows may be long, and memory is planned only once the format is known.
std::vector<NodeBox> piecesOf(const NodeBox& row, uint64_t ni) {
  constexpr uint64_t kPieceNodes = 1 << 16;
  std::vector<NodeBox> pieces;
  for (uint64_t i = 0; i < ni; i += kPieceNodes) {
    NodeBox& piece = pieces.emplace_back(row);
    piece.i0 = i;
    piece.i1 = std::min(i + kPieceNodes, ni);
  }
  return pieces;
}

}  // namespace

std::optional<std::string> implausibility(const Plot3dFit& fit) {
  const Plot3dFile file(fit);
  std::vector<double> values(1);
  file.read(0, 0, {0, 1, 0, 1, 0, 1}, values);
  if (isExtreme(values.front()))
    return fmt::format("its values begin with {}, as if its header were longer", values.front());
  std::vector<int32_t> iblank;
  const std::vector<uint32_t> blocks = sampleBlocks(fit.blocks.size());
  for (const uint32_t b : blocks) {
    const uint64_t ni = fit.blocks[b].ni;
    const std::vector<NodeBox> rows = sampleRows(fit.blocks[b], 64 / blocks.size());
    for (uint32_t component = 0; component < fit.components; ++component) {
      NoiseTest noise;
      for (const NodeBox& row : rows) {
        noise.beginRow();
        for (const NodeBox& piece : piecesOf(row, ni)) {
          values.resize(piece.rowNodes(ni));
          file.read(b, component, piece, values);
          noise.add(values);
        }
      }
      if (const std::optional<double> example = noise.example())
        return fmt::format("many values of component {} of block {} are like {}", component + 1, b + 1,
                           *example);
    }
    if (!fit.layout.blanking) continue;
    for (const NodeBox& row : rows)
      for (const NodeBox& piece : piecesOf(row, ni)) {
        iblank.resize(piece.rowNodes(ni));
        file.readIblank(b, piece, iblank);
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
