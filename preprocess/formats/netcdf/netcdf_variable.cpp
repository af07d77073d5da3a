#include "preprocess/formats/netcdf/netcdf_variable.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <string_view>
#include <utility>

#include "preprocess/formats/common/text_reader.h"
#include "preprocess/formats/netcdf/netcdf_library.h"
#include "stream/base/text.h"

namespace curvisplat {
namespace {

/// Attributes that are numbers by the conventions; some programs write them as text: missing_value = "-999".
constexpr std::string_view kNumericAttributes[] = {"_FillValue",  "missing_value", "scale_factor",
                                                   "add_offset",  "valid_min",     "valid_max",
                                                   "valid_range", "flag_values",   "start_index"};

/// Adds the numbers of a text that consists of numbers alone, separated by blanks or commas.
void addNumbersOfText(NetcdfAttribute& attribute) {
  std::string text = attribute.text;
  std::replace(text.begin(), text.end(), ',', ' ');
  std::vector<double> numbers;
  for (std::string_view word : wordsOf(text)) {
    double number = 0;
    if (word.ends_with('f') || word.ends_with('F')) word.remove_suffix(1);
    if (!parseNumber(word, number)) return;
    numbers.push_back(number);
  }
  attribute.numbers.insert(attribute.numbers.end(), numbers.begin(), numbers.end());
}

}  // namespace

void NetcdfVariable::add(const std::string& name_of_attribute, NetcdfAttribute attribute) {
  if (std::find(std::begin(kNumericAttributes), std::end(kNumericAttributes), name_of_attribute) !=
      std::end(kNumericAttributes))
    addNumbersOfText(attribute);
  attributes[name_of_attribute] = std::move(attribute);
}

std::string NetcdfVariable::text(const char* attribute) const {
  const auto found = attributes.find(attribute);
  return found == attributes.end() ? "" : std::string(trimmed(found->second.text));
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

namespace {

/// NetCDF's fill value for samples that were never written, unless the variable has its own. By convention
/// bytes have none, since all of their values are in use.
std::optional<double> defaultFill(nc_type type) {
  switch (type) {
    case NC_SHORT:
      return NC_FILL_SHORT;
    case NC_USHORT:
      return NC_FILL_USHORT;
    case NC_INT:
      return NC_FILL_INT;
    case NC_UINT:
      return NC_FILL_UINT;
    case NC_FLOAT:
      return NC_FILL_FLOAT;
    case NC_DOUBLE:
      return NC_FILL_DOUBLE;
    case NC_INT64:
      return static_cast<double>(NC_FILL_INT64);
    case NC_UINT64:
      return static_cast<double>(NC_FILL_UINT64);
    default:
      return std::nullopt;
  }
}

bool isReal(nc_type type) {
  return type == NC_FLOAT || type == NC_DOUBLE;
}

}  // namespace

NetcdfPacking::NetcdfPacking(const NetcdfVariable& variable) {
  const auto first = [&](const char* attribute, double otherwise) {
    const std::vector<double>& numbers = variable.numbers(attribute);
    return numbers.empty() ? otherwise : numbers[0];
  };
  scale_ = first("scale_factor", 1);
  offset_ = first("add_offset", 0);
  setWrap(variable);
  for (const char* attribute : {"_FillValue", "missing_value"})
    for (const double value : variable.numbers(attribute)) missing_.push_back(wrapped(value));
  if (variable.numbers("_FillValue").empty())
    if (const auto fill = defaultFill(variable.type)) missing_.push_back(wrapped(*fill));
  addRange(variable);
}

/// Source: NetCDF User's Guide, appendix A, _Unsigned.
void NetcdfPacking::setWrap(const NetcdfVariable& variable) {
  if (netcdfBytes(variable.type) == 0 || isReal(variable.type)) return;
  const std::string word = variable.text("_Unsigned");
  const bool has_sign = variable.type == NC_BYTE || variable.type == NC_SHORT || variable.type == NC_INT ||
                        variable.type == NC_INT64;
  if (!(has_sign ? word == "true" || word == "True" : word == "false" || word == "False")) return;
  const double all = std::ldexp(1.0, static_cast<int>(8 * netcdfBytes(variable.type)));
  wraps_at_ = has_sign ? 0 : all / 2;
  wraps_by_ = has_sign ? all : -all;
}

double NetcdfPacking::wrapped(double value) const {
  if (wraps_by_ == 0) return value;
  return (value < wraps_at_) == (wraps_by_ > 0) ? value + wraps_by_ : value;
}

/// Adds a valid range. NetCDF's conventions have it in stored units, unless it has the type of scale_factor
/// and add_offset (the wider of the two) and that is wider than the variable's: then it is in unpacked units.
/// Such a range is converted to stored units here.
/// Source: NetCDF User's Guide, appendix A, valid_range.
void NetcdfPacking::addRange(const NetcdfVariable& variable) {
  nc_type unpacked = NC_NAT;
  for (const char* attribute : {"scale_factor", "add_offset"}) {
    const auto found = variable.attributes.find(attribute);
    if (found == variable.attributes.end() || found->second.numbers.empty()) continue;
    if (netcdfBytes(found->second.type) > netcdfBytes(unpacked)) unpacked = found->second.type;
  }
  const bool widens =
      isReal(unpacked) && (!isReal(variable.type) || netcdfBytes(unpacked) > netcdfBytes(variable.type));
  // A stored integer stands for values half a step to either side, which absorbs the rounding of the factor.
  const double half_step = isReal(variable.type) ? 0 : 0.5;

  const auto bound = [&](const char* attribute, size_t size, size_t n, bool upper) {
    const auto found = variable.attributes.find(attribute);
    if (found == variable.attributes.end() || found->second.numbers.size() != size) return;
    const double value = found->second.numbers[n];
    if (std::isnan(value)) return;  // nothing is beyond it
    const bool convert = widens && found->second.type == unpacked;
    if (convert && !(std::isfinite(scale_) && scale_ != 0 && std::isfinite(offset_))) return;
    const bool stored_upper = upper != (convert && scale_ < 0);
    const double stored = convert ? (value - offset_) / scale_ : wrapped(value);
    if (stored_upper)
      most_ = stored + (convert ? half_step : 0);
    else
      least_ = stored - (convert ? half_step : 0);
    range_ += fmt::format("{}{} {} {:g}{}", range_.empty() ? "" : " or ", upper ? "above" : "below",
                          attribute, value, convert ? " after unpacking" : "");
  };
  bound("valid_range", 2, 0, false);
  bound("valid_range", 2, 1, true);
  bound("valid_min", 1, 0, false);
  bound("valid_max", 1, 0, true);
}

std::string NetcdfPacking::missingValues() const {
  std::string words = range_;
  std::vector<std::string> values;  // as _FillValue and missing_value are often the same
  for (const double missing : missing_)
    if (std::string value = numberText(missing);
        std::find(values.begin(), values.end(), value) == values.end())
      values.push_back(std::move(value));
  if (!values.empty())
    words += fmt::format("{}equal to {}", words.empty() ? "" : " or ", fmt::join(values, " or "));
  return words;
}

template <typename Value>
void NetcdfPacking::unpackAll(std::span<Value> values) const {
  constexpr Value kNone = std::numeric_limits<Value>::quiet_NaN();
  if (wraps_by_ != 0)
    for (Value& value : values) value = static_cast<Value>(wrapped(static_cast<double>(value)));
  for (const double missing : missing_) {
    const auto wanted = static_cast<Value>(missing);
    for (Value& value : values)
      if (value == wanted) value = kNone;
  }
  if (least_)
    for (Value& value : values)
      if (value < static_cast<Value>(*least_)) value = kNone;
  if (most_)
    for (Value& value : values)
      if (value > static_cast<Value>(*most_)) value = kNone;
  if (scale_ == 1 && offset_ == 0) return;
  for (Value& value : values) value = static_cast<Value>(static_cast<double>(value) * scale_ + offset_);
}

void NetcdfPacking::unpack(std::span<float> values) const {
  unpackAll(values);
}

void NetcdfPacking::unpack(std::span<double> values) const {
  unpackAll(values);
}

}  // namespace curvisplat
