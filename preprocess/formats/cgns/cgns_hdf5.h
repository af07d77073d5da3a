// The nodes of a CGNS file that is HDF5, read with HDF5 itself. libcgns never sees such a file: it reads text
// attributes into buffers of 3 and of 33 bytes, whatever their size in the file, so that any file whose root
// has an attribute `type` of more than two letters (every ROMS history file) overflows its stack.
//
// A node is a group, as CGNS's mapping to HDF5 lays down:
//
//   attribute "name"    text of at most 33 bytes; the link's name counts
//   attribute "label"   text of at most 33 bytes: "Zone_t"
//   attribute "type"    text of at most  3 bytes: "R8"; "MT": no data; "LK": stands for what " link" leads to
//   link " data"        data set, slowest dimension first
//   link " link"        group of this file or of another one
//   other links         nodes below it; names that begin with a space are CGNS's own
//
// Type, size and extent of each of these are checked before it is read, and memory is taken as they say.
// Attributes that CGNS does not need (`flags`, `order`) are not read. However links lead in circles, the
// nodes that are listed are bounded by what the files have room for.
//
// Every call is made under dataLibraryMutex(), so any number of threads may use a CgnsHdf5, one after the
// other.
#pragma once

#include <filesystem>
#include <set>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "preprocess/formats/cgns/cgns_node.h"
#include "preprocess/formats/common/hdf5_handle.h"

namespace curvisplat {

class CgnsHdf5 {
 public:
  /// Throws Error, as every member function, with the file, the node, what was expected and what was found.
  explicit CgnsHdf5(std::filesystem::path path);
  ~CgnsHdf5();
  CgnsHdf5(const CgnsHdf5&) = delete;
  CgnsHdf5& operator=(const CgnsHdf5&) = delete;

  /// Whether an HDF5 file has a group CGNSLibraryVersion, as all that CGNS's own library writes do. Throws
  /// nothing.
  static bool recognises(const std::filesystem::path& path);

  std::vector<CgnsNode> children(const CgnsNode& node) const;
  /// The type is as it stands in the file; the dimensions are of the data set.
  CgnsShape shape(const CgnsNode& node) const;

  /// All numbers, or the text, of a node with as many values as `to` has room for.
  void readAll(const CgnsNode& node, std::span<double> to) const;
  void readAll(const CgnsNode& node, std::span<char> to) const;
  void read(const CgnsNode& node, const CgnsBox& box, double* to) const;
  void read(const CgnsNode& node, const CgnsBox& box, float* to) const;

 private:
  struct Data {
    Hdf5DataSet set;
    Hdf5Space space;
  };

  [[noreturn]] void damaged(const std::string& node_path, std::string_view what) const;
  [[noreturn]] void unreadable(const std::string& node_path, std::string_view what) const;
  std::string text(const Hdf5Group& group, const std::string& node_path, const char* attribute,
                   size_t max_bytes) const;
  Hdf5Group behindLinks(Hdf5Group group, const std::string& node_path, bool may_be_missing) const;
  Hdf5Group open(const std::string& node_path) const;
  Data openData(const Hdf5Group& group, const std::string& node_path) const;
  void checkNumbers(const Data& data, const std::string& node_path) const;
  void count(const Hdf5Group& group, size_t nodes, const std::string& node_path) const;
  void readBox(const CgnsNode& node, const CgnsBox& box, hid_t type, void* to) const;

  std::filesystem::path path_;
  Hdf5File file_;
  // Guarded by dataLibraryMutex().
  mutable std::set<std::string> files_;  // that nodes were listed of
  mutable uint64_t files_bytes_ = 0, nodes_listed_ = 0;
};

}  // namespace curvisplat
