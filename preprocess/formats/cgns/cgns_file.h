// A CGNS file (HDF5 or ADF) as a tree of nodes: names, labels, small values, and boxes of large arrays.
// cgns_tree.h interprets the nodes.
//
// HDF5 files are read with HDF5 itself (cgns_hdf5.h), never with libcgns. ADF files are read with the node
// layer of libcgns (cgns_io.h), not with its mid-level library (cgnslib.h): cgnslib reads the whole tree
// when a file is opened, rejects files because of boundary conditions that nobody asked for, and trusts the
// sizes in a damaged file. CgnsFile reads only the nodes that are requested, and checks every size before it
// allocates: dimensions against the size of the file, types against the destination. Since libcgns also
// trusts the structures of ADF files, tryAdf() (adf_trial.h) lets it visit them in a child process first.
//
// Neither library is thread-safe: every call holds dataLibraryMutex(). Any number of threads may use a
// CgnsFile; their calls run one after the other. Links to other files are followed.
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

/// An open CGNS file of either format.
class CgnsFile {
 public:
  /// This and every member function throws Error with the file, the node and the library's message.
  explicit CgnsFile(std::filesystem::path path);
  ~CgnsFile();
  CgnsFile(const CgnsFile&) = delete;
  CgnsFile& operator=(const CgnsFile&) = delete;

  /// Whether `file` is an ADF file, or an HDF5 file that is named .cgns or has a node CGNSLibraryVersion.
  static bool recognises(const InputFile& file);

  const std::filesystem::path& path() const { return path_; }
  bool hdf5() const { return hdf5_ != nullptr; }

  CgnsNode root() const { return {}; }
  std::vector<CgnsNode> children(const CgnsNode& node) const;
  CgnsShape shape(const CgnsNode& node) const;

  /// The data of a small node: all numbers; the text; or one text for each column, without trailing spaces.
  std::vector<double> numbers(const CgnsNode& node) const;
  std::string text(const CgnsNode& node) const;
  std::vector<std::string> texts(const CgnsNode& node) const;

  /// Reads a box of the array of `node`, whose shape is `shape`. Elements of `to` outside the box are left
  /// unchanged. Needs a buffer of a few rows.
  void read(const CgnsNode& node, const CgnsShape& shape, const CgnsBox& box, double* to) const;
  void read(const CgnsNode& node, const CgnsShape& shape, const CgnsBox& box, float* to) const;

 private:
  class OpenNode;
  [[noreturn]] void fail(const std::string& node_path) const;
  [[noreturn]] void damaged(const std::string& node_path, std::string_view what) const;
  void checkLink(double id, const std::string& node_path) const;
  CgnsShape storedShape(const OpenNode& open, const CgnsNode& node) const;
  void checkShape(const CgnsNode& node, const CgnsShape& shape) const;
  void checkSmall(const CgnsNode& node, const CgnsShape& shape, std::string_view type) const;
  template <typename Value>
  void readAdf(const CgnsNode& node, const CgnsShape& shape, const CgnsBox& box, Value* to) const;

  std::filesystem::path path_;
  uint64_t bytes_ = 0;
  std::unique_ptr<CgnsHdf5> hdf5_;  // null: an ADF file
  int file_ = 0;                    // libcgns' id of an ADF file
  double root_ = 0;                 // libcgns' id of its root node
};

}  // namespace curvisplat
