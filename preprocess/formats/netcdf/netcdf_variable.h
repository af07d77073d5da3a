// The metadata of a NetCDF file: dimensions, variables and attributes; and NetcdfPacking, which turns the
// stored numbers of a variable into values. Nothing here reads the file or calls libnetcdf, so any thread
// may use it without a lock.
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace curvisplat {

struct NetcdfDimension {
  std::string name;
  uint64_t length = 0;
  bool unlimited = false;
};

/// An attribute is text or a list of numbers.
struct NetcdfAttribute {
  std::string text;
  std::vector<double> numbers;
  int type = 0;  // as stored, an nc_type
};

struct NetcdfVariable {
  std::string name;
  int id = 0;
  size_t file = 0;           // index into the files of a NetcdfFiles
  size_t position = 0;       // index into its NetcdfFile::variables()
  int type = 0;              // as stored, an nc_type
  size_t value_bytes = 0;    // size of a stored value
  bool numeric = false;      // neither text nor a user-defined type, nor f(x, x)
  std::vector<size_t> dims;  // indices into NetcdfFile::dimensions(), slowest first
  std::map<std::string, NetcdfAttribute> attributes;

  /// Adds or replaces an attribute. Numbers that some programs write as text are numbers: missing_value = "-999".
  void add(const std::string& name_of_attribute, NetcdfAttribute attribute);
  /// The text of an attribute without the blanks that Fortran pads it with; empty if there is none.
  std::string text(const char* attribute) const;
  /// The numbers of an attribute; none if it is not there, or text.
  const std::vector<double>& numbers(const char* attribute) const;
};

/// The size of a stored number of an nc_type; 0 of text and user-defined types.
size_t netcdfBytes(int type);

/// How the stored numbers of a variable become values: they are unpacked, and missing ones become NaN.
/// Immutable; any thread may use it.
/// Source: NetCDF User's Guide, appendix A, attribute conventions.
class NetcdfPacking {
 public:
  explicit NetcdfPacking(const NetcdfVariable& variable);

  /// Turns stored numbers into values in place: times scale_factor, plus add_offset. A number becomes NaN if
  /// it is _FillValue (or NetCDF's default fill value), missing_value, or outside the valid range.
  void unpack(std::span<float> values) const;
  void unpack(std::span<double> values) const;
  /// Describes the stored numbers that become NaN; empty if none.
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
