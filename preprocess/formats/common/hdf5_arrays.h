// Arrays of numbers in HDF5 files, read by position.
//
// A file of many grids names thousands of data sets, and an open one costs a chunk cache of 1 MiB and often a
// file descriptor, so that Hdf5Sets keeps only the last 16 open. Any number of threads may read an Hdf5Array;
// reads from HDF5 wait for one another.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <list>
#include <map>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "preprocess/formats/common/hdf5_objects.h"
#include "stream/base/error.h"
#include "stream/base/watched_file.h"

namespace curvisplat {

/// The open data sets, most recently used first. Guarded by dataLibraryMutex(), closing included.
class Hdf5Sets {
 public:
  Hdf5Sets() = default;
  ~Hdf5Sets();
  Hdf5Sets(const Hdf5Sets&) = delete;
  Hdf5Sets& operator=(const Hdf5Sets&) = delete;

  /// Calls use(identifier) with the mutex held; opens the data set unless it is open. Throws Error.
  void with(const std::filesystem::path& path, const std::string& name,
            const std::function<void(hid_t)>& use);
  /// Throws Error if a file of with(), or one that its links lead to, has become shorter since it was first opened. With
  /// the mutex held.
  void requireWhole(const std::filesystem::path& path) const { watched_.at(path).requireWhole(); }

 private:
  struct Open {
    std::filesystem::path path;
    std::string name;
    Hdf5File file;
    Hdf5DataSet set;
  };
  bool moveToFront(const std::filesystem::path& path, const std::string& name);

  std::list<Open> open_;
  std::map<std::filesystem::path, WatchedFiles> watched_;
};

/// The start of a part of an array, its step and its count along each dimension.
struct Hdf5Part {
  std::vector<uint64_t> start, stride, count;
};

/// A data set that has something else.
class Hdf5NoNumbers : public Error {
 public:
  using Error::Error;
};

/// A data set of integers or floating-point numbers.
class Hdf5Array {
 public:
  /// Throws Error, Hdf5NoNumbers if it is something else.
  Hdf5Array(std::shared_ptr<Hdf5Sets> sets, std::filesystem::path path, std::string name);

  /// "FILE: NAME", for messages.
  std::string where() const { return path_.string() + ": " + name_; }
  /// The slowest comes first.
  const std::vector<uint64_t>& dims() const { return dims_; }
  uint64_t size() const { return size_; }
  bool isFloat() const { return kind_ == H5T_FLOAT; }
  bool isSigned() const { return signed_; }
  /// Bytes of a number: 4 or 8, of integers 1 or 2, too.
  size_t bytes() const { return bytes_; }
  /// The bytes that the array takes in the file, packed; numbers that were never written take nothing.
  uint64_t storedBytes() const { return stored_bytes_; }

  /// The numbers [first, first + to.size()), in the order of the file. Throws Error.
  void read(uint64_t first, std::span<double> to) const;
  /// The same in the machine's type of this kind, of bytes(): to.size() / bytes() numbers.
  void readStored(uint64_t first, std::span<std::byte> to) const;
  /// The numbers of a part, which must be within the dimensions.
  void readPart(const Hdf5Part& part, double* to) const;

 private:
  enum class As { kDouble, kStored };
  using ReadPart = std::function<void(const Hdf5Part&, void*)>;
  hid_t memoryType() const;
  void readRange(As as, uint64_t first, uint64_t count, std::byte* to) const;
  void readParts(As as, const std::function<void(const ReadPart&)>& use) const;
  [[noreturn]] void fail(const std::string& what) const;

  std::shared_ptr<Hdf5Sets> sets_;
  std::filesystem::path path_;
  std::string name_;
  std::vector<uint64_t> dims_;
  uint64_t size_ = 1;
  H5T_class_t kind_ = H5T_NO_CLASS;
  bool signed_ = true;
  size_t bytes_ = 0;
  uint64_t stored_bytes_ = 0;
};

}  // namespace curvisplat
