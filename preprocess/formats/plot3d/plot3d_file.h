// Reads the values of a PLOT3D file whose layout is known.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "preprocess/formats/plot3d/plot3d_fit.h"
#include "preprocess/grid/grid_source.h"

namespace curvisplat {

/// Any number of threads may read at once. Reads exactly the bytes asked for: one range a component if all j
/// of the block are in the box, else one range for each k. Costs a buffer of 256 KiB a thread.
class Plot3dFile {
 public:
  explicit Plot3dFile(Plot3dFit fit) : fit_(std::move(fit)) {}

  const Plot3dLayout& layout() const { return fit_.layout; }
  const std::vector<Plot3dBlock>& blocks() const { return fit_.blocks; }
  uint32_t components() const { return fit_.components; }
  uint64_t trailingBytes() const { return fit_.trailing_bytes; }

  /// Values of one component in `box`, i fastest: overwrites out[0 .. nodes of the box). Throws Error naming
  /// the file and the offset.
  void read(uint32_t block, uint32_t component, const NodeBox& box, std::span<double> out) const;
  void read(uint32_t block, uint32_t component, const NodeBox& box, std::span<float> out) const;
  /// 1 where iblank is 0; every other value of iblank, negative ones too, is drawn. The layout has blanking.
  void readBlank(uint32_t block, const NodeBox& box, std::span<uint8_t> out) const;
  /// The iblank values as they are. For statistics and plausibility.
  void readIblank(uint32_t block, const NodeBox& box, std::span<int32_t> out) const;
  /// Mach, alpha, Reynolds number and time of a Q file (OVERFLOW's too), without the file's name.
  FlowConditions conditions(uint32_t block) const;
  uint32_t species() const { return fit_.species; }
  /// Ratio of specific heats of the freestream in an OVERFLOW file.
  double freestreamGamma() const;

 private:
  std::vector<double> parameters(uint32_t block) const;
  template <typename Convert>
  void readRanges(uint32_t block, const NodeBox& box, uint64_t array_offset, uint64_t width,
                  const Convert& convert) const;
  template <typename Value>
  void readValues(uint32_t block, uint32_t component, const NodeBox& box, std::span<Value> out) const;
  template <typename Value>
  void readIntegers(uint32_t block, const NodeBox& box, std::span<Value> out) const;

  Plot3dFit fit_;
};

inline uint64_t nodesOf(const GridBlock& block, const NodeBox& box) {
  return block.ni * (box.j1 - box.j0) * (box.k1 - box.k0);
}

}  // namespace curvisplat
