#include "preprocess/formats/netcdf/netcdf_variable.h"

#include <netcdf.h>

namespace curvisplat {

std::string NetcdfVariable::text(const char* attribute) const {
  const auto found = attributes.find(attribute);
  return found == attributes.end() ? "" : found->second.text;
}

const std::vector<double>& NetcdfVariable::numbers(const char* attribute) const {
  static const std::vector<double> none;
  const auto found = attributes.find(attribute);
  return found == attributes.end() ? none : found->second.numbers;
}

size_t netcdfBytes(int type) {
  switch (type) {
    case NC_BYTE:
    case NC_UBYTE:
      return 1;
    case NC_SHORT:
    case NC_USHORT:
      return 2;
    case NC_INT:
    case NC_UINT:
    case NC_FLOAT:
      return 4;
    case NC_INT64:
    case NC_UINT64:
    case NC_DOUBLE:
      return 8;
    default:
      return 0;
  }
}

}  // namespace curvisplat
