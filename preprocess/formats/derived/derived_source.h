// Scalars that no file holds: what the flow's density, momentum and energy (or velocity and pressure) give,
// and what the grid itself gives. Added to any source, behind its own scalars.
//
//    source ──read box + halo, in pieces──> flow at each node ──gradients by the grid's Jacobian──> quantity
//
// Derivatives are central, one-sided at a block's ends and beside nodes that are not there. Memory: a piece
// of some 48 thousand nodes a reading thread, whatever is asked for.
#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "preprocess/formats/derived/flow_window.h"
#include "preprocess/grid/grid_source.h"

namespace curvisplat {

struct DerivedOptions {
  GasModel gas;                       // over what the files tell, and 1.4 and 1 if nobody does
  std::optional<double> blank_value;  // a scalar with this value has none
};

class DerivedSource final : public GridSource {
 public:
  /// Throws UsageError for a gas that there is not.
  DerivedSource(std::unique_ptr<GridSource> source, const DerivedOptions& options);

  const GridDescription& description() const override { return description_; }
  void read(uint32_t block, const NodeBox& box, std::span<const uint32_t> scalars,
            NodeArrays& out) const override;

 private:
  void findInputs();
  void describe();
  bool offers(const QuantityInfo& quantity) const;

  std::unique_ptr<GridSource> source_;
  GridDescription description_;
  PerfectGas gas_;
  std::optional<float> blank_value_;
  FlowInputs inputs_;
  std::vector<double> freestream_mach_;   // [block]; 0: not known
  std::vector<QuantityInfo> quantities_;  // of the scalars behind the source's own
};

}  // namespace curvisplat
