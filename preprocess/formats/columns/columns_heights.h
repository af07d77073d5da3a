// Heights of the levels of columns (columns_layout.h). They are the same everywhere, stored for every face or
// node, computed from formula_terms, or added up from the thicknesses of layers.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "preprocess/formats/columns/columns_layout.h"
#include "preprocess/formats/netcdf/cf_term.h"
#include "preprocess/formats/netcdf/cf_vertical.h"
#include "preprocess/formats/netcdf/netcdf_files.h"

namespace curvisplat {

/// Heights in kilometres, upwards positive. Where `levels` is empty they differ between columns, and are read
/// by ColumnsHeightsReader.
struct ColumnsHeights {
  std::vector<double> levels;         // heights that are the same everywhere; empty: see above
  bool of_nodes = false;              // the columns are nodes; false: faces
  std::optional<CfTerm> stored;       // heights, or thicknesses of layers
  double scale = 1;                   // converts `stored` to kilometres upwards
  std::optional<CfVertical> formula;  // in place of `stored`
  bool middles = false;               // the values are of the layers' middles, between the levels
  bool thickness = false;             // `stored` has thicknesses of layers, the first of which is the highest
  std::optional<CfTerm> surface;      // the height of the first layer's top, before `scale`; none: 0
  uint64_t count = 0;                 // number of levels or middles
  std::string words;                  // what they are read from, for messages: "zgrid"
};

/// Finds the levels of the heights: for scalars in cells those between which their layers lie; for scalars at
/// nodes those of the values. `step`: the time step of heights that depend on the time. Throws Error if the
/// layers have no heights.
ColumnsHeights findColumnsHeights(const NetcdfFiles& file, const ColumnsMap& map,
                                  const ColumnsScalars& scalars, size_t step = 0);

/// Whether name and attributes of a variable on layers tell that it holds their heights.
bool isHeightsOfColumns(const NetcdfFiles& file, const NetcdfVariable& variable);

/// Whether it holds the thicknesses of layers.
bool isThicknessOfColumns(const NetcdfVariable& variable);

/// Reads heights that differ between columns. For one thread.
class ColumnsHeightsReader {
 public:
  /// Both must outlive the reader.
  ColumnsHeightsReader(const NetcdfFiles& file, const ColumnsHeights& heights)
      : file_(file), heights_(heights) {}

  /// Heights in kilometres of the columns [first, first + count) at a level, NaN where there is none. Each
  /// level of the same columns must be read once, in order.
  std::vector<double> read(uint64_t first, uint64_t count, uint64_t level);

 private:
  /// Values of the levels or middles [level, level + levels), column by column.
  std::vector<double> stored(uint64_t first, uint64_t count, uint64_t level, uint64_t levels) const;

  const NetcdfFiles& file_;
  const ColumnsHeights& heights_;
  std::vector<double> above_;  // [column]: the level read last, of thicknesses
};

}  // namespace curvisplat
