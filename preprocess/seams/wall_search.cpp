#include "preprocess/seams/wall_search.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <limits>
#include <optional>
#include <span>
#include <utility>

#include "preprocess/coincidence/record_sorter.h"
#include "preprocess/grid/slabs.h"
#include "preprocess/seams/thin_walls.h"
#include "stream/base/error.h"
#include "stream/base/trace.h"

namespace curvisplat {
namespace {

constexpr double kRounding =
    1e-6;  // of a scalar's largest value: values stored in single precision agree to this
constexpr size_t kMaxScalars = 16;             // of those that decide
constexpr size_t kMaxNodes = size_t{1} << 19;  // on walls: they take 150 bytes each
constexpr size_t kKeySize = 3;                 // of a record
constexpr uint64_t kMaxBoxNodes = 65536, kFewNodes = 4096, kMaxSparse = 8;  // of what is read at a time

/// Whether a scalar, which need not be one that is converted, can be read at all.
bool isReadable(const GridSource& grid, uint32_t scalar) {
  NodeArrays nodes;
  const std::array<uint32_t, 1> scalars{scalar};
  try {
    readBox(grid, 0, {0, 1, 0, 1, 0, 1}, scalars, nodes);
    return true;
  } catch (const Interrupted&) {
    throw;
  } catch (const OutputError&) {
    throw;
  } catch (const Error&) {
    return false;
  }
}

/// The stored scalars at nodes; magnitudes follow from their components.
std::vector<uint32_t> decidingScalars(const GridSource& source) {
  const GridDescription& grid = source.description();
  std::vector<uint32_t> scalars;
  if (grid.globe) return scalars;
  for (uint32_t n = 0; n < grid.scalars.size() && scalars.size() < kMaxScalars; ++n) {
    const GridScalar& scalar = grid.scalars[n];
    if (scalar.centring == Centring::kNode && !scalar.derived && !scalar.name.ends_with(":mag") &&
        isReadable(source, n))
      scalars.push_back(n);
  }
  return scalars;
}

/// A node of the grid by its indices.
struct Place {
  uint32_t block = 0;
  std::array<uint64_t, 3> at{};  // i, j, k
};

/// Blocks one after the other in the order of node numbers.
class Numbering {
 public:
  explicit Numbering(std::span<const GridBlock> blocks) : blocks_(blocks) {
    uint64_t node = 0;
    for (const GridBlock& block : blocks) first_.push_back(std::exchange(node, node + block.nodes()));
  }
  Place placeOf(uint64_t node) const {
    const auto block =
        static_cast<size_t>(std::upper_bound(first_.begin(), first_.end(), node) - first_.begin() - 1);
    const uint64_t in_block = node - first_[block], row = in_block / blocks_[block].ni;
    return {static_cast<uint32_t>(block),
            {in_block % blocks_[block].ni, row % blocks_[block].nj, row / blocks_[block].nj}};
  }
  /// A number for the face of the block that the node is on: nodes of one face are read together. Whole rows come first.
  double faceOf(uint64_t node) const {
    const Place place = placeOf(node);
    const GridBlock& block = blocks_[place.block];
    const std::array<uint64_t, 3> count{block.ni, block.nj, block.nk};
    for (const size_t axis : {2u, 1u, 0u})
      for (const bool upper : {false, true})
        if (place.at[axis] == (upper ? count[axis] - 1 : 0))
          return 6.0 * place.block + 2 * double(axis) + upper;
    return 6.0 * place.block;
  }

 private:
  std::span<const GridBlock> blocks_;
  std::vector<uint64_t> first_;
};

/// The values of a scalar: their range, where halves meet and in some rows, and from these rows their median and spread.
class ScalarExtent {
 public:
  explicit ScalarExtent(std::optional<double> blank_value) : blank_value_(blank_value) {}
  void add(double value) {
    if (isBlank(value)) return;
    numbers_things_ = numbers_things_ && value == std::floor(value);
    least_ = std::min(least_, value);
    most_ = std::max(most_, value);
  }
  void addToSample(double value) {
    add(value);
    if (!isBlank(value)) sample_.push_back(value);
  }
  /// Call it once, after all values.
  void finish() {
    if (sample_.empty()) return;
    std::sort(sample_.begin(), sample_.end());
    const auto at = [&](double share) {
      return sample_[static_cast<size_t>(share * static_cast<double>(sample_.size() - 1))];
    };
    median_ = at(0.5);
    spread_ = at(1 - kTail) - at(kTail);
    sample_ = {};
  }
  bool differ(double a, double b) const {
    if (numbers_things_ || isBlank(a) || isBlank(b)) return false;
    const double scale = spread_ + std::max(std::abs(a - median_), std::abs(b - median_));
    return std::abs(a - b) > std::max({kWallShare * scale, kNoise * (most_ - least_),
                                       kRounding * std::max(std::abs(least_), std::abs(most_))});
  }

 private:
  bool isBlank(double value) const {
    return !std::isfinite(value) || (blank_value_ && value == double(float(*blank_value_)));
  }

  static constexpr double kTail = 0.05, kNoise = 1e-4;
  std::optional<double> blank_value_;
  bool numbers_things_ = true;  // all values are whole: numbers of blocks, of processes, of nodes
  double least_ = std::numeric_limits<double>::infinity(), most_ = -std::numeric_limits<double>::infinity();
  double median_ = 0, spread_ = 0;
  std::vector<double> sample_;
};

class WallSearch {
 public:
  WallSearch(const GridSource& grid, std::vector<uint32_t> scalars, std::optional<double> blank_value,
             const WallSearchMemory& memory, const Progress& progress)
      : grid_(grid),
        progress_(progress),
        scalars_(std::move(scalars)),
        numbering_(grid.description().blocks),
        asked_(kKeySize, memory.bytes / 4, memory.temporary_folder),
        values_(kKeySize + scalars_.size(), memory.bytes / 2, memory.temporary_folder),
        extents_(scalars_.size(), ScalarExtent(blank_value)) {}

  /// Adds nodes at one position. Any thread.
  void add(std::span<const uint64_t> nodes) {
    const uint64_t set = *std::min_element(nodes.begin(), nodes.end());
    std::vector<double> records(kKeySize * nodes.size());
    for (size_t n = 0; n < nodes.size(); ++n)
      RecordSorter::setKey(&records[kKeySize * n], numbering_.faceOf(nodes[n]), static_cast<double>(set),
                           nodes[n]);
    asked_.add(records);
  }

  std::vector<WallNode> finish() {
    const TraceScope trace("find thin walls");
    asked_.drain([&](const double* record) {
      const uint64_t node = RecordSorter::numberOf(record);
      ask({node, RecordSorter::acrossOf(record)}, RecordSorter::alongOf(record));
    });
    readAsked();
    if (are_asked_) sampleRows();
    std::vector<WallNode> found;
    values_.drain([&](const double* record) {
      if (!set_.empty() && set_.front() != RecordSorter::alongOf(record)) divide(found);
      set_.insert(set_.end(), record, record + kKeySize + scalars_.size());
    });
    divide(found);
    std::sort(found.begin(), found.end(),
              [](const WallNode& a, const WallNode& b) { return a.node < b.node; });
    return found;
  }

 private:
  struct Asked {
    uint64_t node;
    double set;
  };

  /// Adds a node to those that are read next, after reading these if it is too far from them.
  void ask(const Asked& next, double face) {
    const Place place = numbering_.placeOf(next.node);
    const auto [i, j, k] = place.at;
    NodeBox grown = box_;
    if (!pending_.empty() && face == face_)
      grown = {std::min(box_.j0, j),     std::max(box_.j1, j + 1), std::min(box_.k0, k),
               std::max(box_.k1, k + 1), std::min(box_.i0, i),     std::max(box_.i1, i + 1)};
    const uint64_t nodes = rowsOf(grown) * (grown.i1 - grown.i0);
    const bool fits = !pending_.empty() && face == face_ && nodes <= kMaxBoxNodes &&
                      (nodes <= kFewNodes || nodes <= kMaxSparse * (pending_.size() + 1));
    if (!fits) {
      readAsked();
      grown = {j, j + 1, k, k + 1, i, i + 1};
    }
    box_ = grown;
    block_ = place.block;
    face_ = face;
    pending_.push_back(next);
    are_asked_ = true;
  }

  void readAsked() {
    if (pending_.empty()) return;
    progress_.throwIfStopped();
    readBox(grid_, block_, box_, scalars_, nodes_);
    const WindowStrides strides(box_, grid_.description().blocks[block_].ni);
    std::vector<double> record(kKeySize + scalars_.size());
    for (const Asked& asked : pending_) {
      const auto [i, j, k] = numbering_.placeOf(asked.node).at;
      const size_t at = strides.at(i, j, k);
      RecordSorter::setKey(record.data(), asked.set, 0, asked.node);
      for (size_t n = 0; n < scalars_.size(); ++n) {
        record[kKeySize + n] = static_cast<double>(nodes_.scalars[n][at]);
        extents_[n].add(record[kKeySize + n]);
      }
      values_.add(record);
    }
    pending_.clear();
  }

  /// Adds the values of some rows to the extents: where halves meet, a scalar may be nearly even, and its noise
  /// would be most of its range there.
  void sampleRows() {
    constexpr uint64_t kRows = 8, kMaxRows = 1024, kAcross = 3, kMaxOfRow = 256;
    const std::vector<GridBlock>& blocks = grid_.description().blocks;
    for (size_t block = 0; block < blocks.size(); block += blocks.size() * kRows / kMaxRows + 1)
      for (uint64_t row = 0; row < kRows; ++row) {
        progress_.throwIfStopped();
        const auto& [name, ni, nj, nk, has_blanking] = blocks[block];
        const uint64_t j = row * (nj - 1) / (kRows - 1), k = row * kAcross % kRows * (nk - 1) / (kRows - 1);
        const NodeBox box{j, j + 1, k, k + 1, 0, std::min(ni, kMaxBoxNodes)};
        readBox(grid_, static_cast<uint32_t>(block), box, scalars_, nodes_);
        for (size_t n = 0; n < scalars_.size(); ++n)
          for (size_t at = 0; at < nodes_.blank.size(); at += nodes_.blank.size() / kMaxOfRow + 1)
            if (!nodes_.blank[at]) extents_[n].addToSample(static_cast<double>(nodes_.scalars[n][at]));
      }
    for (ScalarExtent& extent : extents_) extent.finish();
  }

  /// Whether two records of a set have other values.
  bool differ(const double* a, const double* b) const {
    for (size_t n = 0; n < scalars_.size(); ++n)
      if (extents_[n].differ(a[kKeySize + n], b[kKeySize + n])) return true;
    return false;
  }

  /// Gives the nodes of a set sides: each lies with the first before it that has its values.
  void divide(std::vector<WallNode>& found) {
    std::vector<const double*> first_of_side;
    for (size_t at = 0; at < set_.size(); at += kKeySize + scalars_.size()) {
      const double* const record = &set_[at];
      const auto like = std::find_if(first_of_side.begin(), first_of_side.end(),
                                     [&](const double* first) { return !differ(first, record); });
      const auto side = static_cast<uint32_t>(like - first_of_side.begin());
      if (like == first_of_side.end()) first_of_side.push_back(record);
      if (side > 0 && found.size() <= kMaxNodes) found.push_back({RecordSorter::numberOf(record), side});
    }
    set_.clear();
  }

  const GridSource& grid_;
  const Progress& progress_;
  const std::vector<uint32_t> scalars_;
  const Numbering numbering_;
  RecordSorter asked_, values_;  // along: the face; the set. Across: the set; nothing
  std::vector<ScalarExtent> extents_;
  std::vector<Asked> pending_;
  bool are_asked_ = false;
  uint32_t block_ = 0;
  double face_ = 0;
  NodeBox box_;
  NodeArrays nodes_;
  std::vector<double> set_;  // records of one set
};

}  // namespace

FoundWalls findThinWalls(SeamMerger& seams, const NodeReader& reader, const WallSearchMemory& memory,
                         const Progress& progress) {
  const GridSource& grid = reader.source();
  std::vector<uint32_t> scalars = decidingScalars(grid);
  if (scalars.empty()) return {};
  WallSearch search(grid, std::move(scalars), reader.blankValue(), memory, progress);
  seams.forEachJoint(grid.description().coordinate_bytes,
                     [&](std::span<const uint64_t> nodes) { search.add(nodes); });
  const std::vector<WallNode> nodes = search.finish();
  if (nodes.size() > kMaxNodes) return {{}, true};
  return {wallSidesOf(nodes, grid.description().blocks), false};
}

uint64_t countMissing(std::span<const WallSide> boxes, std::span<const GridBlock> blocks,
                      const ThinWalls& others) {
  uint64_t missing = 0;
  for (const WallSide& box : boxes) {
    uint64_t first_node = 0;
    for (uint32_t block = 0; block < box.block; ++block) first_node += blocks[block].nodes();
    const GridBlock& block = blocks[box.block];
    for (uint64_t k = box.first[2]; k <= box.last[2]; ++k)
      for (uint64_t j = box.first[1]; j <= box.last[1]; ++j)
        for (uint64_t i = box.first[0]; i <= box.last[0]; ++i)
          missing += others.sideOf(first_node + (k * block.nj + j) * block.ni + i) == 0;
  }
  return missing;
}

}  // namespace curvisplat
