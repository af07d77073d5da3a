// Scalars that no file holds: computed from density, momentum and energy (or velocity and pressure), or from
// the grid alone. Decorates any source; derived scalars follow its own.
//
//    source ──box + halo, in pieces──> flow at each sample ──gradients by the grid's Jacobian──> quantity
//
// Differences are central, and one-sided at the ends of a block and next to blanked samples. Memory: one
// piece of about 48,000 nodes for each reading thread, whatever the size of the request.
#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "preprocess/formats/derived/flow_inputs.h"
#include "preprocess/formats/derived/flow_window.h"
#include "preprocess/grid/grid_source.h"

namespace curvisplat {

class DerivedSource final : public GridSource {
 public:
  /// Throws UsageError if gamma or the gas constant is out of range.
  DerivedSource(std::unique_ptr<GridSource> source, const DerivedOptions& options);

  const GridDescription& description() const override { return description_; }
  void read(uint32_t block, const NodeBox& box, std::span<const uint32_t> scalars,
            NodeArrays& out) const override;
  void readPartOfRows(uint32_t block, const NodeBox& box, std::span<const uint32_t> scalars,
                      NodeArrays& out) const override {
    read(block, box, scalars, out);
  }
  uint64_t rowsInMemory(std::span<const uint32_t> scalars) const override;
  bool readFringe(uint32_t block, const NodeBox& box, std::vector<uint8_t>& out) const override;

 private:
  /// Of the source, what the scalars are read or computed from.
  std::vector<uint32_t> inputsOf(std::span<const uint32_t> scalars) const;
  void describe();
  bool offers(const QuantityInfo& quantity) const;

  std::unique_ptr<GridSource> source_;
  GridDescription description_;
  PerfectGas gas_;
  std::optional<float> blank_value_;
  FlowInputs inputs_;
  std::vector<double> freestream_mach_;   // [block]; 0: unknown
  std::vector<QuantityInfo> quantities_;  // of the derived scalars, in order
};

}  // namespace curvisplat
