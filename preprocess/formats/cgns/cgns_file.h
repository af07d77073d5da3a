// A CGNS file as the tree of nodes that it is, HDF5 or ADF: names, labels, small values, and boxes of large
// arrays. What the nodes mean is in cgns_tree.h.
//
// HDF5 files are read with HDF5 itself (cgns_hdf5.h); libcgns never sees one. ADF files are read with
// libcgns' node layer (cgns_io.h), not with its upper one (cgnslib.h): that one reads all of the tree at
// opening, refuses whole files for boundary conditions that it does not like, and takes the sizes in a
// damaged file at their word. Here nothing is read but what is asked for, and every size is checked before
// memory is taken: dimensions against the file's bytes, types against what is read into.
//
// Neither library is thread-safe: every call is made under dataLibraryMutex(), so any number of threads may
// use a CgnsFile, one after the other. Links to other files are followed.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "preprocess/formats/cgns/cgns_node.h"
#include "stream/base/file.h"

namespace curvisplat {

class CgnsHdf5;

class CgnsFile {
 public:
  /// Throws Error, as every member function, with the file, the node and what the library says.
  explicit CgnsFile(std::filesystem::path path);
  ~CgnsFile();
  CgnsFile(const CgnsFile&) = delete;
  CgnsFile& operator=(const CgnsFile&) = delete;

  /// Whether `file` is an ADF file, or an HDF5 file that is called .cgns or has a node CGNSLibraryVersion.
  static bool recognises(const InputFile& file);

  const std::filesystem::path& path() const { return path_; }
  bool hdf5() const { return hdf5_ != nullptr; }

  CgnsNode root() const { return {}; }
  std::vector<CgnsNode> children(const CgnsNode& node) const;
  CgnsShape shape(const CgnsNode& node) const;

  /// Of small nodes: all numbers, or the text, or one text a column, without trailing spaces.
  std::vector<double> numbers(const CgnsNode& node) const;
  std::string text(const CgnsNode& node) const;
  std::vector<std::string> texts(const CgnsNode& node) const;

  /// Reads a box of the numbers of `node`, whose shape is `shape`. Elements of `to` outside the box stay as
  /// they are. No more memory is taken than for some rows.
  void read(const CgnsNode& node, const CgnsShape& shape, const CgnsBox& box, double* to) const;
  void read(const CgnsNode& node, const CgnsShape& shape, const CgnsBox& box, float* to) const;

 private:
  class OpenNode;
  [[noreturn]] void fail(const std::string& node_path) const;
  [[noreturn]] void damaged(const std::string& node_path, std::string_view what) const;
  CgnsShape storedShape(const OpenNode& open, const CgnsNode& node) const;
  void checkShape(const CgnsNode& node, const CgnsShape& shape) const;
  void checkSmall(const CgnsNode& node, const CgnsShape& shape, std::string_view type) const;
  template <typename Value>
  void readAdf(const CgnsNode& node, const CgnsShape& shape, const CgnsBox& box, Value* to) const;

  std::filesystem::path path_;
  uint64_t bytes_ = 0;
  std::unique_ptr<CgnsHdf5> hdf5_;  // null: an ADF file
  int file_ = 0;                    // libcgns' number of an ADF file
  double root_ = 0;                 // and of its root
};

}  // namespace curvisplat
