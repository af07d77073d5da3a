// One or more NetCDF files that describe one grid: coordinates and masks in one, fields in others.
// NetcdfFiles offers their variables and dimensions as those of one file; a dimension of which the user has
// chosen one value has the length 1, and parts of a map are one file (netcdf_tiles.h). foreignNetcdf() names files that hold no structured
// grid by design. Any number of threads may use a NetcdfFiles; calls into libnetcdf run one after the other.
#pragma once

#include <cstddef>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "preprocess/formats/common/open_grid_options.h"
#include "preprocess/formats/netcdf/netcdf_tiles.h"

namespace curvisplat {

class NetcdfFiles {
 public:
  /// Dimensions of the same name and length are one dimension, and so are ICON's cells by either name. If
  /// several files have a variable of the same name, the first file's is taken and warnings() lists the
  /// others; but each file keeps its times since a date. Only the files and `select` of the options matter.
  /// Throws Error as NetcdfFile does, and for a file that is not NetCDF; UsageError for a selection of what
  /// is not there.
  explicit NetcdfFiles(const OpenGridOptions& options);

  /// The path of the first file.
  const std::filesystem::path& path() const { return files_.front().front().path(); }
  const std::string& kind() const { return files_.front().front().kind(); }
  std::vector<std::string> paths() const;

  const std::vector<NetcdfDimension>& dimensions() const { return dimensions_; }
  const std::vector<NetcdfVariable>& variables() const { return variables_; }
  const NetcdfVariable* find(std::string_view name) const;
  /// The coordinate of a dimension: in the file of `data` if it is there.
  const NetcdfVariable* coordinateOf(size_t dimension, const NetcdfVariable& data) const;
  const NetcdfDimension& dimension(const NetcdfVariable& variable, size_t axis) const;
  /// One sentence for each further file with variables that an earlier file has too, and for each map of which parts are missing.
  const std::vector<std::string>& warnings() const { return warnings_; }
  /// The chosen values of dimensions, for messages: "month 3"; empty if there are none.
  const std::string& selected() const { return selected_; }

  /// The text of an attribute in the first file that has it, as NetcdfFile::text() returns it.
  std::string text(const char* attribute) const;
  bool hasAttribute(const char* attribute) const;
  std::optional<double> number(const char* attribute) const;
  std::vector<double> numbers(const char* attribute) const;
  /// The groups of the first file, as NetcdfFile::groups() returns them.
  const std::vector<std::string>& groups() const { return files_.front().front().groups(); }
  bool plainHdf5() const { return files_.front().front().plainHdf5(); }

  /// Describes the missing values as NetcdfFile does.
  std::string missingValues(const NetcdfVariable& variable) const;
  void read(const NetcdfVariable& variable, const NetcdfBox& box, std::span<double> to) const;
  void read(const NetcdfVariable& variable, const NetcdfBox& box, std::span<float> to) const;
  std::string readText(const NetcdfVariable& variable) const;
  void release() const;

 private:
  void add(size_t number);
  void select(const std::string& choice);
  size_t indexOf(size_t dimension, const std::string& value) const;
  template <typename Value>
  void readFrom(const NetcdfVariable& variable, const NetcdfBox& box, std::span<Value> to) const;

  std::vector<NetcdfTiles> files_;
  std::vector<NetcdfDimension> dimensions_;
  std::vector<size_t> first_;  // [dimension]: the index of the chosen value; 0 where all are read
  std::string selected_;
  std::vector<NetcdfVariable> variables_;
  std::map<std::string, size_t, std::less<>> numbers_;  // of the first of each name
  std::vector<std::string> warnings_;
};

/// Describes the contents if the files are no structured grid by design, but an unstructured mesh or plain
/// HDF5: "an unstructured mesh (UGRID)", "an HDF5 file, but neither NetCDF-4 nor CGNS". nullopt for any other
/// file.
std::optional<std::string> foreignNetcdf(const NetcdfFiles& file);

}  // namespace curvisplat
