// How the stored numbers of a NetCDF variable become values: unpacked, with NaN for missing ones.
// Source: NetCDF User's Guide, appendix A, attribute conventions.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "preprocess/formats/netcdf/netcdf_variable.h"

namespace curvisplat {

/// Immutable; any thread.
class NetcdfPacking {
 public:
  explicit NetcdfPacking(const NetcdfVariable& variable);

  /// Stored numbers to values: times scale_factor, plus add_offset. NaN where the stored number is _FillValue (or NetCDF's default
  /// fill value), missing_value, or outside the valid range.
  void unpack(std::span<float> values) const;
  void unpack(std::span<double> values) const;
  /// Which stored numbers become NaN, in words; empty if none.
  std::string missingValues() const;

 private:
  void setWrap(const NetcdfVariable& variable);
  void addRange(const NetcdfVariable& variable);
  double wrapped(double value) const;
  template <typename Value>
  void unpackAll(std::span<Value> values) const;

  double scale_ = 1, offset_ = 0;
  /// Integers from this one on stand for others (`_Unsigned`): the classic format has none without a sign.
  double wraps_at_ = 0, wraps_by_ = 0;
  std::vector<double> missing_;         // as stored, wrapped
  std::optional<double> least_, most_;  // as stored, wrapped
  std::string range_;                   // the same in words
};

}  // namespace curvisplat
