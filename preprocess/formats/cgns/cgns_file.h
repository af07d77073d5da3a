// A CGNS file as the tree of nodes that it is, HDF5 or ADF: names, labels, small values, and boxes of large
// arrays. What the nodes mean is in cgns_tree.h.
//
// It stands on libcgns' node layer (cgns_io.h), not on its upper one (cgnslib.h): that one reads all of the
// tree at opening, refuses whole files for boundary conditions that it does not like, and takes the sizes in
// a damaged file at their word. Here nothing is read but what is asked for, and every size is checked before
// memory is taken: dimensions against the file's bytes, types against what is read into.
//
// libcgns is not thread-safe: every call is made under dataLibraryMutex(), so any number of threads may use a
// CgnsFile, one after the other. Links to other files are followed.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "stream/base/file.h"

namespace curvisplat {

struct CgnsNode {
  std::string path;  // "/Base/Zone 1/GridCoordinates"; the root's is empty
  std::string name, label;
  bool linked = false;  // it, or one above it, lies in another file
};

/// What a node's data are: a type as CGNS writes it ("R4", "I8", "C1"; "MT": none), and dimensions, the
/// fastest first.
struct CgnsShape {
  std::string type;
  std::vector<uint64_t> dims;
  uint64_t count() const;
  bool real() const { return type == "R4" || type == "R8"; }
  bool number() const { return real() || type == "I4" || type == "I8"; }
};

/// A box of a three-dimensional array, and where it goes in memory.
struct CgnsBox {
  std::array<uint64_t, 3> first{}, count{};  // in the array, from 0; count is not zero
  std::array<uint64_t, 2> memory{};          // elements along i and j of the memory that it is read to
};

class CgnsFile {
 public:
  /// Throws Error, as every member function, with the file, the node and what libcgns says.
  explicit CgnsFile(std::filesystem::path path);
  ~CgnsFile();
  CgnsFile(const CgnsFile&) = delete;
  CgnsFile& operator=(const CgnsFile&) = delete;

  /// Whether `file` is an ADF file, or an HDF5 file that is called .cgns or holds what CGNS files hold.
  static bool recognises(const InputFile& file);

  const std::filesystem::path& path() const { return path_; }
  bool hdf5() const { return hdf5_; }

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
  CgnsShape shapeOf(const OpenNode& open, const CgnsNode& node) const;
  void checkSmall(const CgnsNode& node, const CgnsShape& shape, std::string_view type) const;
  template <typename Value>
  void readHdf5(const CgnsNode& node, const CgnsBox& box, const char* type, Value* to) const;
  template <typename Value>
  void readAdf(const CgnsNode& node, const CgnsShape& shape, const CgnsBox& box, Value* to) const;

  std::filesystem::path path_;
  uint64_t bytes_ = 0;
  bool hdf5_ = false;
  int file_ = 0;     // libcgns' number of it
  double root_ = 0;  // and of its root
};

}  // namespace curvisplat
