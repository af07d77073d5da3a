// A NetCDF variable seen from the nodes of a block: along which of the block's axes it varies, and its values
// there. One that stands on the points beside the block's nodes, as on a staggered grid, is taken half-way
// between them.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "preprocess/formats/netcdf/netcdf_file.h"

namespace curvisplat {

/// Some nodes of a block: half-open ranges along i, j, k.
struct CfRange {
  std::array<uint64_t, 3> begin{}, end{};
};

/// What was read of a term: along an axis that it does not vary along it has one value.
struct CfValues {
  std::array<uint64_t, 3> count{1, 1, 1};
  std::vector<double> values;
  double at(uint64_t i, uint64_t j, uint64_t k) const {
    const uint64_t n =
        (count[0] > 1 ? i : 0) + count[0] * ((count[1] > 1 ? j : 0) + count[1] * (count[2] > 1 ? k : 0));
    return values[n];
  }
};

/// The block's dimensions in the file, along i, j, k, and that of time.
struct CfDimensions {
  std::array<size_t, 3> axes{};
  std::optional<size_t> time;
  size_t time_step = 0;
};

class CfTerm {
 public:
  /// Nothing if the variable has a dimension that is none of the block's and does not fit in between: it must
  /// be as long as the block's in the same place, counted from the last, one longer (the block's nodes are
  /// between its points) or one shorter (its points are between the block's nodes, the outer of which are
  /// extrapolated to). A dimension of length 1 is passed over.
  static std::optional<CfTerm> of(const NetcdfFile& file, const NetcdfVariable& variable,
                                  const CfDimensions& block);

  const NetcdfVariable& variable() const { return *variable_; }
  bool varies(size_t axis) const { return along_[axis].has_value(); }
  /// All of its dimensions are the block's own.
  bool exact() const { return exact_; }
  size_t axes() const { return varies(0) + varies(1) + varies(2); }

  /// It has a value for each node, in the nodes' order, i fastest.
  bool ofNodes() const;
  NetcdfBox boxOf(const CfRange& range) const;  // that the values of `range` are made of

  CfValues read(const NetcdfFile& file, const CfRange& range) const;

 private:
  const NetcdfVariable* variable_ = nullptr;
  std::array<std::optional<size_t>, 3> along_;  // its dimension along the block's axis
  std::array<int, 3> longer_{};                 // by how many it is, there
  std::array<uint64_t, 3> length_{};            // of it, there
  bool exact_ = true;
  std::vector<size_t> start_;  // the time step, where it has one; 0
};

}  // namespace curvisplat
