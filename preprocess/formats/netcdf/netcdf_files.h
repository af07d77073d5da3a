// One or more NetCDF files that describe one grid: coordinates and masks in one, fields in others.
// NetcdfFiles offers their variables and dimensions as those of one file. foreignNetcdf() names files that
// hold no structured grid by design. Any number of threads may use a NetcdfFiles; calls into libnetcdf run
// one after the other.
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

#include "preprocess/formats/netcdf/netcdf_file.h"

namespace curvisplat {

class NetcdfFiles {
 public:
  /// Dimensions of the same name and length are one dimension. If several files have a variable of the same
  /// name, the first file's is taken and duplicates() lists the others; but each file keeps its times since
  /// a date. Throws Error as NetcdfFile does, and for a file that is not NetCDF.
  explicit NetcdfFiles(const std::vector<std::filesystem::path>& paths);

  /// Of the first file.
  const std::filesystem::path& path() const { return files_.front()->path(); }
  const std::string& kind() const { return files_.front()->kind(); }
  std::vector<std::string> paths() const;

  const std::vector<NetcdfDimension>& dimensions() const { return dimensions_; }
  const std::vector<NetcdfVariable>& variables() const { return variables_; }
  const NetcdfVariable* find(std::string_view name) const;
  /// The coordinate of a dimension: in the file of `data` if it is there.
  const NetcdfVariable* coordinateOf(size_t dimension, const NetcdfVariable& data) const;
  const NetcdfDimension& dimension(const NetcdfVariable& variable, size_t axis) const;
  /// One sentence for each further file with variables that an earlier file has too.
  const std::vector<std::string>& duplicates() const { return duplicates_; }

  /// Of the first file that has the attribute; as NetcdfFile's.
  std::string text(const char* attribute) const;
  bool hasAttribute(const char* attribute) const;
  std::optional<double> number(const char* attribute) const;
  /// Of the first file; as NetcdfFile's.
  const std::vector<std::string>& groups() const { return files_.front()->groups(); }
  bool plainHdf5() const { return files_.front()->plainHdf5(); }

  /// As NetcdfFile's.
  std::string missingValues(const NetcdfVariable& variable) const;
  void read(const NetcdfVariable& variable, const NetcdfBox& box, std::span<double> to) const;
  void read(const NetcdfVariable& variable, const NetcdfBox& box, std::span<float> to) const;
  std::string readText(const NetcdfVariable& variable) const;
  void release() const;

 private:
  void add(const NetcdfFile& file);

  std::vector<std::unique_ptr<NetcdfFile>> files_;
  std::vector<NetcdfDimension> dimensions_;
  std::vector<NetcdfVariable> variables_;
  std::map<std::string, size_t, std::less<>> numbers_;  // of the first of each name
  std::vector<std::string> duplicates_;
};

/// What the files hold if it is no structured grid by design, an unstructured mesh or plain HDF5: "an
/// unstructured mesh (UGRID)", "an HDF5 file, but neither NetCDF-4 nor CGNS". nullopt for any other file.
std::optional<std::string> foreignNetcdf(const NetcdfFiles& file);

}  // namespace curvisplat
