// A NetCDF file, classic or NetCDF-4: its dimensions, variables and attributes, and boxes of values,
// unpacked, with NaN for missing values. cf_grid.h interprets the variables. A Zarr store is one, too
// (zarr_file.h, openNetcdfFile()).
//
// NetCDF is not thread-safe: every call holds dataLibraryMutex(). Any number of threads may use a NetcdfFile;
// their calls run one after the other. Besides the destination, a read needs a chunk cache for each variable,
// or memory for one chunk where a compressed chunk is larger than that cache.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "preprocess/formats/netcdf/netcdf_variable.h"
#include "stream/base/file.h"
#include "stream/base/watched_file.h"

namespace curvisplat {

/// A box of a variable: start and count along each dimension, slowest first.
struct NetcdfBox {
  std::vector<size_t> start, count;
  size_t values() const;
};

class NetcdfFile {
 public:
  /// This and every member function throws Error with the file, the variable and NetCDF's message.
  explicit NetcdfFile(const std::filesystem::path& path);
  virtual ~NetcdfFile();
  NetcdfFile(const NetcdfFile&) = delete;
  NetcdfFile& operator=(const NetcdfFile&) = delete;

  /// Checks the signature. Every HDF5 file is accepted as NetCDF-4.
  static bool recognises(const InputFile& file);

  const std::filesystem::path& path() const { return path_; }
  const std::string& kind() const { return kind_; }  // "NetCDF classic", "NetCDF-4"
  /// Whether it is an HDF5 file that was not written as NetCDF-4.
  bool plainHdf5() const { return plain_hdf5_; }
  const std::vector<NetcdfDimension>& dimensions() const { return dimensions_; }
  const std::vector<NetcdfVariable>& variables() const { return variables_; }
  const NetcdfVariable* find(std::string_view name) const;
  /// Names of the root's groups that have variables or groups of their own, which are not read.
  const std::vector<std::string>& groups() const { return groups_; }
  /// The text of an attribute of the file; empty if there is none, or if it is not text.
  std::string text(const char* attribute) const { return of_file_.text(attribute); }
  bool hasAttribute(const char* attribute) const { return of_file_.attributes.contains(attribute); }
  /// A numeric attribute of the file; empty if there is none, or if it is text.
  const std::vector<double>& numbers(const char* attribute) const { return of_file_.numbers(attribute); }
  /// The same with one value.
  std::optional<double> number(const char* attribute) const;
  /// Describes the stored values of a variable that read() replaces by NaN; empty if none.
  std::string missingValues(const NetcdfVariable& variable) const {
    return packings_.at(variable.position).missingValues();
  }
  const NetcdfDimension& dimension(const NetcdfVariable& variable, size_t axis) const;

  /// Reads box.values() values to the beginning of `to`, as NetcdfPacking unpacks them.
  void read(const NetcdfVariable& variable, const NetcdfBox& box, std::span<double> to) const;
  void read(const NetcdfVariable& variable, const NetcdfBox& box, std::span<float> to) const;
  /// Closes the file until the next call that needs it, which opens it again: an open NetCDF-4 file keeps some MiB.
  /// A file that was unpacked, whose name has gone, stays open and frees what its variables' caches hold.
  virtual void release() const;

  /// The characters of a variable of text (NC_CHAR); empty if it is not one or has more than 16 MiB.
  virtual std::string readText(const NetcdfVariable& variable) const;
  /// The strings of a variable: NC_STRING, or NC_CHAR, whose last dimension counts characters (zeros and spaces at the end are left
  /// out). Empty if it is neither, or has more than 65,536 strings.
  virtual std::vector<std::string> readStrings(const NetcdfVariable& variable) const;

 protected:
  struct NotOpened {};
  NetcdfFile(const std::filesystem::path& path, NotOpened) : path_(path) {}
  void addVariable(NetcdfVariable variable);

  std::filesystem::path path_;
  std::string kind_;
  std::vector<NetcdfDimension> dimensions_;
  std::vector<std::string> groups_;
  NetcdfVariable of_file_;  // its attributes are the file's

 private:
  /// Reads stored values.
  virtual void readStored(const NetcdfVariable& variable, const NetcdfBox& box, std::span<double> to) const;
  virtual void readStored(const NetcdfVariable& variable, const NetcdfBox& box, std::span<float> to) const;
  [[noreturn]] void fail(const std::string& place, int status) const;
  /// Opens the file again if it was released; dataLibraryMutex() must be held. Throws Error if it is another by now.
  int opened() const;
  void emptyCaches() const;
  void readHeader();
  void readGroups();
  void readVariable(int id);
  void readAttributes(int id, int count, NetcdfVariable& variable) const;
  void checkSizes(uint64_t file_bytes) const;
  template <typename Value>
  void readUnpacked(const NetcdfVariable& variable, const NetcdfBox& box, std::span<Value> to) const;
  template <typename Value, typename Get>
  void readWith(const Get& get, const NetcdfVariable& variable, const NetcdfBox& box,
                std::span<Value> to) const;

  mutable int file_ = -1;  // -1: released
  WatchedFiles watched_;   // with those that links lead to
  bool plain_hdf5_ = false;
  std::optional<uint64_t> records_;  // of a classic file
  std::vector<NetcdfVariable> variables_;
  std::vector<NetcdfPacking> packings_;  // [variable]
};

}  // namespace curvisplat
