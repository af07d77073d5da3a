// The nodes of a CGNS file that is HDF5, read with HDF5 itself. libcgns never opens such a file: it copies
// text attributes into buffers of 3 and 33 bytes without checking their size, so that every file whose root
// has an attribute `type` longer than two letters (every ROMS history file) overflows the stack.
//
// A node is a group, as in CGNS's mapping to HDF5:
//
//   attribute "name"    text of at most 33 bytes; the name of the link takes precedence
//   attribute "label"   text of at most 33 bytes: "Zone_t"
//   attribute "type"    text of at most  3 bytes: "R8"; "MT": no data; "LK": the node is a link
//   link " data"        data set, slowest dimension first
//   link " link"        of a node that is a link: the target, a group of this or of another file
//   other links         child nodes; names that begin with a space are reserved by CGNS
//
// The type, size and extent of each are checked before it is read, and the buffers have that size. Attributes
// that CGNS does not need (`flags`, `order`) are not read. Links may form cycles: the number of nodes listed
// is limited to what the files can hold.
//
// Every call holds dataLibraryMutex(): any number of threads may use a CgnsHdf5; their calls run one after
// the other.
#pragma once

#include <filesystem>
#include <set>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "preprocess/formats/cgns/cgns_node.h"
#include "preprocess/formats/common/hdf5_objects.h"
#include "stream/base/watched_file.h"

namespace curvisplat {

class CgnsHdf5 {
 public:
  /// This and every member function throws Error with the file, the node, and the values found and expected.
  explicit CgnsHdf5(std::filesystem::path path);
  ~CgnsHdf5();
  CgnsHdf5(const CgnsHdf5&) = delete;
  CgnsHdf5& operator=(const CgnsHdf5&) = delete;

  /// Whether an HDF5 file has a group CGNSLibraryVersion; every file that libcgns wrote has one. Throws
  /// nothing.
  static bool recognises(const std::filesystem::path& path);

  std::vector<CgnsNode> children(const CgnsNode& node) const;
  /// The type as stored in the file, and the dimensions of the data set.
  CgnsShape shape(const CgnsNode& node) const;

  /// Reads all numbers, or the text, of a node that has exactly to.size() values.
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
  /// Visits at most `most` of the nodes below, and their shapes, to try HDF5 on them in a child process.
  /// Ignores errors, which may be of nodes that nobody needs.
  void visitAll(const CgnsNode& node, int depth, size_t& most) const;
  void count(const Hdf5Group& group, size_t nodes, const std::string& node_path) const;
  void readBox(const CgnsNode& node, const CgnsBox& box, hid_t type, void* to) const;

  std::filesystem::path path_;
  WatchedFiles watched_;  // with those that links lead to
  Hdf5File file_;
  // Guarded by dataLibraryMutex().
  mutable std::set<std::string> files_;  // those whose nodes were listed
  mutable uint64_t files_bytes_ = 0, nodes_listed_ = 0;
};

}  // namespace curvisplat
