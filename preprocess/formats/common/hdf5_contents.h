// The groups, attributes and arrays of an HDF5 file: what is checked before it is trusted. One thread opens and asks; any
// number may read the arrays, whose reads wait for one another.
#pragma once

#include <filesystem>
#include <initializer_list>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "preprocess/formats/common/hdf5_arrays.h"

namespace curvisplat {

class InputFile;

/// Returns which of the names are links of the file's root group; none where it is no HDF5 file. HDF5 tries it first in a
/// process of its own (library_trial.h). Throws Error for a file that is not whole, or that ends the library.
std::set<std::string> rootLinksOf(const InputFile& file, std::initializer_list<const char*> names);

class Hdf5Contents {
 public:
  /// Throws Error if HDF5 cannot read it.
  explicit Hdf5Contents(std::filesystem::path path);
  ~Hdf5Contents();
  Hdf5Contents(const Hdf5Contents&) = delete;
  Hdf5Contents& operator=(const Hdf5Contents&) = delete;

  std::string name() const { return path_.string(); }
  /// Throws Error: "FILE: PLACE: WHAT".
  [[noreturn]] void fail(const std::string& place, const std::string& what) const;

  /// Names of the links in a group, in the order of creation or by name; nothing without the group.
  std::vector<std::string> names(const std::string& group) const;
  /// Whether there is an object with this path, and a number that it has under all of its paths.
  std::optional<uint64_t> identity(const std::string& place) const;
  bool has(const std::string& place) const { return identity(place).has_value(); }

  /// The numbers of an attribute, `count` of them. Throws Error unless it has as many.
  std::vector<double> numbers(const std::string& group, const char* attribute, size_t count) const;
  bool hasAttribute(const std::string& group, const char* attribute) const;
  /// Empty without the attribute.
  std::string text(const std::string& group, const char* attribute) const;

  /// The text of a data set of one string; empty without it. Throws Error if it is something else.
  std::string textOf(const std::string& place) const;
  /// Null without the data set. Throws Error if it has no numbers.
  std::shared_ptr<const Hdf5Array> array(const std::string& place) const;
  /// The same, but throws Error without the data set: also where a link that is listed leads nowhere.
  std::shared_ptr<const Hdf5Array> required(const std::string& place) const;
  /// Some numbers of a list of integers. Throws Error if it does not have them.
  std::vector<int64_t> integers(const std::string& place, uint64_t first, uint64_t count) const;
  /// Returns integers() that count something. Throws Error for one below zero, too.
  std::vector<uint64_t> counts(const std::string& place, uint64_t first, uint64_t count) const;

 private:
  std::filesystem::path path_;
  Hdf5File file_;
  std::shared_ptr<Hdf5Sets> sets_ = std::make_shared<Hdf5Sets>();
  mutable std::map<std::string, std::shared_ptr<const Hdf5Array>> arrays_;
};

}  // namespace curvisplat
