// What a NetCDF file says of its dimensions, variables and attributes.
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
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
  bool numeric = false;      // neither text nor a user-defined type
  std::vector<size_t> dims;  // indices into NetcdfFile::dimensions(), slowest first
  std::map<std::string, NetcdfAttribute> attributes;

  /// The text of an attribute; empty if there is none.
  std::string text(const char* attribute) const;
  /// The numbers of an attribute; none if it is not there, or text.
  const std::vector<double>& numbers(const char* attribute) const;
};

/// The size of a stored number of an nc_type; 0 of text and user-defined types.
size_t netcdfBytes(int type);

}  // namespace curvisplat
