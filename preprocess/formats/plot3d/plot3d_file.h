// Reads the values of a PLOT3D file whose layout is known.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "preprocess/formats/plot3d/plot3d_fit.h"
#include "preprocess/grid/grid_source.h"

namespace curvisplat {

/// Any number of threads may read concurrently. Reads exactly the requested bytes: one range per component if
/// the box has all j of the block, else one range for each k, or for each row where the box has parts of rows. Needs a
/// buffer of 256 KiB per thread.
class Plot3dFile {
 public:
  explicit Plot3dFile(Plot3dFit fit) : fit_(std::move(fit)) {}

  const Plot3dLayout& layout() const { return fit_.layout; }
  const std::vector<Plot3dBlock>& blocks() const { return fit_.blocks; }
  uint32_t components() const { return fit_.components; }
  uint64_t trailingBytes() const { return fit_.trailing_bytes; }

  /// Reads one component in `box`, i fastest, to out[0 .. nodes of the box). Throws Error with the file and
  /// the offset.
  void read(uint32_t block, uint32_t component, const NodeBox& box, std::span<double> out) const;
  void read(uint32_t block, uint32_t component, const NodeBox& box, std::span<float> out) const;
  /// Writes 1 where iblank is 0, else 0: nodes with any other iblank, even negative, are drawn. Only for
  /// layouts with blanking.
  void readBlank(uint32_t block, const NodeBox& box, std::span<uint8_t> out) const;
  /// The stored iblank values, for statistics and plausibility.
  void readIblank(uint32_t block, const NodeBox& box, std::span<int32_t> out) const;
  /// Mach number, alpha, Reynolds number and time of a Q file (OVERFLOW's too), without the name of the file.
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
  return box.rowNodes(block.ni) * (box.j1 - box.j0) * (box.k1 - box.k0);
}

}  // namespace curvisplat
