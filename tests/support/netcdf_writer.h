// Writes small NetCDF files: dimensions, variables with attributes, and values that a function of the indices
// gives.
#pragma once

#include <cstddef>
#include <filesystem>
#include <functional>
#include <string>
#include <utility>
#include <variant>
#include <vector>

namespace curvisplat {

enum class NetcdfFileType { kClassic, kNetcdf4, kNetcdf4Compressed };
enum class NetcdfNumbers { kInt16, kInt32, kSinglePrecision, kDoublePrecision };

using NetcdfText = std::string;
using NetcdfNumberList = std::vector<double>;  // written in the type of the variable
struct NetcdfDoubleList {                      // written as doubles
  std::vector<double> values;
};
using NetcdfAttributes =
    std::vector<std::pair<std::string, std::variant<NetcdfText, NetcdfNumberList, NetcdfDoubleList>>>;
/// A function of the indices along the variable's dimensions, the slowest first.
using NetcdfFunction = std::function<double(const std::vector<size_t>&)>;

class NetcdfWriter {
 public:
  NetcdfWriter(const std::filesystem::path& path, NetcdfFileType type);
  ~NetcdfWriter();  // closes the file
  NetcdfWriter(const NetcdfWriter&) = delete;
  NetcdfWriter& operator=(const NetcdfWriter&) = delete;

  /// `unlimited`: it is written as an unlimited dimension with `length` records.
  void dimension(const std::string& name, size_t length, bool unlimited = false);
  /// Writes an attribute of the file.
  void attribute(const std::string& name, const std::string& text);
  void variable(const std::string& name, NetcdfNumbers numbers, const std::vector<std::string>& dimensions,
                const NetcdfAttributes& attributes, const NetcdfFunction& value);

 private:
  struct Dimension {
    std::string name;
    size_t length;
    int id;
  };
  const Dimension& named(const std::string& name) const;

  int file_ = 0;
  NetcdfFileType type_;
  std::vector<Dimension> dimensions_;
};

}  // namespace curvisplat
