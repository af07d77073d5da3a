// Reads nodes from a source and decides, for all of conversion, which of them are blanked: by the grid's own
// blanking, by `--blank VALUE`, or because a number is not finite.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "preprocess/grid/grid_source.h"

namespace curvisplat {

/// Describes the samples that BlankCounts::not_finite counts, for messages: coordinates are read in double
/// precision, values in single.
std::string notFiniteText(const GridDescription& description);

/// A number for telling samples apart by their positions.
uint64_t idOfPosition(double x, double y, double z);

/// Counts of blanked samples, by the reason.
struct BlankCounts {
  uint64_t by_grid = 0;     // iblank 0
  uint64_t by_value = 0;    // --blank
  uint64_t not_finite = 0;  // NaN or infinite coordinate, or scalar in single precision; not counted above
  /// Samples that have a value of a scalar, and are blanked since another scalar has none.
  struct Lost {
    uint64_t samples = 0;
    uint64_t set = 0;  // a sum over the samples: equal for scalars that lose the same
  };
  std::vector<Lost> lost;  // [scalar], or empty
  uint64_t total() const { return by_grid + by_value + not_finite; }
  BlankCounts& operator+=(const BlankCounts& other);
  /// Adds the scalars that have a value at a sample to `lost`, if some do and some do not. `id`: of the sample in the grid.
  void addLost(const std::vector<std::vector<float>>& scalars, size_t sample, uint64_t id,
               std::optional<double> blank_value);
};

/// The bits of NodeArrays::blank as a NodeReader of cell-centred scalars fills it: why the node is blanked,
/// and why the cell whose lowest node it is has no value.
enum CellMark : uint8_t {
  kNoNode = 1,          // the grid blanks the node, or its coordinates are not finite
  kNoValue = 2,         // NaN: there is no such cell, or the grid blanks it
  kBlankValue = 4,      // the cell's value is that of --blank
  kValueNotFinite = 8,  // the cell's value is infinite
};

/// Reads nodes and marks blanked ones. Any number of threads may read concurrently.
class NodeReader {
 public:
  /// `scalars`: indices into source.description().scalars. `source` must outlive the reader. Throws Error if
  /// node-centred and cell-centred scalars are mixed.
  NodeReader(const GridSource& source, std::vector<uint32_t> scalars, std::optional<double> blank_value);
  /// Blanks a sample only where none of the scalars has a value; where some have, the others are not finite: NaN
  /// replaces `blank_value`.
  static NodeReader ofAnyValue(const GridSource& source, std::vector<uint32_t> scalars,
                               std::optional<double> blank_value = std::nullopt) {
    NodeReader reader(source, std::move(scalars), blank_value);
    reader.of_any_value_ = true;
    return reader;
  }

  const GridSource& source() const { return *source_; }
  size_t scalars() const { return scalars_.size(); }
  std::optional<double> blankValue() const { return blank_value_; }
  /// The centring of all its scalars; kNode if there are none.
  Centring centring() const { return centring_; }

  /// Reads `box` of `block` and marks blanked nodes, whose values and coordinates are left as read. For
  /// cell-centred scalars `blank` holds CellMarks and nothing is counted, since whether a cell is blanked may
  /// depend on nodes outside the box.
  BlankCounts read(uint32_t block, const NodeBox& box, NodeArrays& out) const;

 private:
  const GridSource* source_;
  std::vector<uint32_t> scalars_;
  std::optional<double> blank_value_;
  bool of_any_value_ = false;
  Centring centring_;
};

}  // namespace curvisplat
